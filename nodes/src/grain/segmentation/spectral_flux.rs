//! The node `SpectralFlux`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::db_to_linear;
use crate::feature::flux::{Excerpt, FluxFrames, FluxStream};
use crate::{archive_state, params, ports};

params! {
    /// Measures the change of the shape of a spectrum from one frame to the next, independently of its level.
    ///
    /// The flux is the Euclidean distance of the normalised spectra of successive frames: 0 for a steady sound, about 0.5 for noise with the
    /// default frames, 1 where sound begins after silence, and at most the square root of 2. Item `k` lies at sample `k hop`, and compares
    /// the frames that are centred on the samples `(k - 1) hop` and `k hop`; item 0 equals item 1. The sound is reflected at its ends.
    ///
    /// `GrainDictionary` cuts recordings by these items, and `FluxSegmenter` finds the cuts in them.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.2, with the
    /// power spectrum, `exponent: 2`; magnitudes are dominated less by the strongest peak.
    pub struct SpectralFluxParams {
        /// Samples of a frame; None for a power of two that lasts about 12 ms, 512 at 44.1 kHz.
        frame: Option<usize> = None, unit "samples", range 2..=65_536_usize;
        /// Samples from one frame to the next; None for a quarter of a frame.
        hop: Option<usize> = None, unit "samples", range 1..=65_536_usize;
        /// Exponent of the magnitudes: 1, or 2 for the power spectrum of the paper.
        exponent: u32 = 1, unit "", range 1..=2_u32;
        /// Level of full scale below which a frame is silent.
        silence: f64 = -120.0, unit "dB", range -200.0..=0.0;
    }
}
ports! {
    /// Ports of `SpectralFlux`.
    pub struct SpectralFluxPorts / SpectralFluxIo {
        in {
            /// The sound, mono.
            audio: Stream<f32>,
        }
        out {
            /// The flux, one item per hop.
            flux: Stream<f32>,
        }
    }
}

/// The node over [`FluxStream`].
pub struct SpectralFlux {
    stream: FluxStream,
    /// Samples of the sound, if it has an end.
    len: Option<i64>,
}

impl SpectralFluxParams {
    fn frames(&self, rate: f64) -> FluxFrames {
        let default = FluxFrames::at_rate(rate);
        let frame = self.frame.unwrap_or(default.frame);
        FluxFrames { frame, hop: self.hop.unwrap_or((frame / 4).max(1)), exponent: self.exponent }
    }
}

/// Refuses audio of several channels.
///
/// # Errors
/// When it has more than one.
pub(in crate::grain) fn mono(Channels(channels): Channels, field: &str) -> Result<(), Reject> {
    if channels == 1 {
        return Ok(());
    }
    let message = format!("`{field}` has {channels} channels, and is analysed as one");
    Err(Reject::new("F046", message).at(field).help("insert Mono before it"))
}

/// The rate of frames every `hop` samples.
///
/// # Errors
/// When it is too slow for a stream.
pub(in crate::grain) fn frame_rate(rate: Rate, hop: usize) -> Result<Rate, Reject> {
    let too_long = || Reject::new("F051", format!("a hop of {hop} samples at {rate} is too long")).at("hop");
    rate.divided_by(hop as u64).ok_or_else(too_long)
}

impl Node for SpectralFlux {
    type Params = SpectralFluxParams;
    type Ports = SpectralFluxPorts;
    const NAME: &'static str = "SpectralFlux";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 20.0;

    fn shape(p: &SpectralFluxParams, s: &mut Shape<'_, '_, SpectralFluxPorts>) -> Result<(), Reject> {
        let audio = s.input(SpectralFluxPorts::audio);
        s.check(mono(audio.format, "audio"));
        let frames = p.frames(audio.rate.as_f64());
        let [behind, ahead] = FluxStream::lookaround(frames);
        s.lookaround(SpectralFluxPorts::audio, behind, ahead);
        // The last frame may be centred on the end.
        s.ends(audio.items().map(|n| audio.rate.tick(n) + i64::from(n > 0)));
        s.output(SpectralFluxPorts::flux, frame_rate(audio.rate, frames.hop)?, Channels(1));
        Ok(())
    }

    fn build(p: &SpectralFluxParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(SpectralFluxPorts::audio);
        let frames = p.frames(audio.rate.as_f64());
        let stream = FluxStream::new(frames, db_to_linear(p.silence));
        Ok(Self { stream, len: audio.items() })
    }

    fn run(&mut self, mut io: SpectralFluxIo<'_>) -> Result<(), Fault> {
        let first = io.audio.first() - io.audio.behind() as i64;
        let around = Excerpt { samples: io.audio.around(), first, len: self.len };
        for (k, flux) in (io.flux.first()..).zip(io.flux.items()) {
            *flux = self.stream.item(k, around);
        }
        Ok(())
    }

    archive_state!(stream);

    fn trial(rng: &mut Rng) -> (SpectralFluxParams, MemoryFiles) {
        let p = SpectralFluxParams::trial(rng);
        let frame = p.frame.map_or_else(|| 2 + rng.below(30), |frame| 2 + frame % 30);
        let hop = p.hop.map(|hop| 1 + hop % 12);
        (SpectralFluxParams { frame: Some(frame), hop, ..p }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::feature::spectral_flux;

    fn streamed(x: &[f32], window: usize) -> Vec<f32> {
        let standalone = Standalone::new::<SpectralFlux>(SpectralFluxParams::read(&|_| None).unwrap());
        let rate = Rate::hz(44_100);
        let standalone = standalone.input(SpectralFluxPorts::audio, rate, Channels(1), x.to_vec());
        standalone.window(rate.span(window)).run().unwrap().stream(SpectralFluxPorts::flux)
    }

    #[test]
    fn the_stream_equals_the_flux_of_the_whole_recording() {
        let mut rng = Rng::new(1);
        let x: Vec<f32> = (0..20_000)
            .map(|i| if (6000..9000).contains(&i) { 0.0 } else { rng.between(-0.5, 0.5) as f32 })
            .collect();
        let frames = FluxFrames::at_rate(44_100.0);
        for len in [0, 1, 127, 128, 129, 300, 512, 5000, 5120, 20_000] {
            let whole: Vec<f32> = spectral_flux(&x[..len], frames).into_iter().map(|f| f as f32).collect();
            for window in [1, 100, 4096].into_iter().filter(|window| *window > 1 || len < 1000) {
                assert_eq!(streamed(&x[..len], window), whole, "{len} samples in windows of {window}");
            }
        }
        assert!(streamed(&x, 4096).iter().all(|f| (0.0..=1.4143).contains(f)));
    }

    #[test]
    fn the_power_spectrum_is_ruled_by_the_strongest_peak() {
        let mut rng = Rng::new(2);
        let tone = |i: usize| 0.5 * (0.3 * i as f32).sin() + 0.01 * rng.between(-1.0, 1.0) as f32;
        let x: Vec<f32> = (0..20_000).map(tone).collect();
        let mean = |exponent| {
            let flux = spectral_flux(&x, FluxFrames { exponent, ..FluxFrames::at_rate(44_100.0) });
            flux[4..140].iter().sum::<f64>() / 136.0
        };
        assert!(mean(2) < 0.3 * mean(1), "{} {}", mean(1), mean(2));
    }
}
