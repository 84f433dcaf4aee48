//! Filters, gains, delays, resampling and signal sources on audio.
//!
//! Everything works on interleaved slices without allocating, and gives the same bits however a signal is cut into blocks:
//! sources are functions of the absolute sample index, and processors carry their state from sample to sample.

mod advance;
mod biquad;
mod biquad_node;
mod butterworth;
mod channels;
mod clicks;
mod crossfade;
mod delay;
mod dropout;
mod fade;
mod feedback;
mod frames;
mod gain;
mod loudness;
mod mix;
pub(crate) mod node;
mod noise;
mod noise_node;
mod pan;
mod resample;
mod resample_node;
mod source;
mod tone;
mod tone_node;
mod trim;

pub use advance::{Advance, AdvanceParams, AdvancePorts};
pub use biquad::{Biquad, Section};
pub use butterworth::{Band, Butterworth, Cascade};
pub use channels::{ChannelMap, channel_copy, channel_mean};
pub use clicks::Trigger;
pub use crossfade::crossfade;
pub use delay::{Delay, FractionalDelay};
pub use dropout::Dropout;
pub use fade::{Fade, FadeLaw};
pub use gain::{Gain, db_to_linear, linear_to_db, modulate};
pub use loudness::{Level, LevelMeter};
pub use noise::{GaussianNoise, PinkNoise, UniformNoise};
pub use pan::{Balance, Pan};
pub use resample::{Quality, Resampler};
pub use tone::{Saw, Sine, Square, Sweep, SweepLaw};

/// The nodes of this family.
pub mod nodes {
    pub use super::biquad_node::{BiquadKind, BiquadNode, BiquadParams};
    pub use super::butterworth::{
        FilterIo, FilterPorts, HighPassNode, HighPassParams, LowPassNode, LowPassParams,
    };
    pub use super::channels::{ChannelsNode, ChannelsParams, MonoNode, MonoParams};
    pub use super::clicks::{
        ImpulsesIo, ImpulsesNode, ImpulsesParams, ImpulsesPorts, MetronomeIo, MetronomeNode, MetronomeParams,
        MetronomePorts,
    };
    pub use super::crossfade::{CrossfadeIo, CrossfadeNode, CrossfadeParams, CrossfadePorts};
    pub use super::delay::{DelayIo, DelayNode, DelayParams, DelayPorts};
    pub use super::fade::{FadeIo, FadeNode, FadeParams, FadePorts};
    pub use super::feedback::{FeedbackIo, FeedbackNode, FeedbackParams, FeedbackPorts};
    pub use super::frames::{LevelMeterIo, LevelMeterNode, LevelMeterParams, LevelMeterPorts};
    pub use super::gain::{GainIo, GainNode, GainParams, GainPorts};
    pub use super::loudness::{
        LoudnessIo, LoudnessNode, LoudnessParams, LoudnessPorts, NormalizeIo, NormalizeNode, NormalizeParams,
        NormalizePorts,
    };
    pub use super::mix::{MixIo, MixNode, MixParams, MixPorts};
    pub use super::noise_node::{NoiseColour, NoiseNode, NoiseParams};
    pub use super::pan::{PanIo, PanNode, PanParams, PanPorts};
    pub use super::resample_node::{ResampleIo, ResampleNode, ResampleParams, ResamplePorts};
    pub use super::source::{SourceIo, SourcePorts};
    pub use super::tone_node::{SweepNode, SweepParams, ToneNode, ToneParams, Waveform};
    pub use super::trim::{TrimIo, TrimNode, TrimParams, TrimPorts};
}

/// A parameter out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what} is {found}; it must be {wanted}")]
pub struct DspError {
    /// The parameter.
    pub what: &'static str,
    /// Its value.
    pub found: f64,
    /// What would be right.
    pub wanted: &'static str,
}

impl DspError {
    pub(crate) fn check(
        ok: bool,
        what: &'static str,
        found: f64,
        wanted: &'static str,
    ) -> Result<(), DspError> {
        if ok && found.is_finite() { Ok(()) } else { Err(DspError { what, found, wanted }) }
    }
}

#[cfg(test)]
pub(crate) mod testing {
    //! Cutting a signal into blocks must not change a bit.

    /// Runs `process(start, block)` over `signal` in blocks of 1, 7, 64, 1000 and of everything, each with fresh state
    /// from `new`, and asserts equal bits.
    pub fn assert_block_invariant<S>(
        signal: &[f32],
        channels: usize,
        new: impl Fn() -> S,
        process: impl Fn(&mut S, i64, &mut [f32]),
    ) {
        let run = |frames: usize| -> Vec<u32> {
            let mut state = new();
            let mut out = signal.to_vec();
            for (i, block) in out.chunks_mut(frames * channels).enumerate() {
                process(&mut state, (i * frames) as i64, block);
            }
            out.iter().map(|x| x.to_bits()).collect()
        };
        let whole = run(signal.len() / channels);
        for frames in [1, 7, 64, 1000] {
            assert!(run(frames) == whole, "blocks of {frames} frames differ");
        }
    }

    /// A rough test signal: an impulse, then something like music.
    pub fn signal(frames: usize, channels: usize) -> Vec<f32> {
        let mut out: Vec<f32> = (0..frames * channels)
            .map(|i| (0.37 * i as f32).sin() * (0.011 * i as f32).cos() * ((i * 7919 % 101) as f32 / 101.0))
            .collect();
        out[0] = 1.0;
        out
    }
}
