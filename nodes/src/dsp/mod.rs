//! Filters, gains, delays, resampling and signal sources on audio.
//!
//! All functions work on interleaved slices without allocation. Their output does not depend on how a signal is cut into blocks:
//! sources are functions of the absolute sample index, and processors store their state from sample to sample.

mod channel;
mod error;
mod filter;
mod lanes;
mod level;
mod rate;
mod source;
mod time;
mod transition;

#[cfg(test)]
pub(crate) mod testing;

pub use channel::channels::ChannelMap;
pub use channel::mono::{channel_copy, channel_mean};
pub use channel::pan::{Balance, Pan};
pub use error::DspError;
pub use filter::butterworth::{Band, Butterworth, Cascade};
pub use filter::section::{Biquad, Section};
pub use filter::zero_phase::zero_phase;
pub(crate) use lanes::fold_lanes;
pub use level::limiter::PeakLimiter;
pub use level::loudness_meter::LoudnessMeter;
pub use level::meter::{Level, LevelMeter};
pub(crate) use level::ramp::ramp_frames;
pub use level::ramp::{Gain, db_to_linear, linear_to_db, modulate};
pub use level::reference::Reference;
pub use level::sound_meter::{SoundFigures, SoundMeter};
pub use level::weighting::{LUFS_OFFSET, Weighting, WeightingFilter, weighted_rms};
pub use rate::resampler::{Quality, Resampler};
pub use source::midi_notes::{NoteRules, read_midi_notes};
pub use source::noise_generator::{GaussianNoise, PinkNoise, UniformNoise};
pub use source::oscillator::{Saw, Sine, Square};
pub use source::sweep::{Sweep, SweepLaw};
pub use source::trigger::Trigger;
pub use source::trigger_table::read_trigger_table;
pub use time::advance::{Advance, AdvanceParams, AdvancePorts};
pub use time::delay::{Delay, FractionalDelay};
pub use transition::crossfade::crossfade;
pub use transition::dropout::Dropout;
pub use transition::fade::{Fade, FadeLaw};

/// The nodes of this family.
pub mod nodes {
    pub use super::channel::channels::{ChannelsNode, ChannelsParams};
    pub use super::channel::mix::{MixIo, MixNode, MixParams, MixPorts};
    pub use super::channel::mono::{MonoNode, MonoParams};
    pub use super::channel::pan::{PanIo, PanNode, PanParams, PanPorts};
    pub use super::filter::biquad::{BiquadKind, BiquadNode, BiquadParams};
    pub use super::filter::high_pass::{HighPassNode, HighPassParams};
    pub use super::filter::low_pass::{LowPassNode, LowPassParams};
    pub use super::filter::node::{FilterIo, FilterPorts};
    pub use super::level::gain::{GainIo, GainNode, GainParams, GainPorts};
    pub use super::level::level_meter::{LevelMeterIo, LevelMeterNode, LevelMeterParams, LevelMeterPorts};
    pub use super::level::limiter::{Limiter, LimiterIo, LimiterParams, LimiterPorts};
    pub use super::level::loudness::{LoudnessIo, LoudnessNode, LoudnessParams, LoudnessPorts};
    pub use super::level::normalize::{NormalizeIo, NormalizeNode, NormalizeParams, NormalizePorts};
    pub use super::level::transient_transfer::{
        TransientTransfer, TransientTransferIo, TransientTransferParams, TransientTransferPorts,
    };
    pub use super::rate::resample::{ResampleIo, ResampleNode, ResampleParams, ResamplePorts};
    pub use super::source::impulses::{ImpulsesIo, ImpulsesNode, ImpulsesParams, ImpulsesPorts};
    pub use super::source::metronome::{MetronomeIo, MetronomeNode, MetronomeParams, MetronomePorts};
    pub use super::source::noise::{NoiseColour, NoiseNode, NoiseParams};
    pub use super::source::output::{SourceIo, SourcePorts};
    pub use super::source::sweep::{SweepNode, SweepParams};
    pub use super::source::tone::{ToneNode, ToneParams, Waveform};
    pub use super::source::trigger_file::{TriggerFile, TriggerFileIo, TriggerFileParams, TriggerFilePorts};
    pub use super::time::advance::{Advance, AdvanceIo, AdvanceParams, AdvancePorts};
    pub use super::time::delay::{DelayIo, DelayNode, DelayParams, DelayPorts};
    pub use super::time::feedback::{FeedbackIo, FeedbackNode, FeedbackParams, FeedbackPorts};
    pub use super::time::trim::{TrimIo, TrimNode, TrimParams, TrimPorts};
    pub use super::transition::crossfade::{CrossfadeIo, CrossfadeNode, CrossfadeParams, CrossfadePorts};
    pub use super::transition::fade::{FadeIo, FadeNode, FadeParams, FadePorts};
}

/// Returns the number of items nearest to a time in seconds.
fn nearest_items(rate: crate::core::time::Rate, seconds: f64) -> usize {
    (seconds * rate.as_f64()).round() as usize
}
