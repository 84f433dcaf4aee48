//! The node `Resample`.

use super::resampler::{Quality, Resampler};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{choices, params, ports};

choices!(@param Quality {
    /// Flat to 0.75 of the lower Nyquist frequency, alias -57 dB, 30 taps.
    Draft,
    /// Flat to 0.88, alias -98 dB, 108 taps.
    Standard,
    /// Flat to 0.92, alias -118 dB, 196 taps.
    High,
});
params! {
    /// Converts audio to another sample rate without drift or delay.
    ///
    /// Output item `j` is the band-limited input at the exact time of `j`.
    ///
    /// # Source
    /// J. O. Smith, "Digital Audio Resampling" (bandlimited interpolation).
    pub struct ResampleParams {
        /// The new rate.
        rate: Rate = Rate::hz(48_000);
        /// Width of the pass-band, attenuation of aliases, and cost.
        quality: Quality = Quality::High;
    }
}
ports! {
    /// Ports of `Resample`.
    pub struct ResamplePorts / ResampleIo {
        in {
            /// Audio at any rate.
            audio: Stream<f32>,
        }
        out {
            /// The audio at the new rate.
            out: Stream<f32>,
        }
    }
}

/// The node `Resample`.
#[derive(Debug)]
pub struct ResampleNode(Resampler);

impl Node for ResampleNode {
    type Params = ResampleParams;
    type Ports = ResamplePorts;
    const NAME: &'static str = "Resample";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 150.0;

    fn shape(p: &ResampleParams, s: &mut Shape<'_, '_, ResamplePorts>) -> Result<(), Reject> {
        let audio = s.input(ResamplePorts::audio);
        let lookaround = Resampler::lookaround(audio.rate, p.rate, p.quality);
        let (look_behind, look_ahead) = lookaround.map_err(|e| Reject::from(e).at("rate"))?;
        // The first output of the window may lie between its first input and the one before.
        s.lookaround(ResamplePorts::audio, look_behind + usize::from(audio.rate != p.rate), look_ahead);
        s.output(ResamplePorts::out, p.rate, audio.format);
        Ok(())
    }

    fn build(p: &ResampleParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let from = cx.input(ResamplePorts::audio).rate;
        Ok(Self(Resampler::new(from, p.rate, p.quality)?))
    }

    fn run(&mut self, mut io: ResampleIo<'_>) -> Result<(), Fault> {
        let first_in = io.audio.first() - io.audio.behind() as i64;
        let (first_out, channels) = (io.out.first(), io.audio.width());
        self.0.process(first_out, io.audio.around(), first_in, channels, io.out.items())?;
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (ResampleParams, MemoryFiles) {
        // The filter of a draft is cheap to design and shorter than the input.
        let quality = [Quality::Draft, Quality::Draft, Quality::Standard][rng.below(3)];
        (ResampleParams { quality, ..ResampleParams::trial(rng) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Tick, ticks};

    fn resample(from: Rate, to: Rate, audio: Vec<f32>, window: Tick) -> Vec<f32> {
        let standalone =
            Standalone::new::<ResampleNode>(ResampleParams { rate: to, quality: Quality::Standard });
        let standalone = standalone.input(ResamplePorts::audio, from, Channels(1), audio).window(window);
        standalone.run().unwrap().stream(ResamplePorts::out)
    }

    #[test]
    fn a_click_stays_at_its_time() {
        for (from, to) in [(44_100, 48_000), (48_000, 44_100), (8000, 48_000), (48_000, 8000)] {
            let mut click = vec![0.0; from as usize / 4];
            click[from as usize / 10] = 1.0;
            let out = resample(Rate::hz(from), Rate::hz(to), click, ticks(0.01));
            assert_eq!(out.len(), to as usize / 4);
            let peak = (0..out.len()).max_by(|&a, &b| out[a].total_cmp(&out[b]));
            assert_eq!(peak, Some(to as usize / 10), "{from} -> {to}");
        }
    }

    #[test]
    fn rates_without_a_common_divisor_do_not_drift_in_windows_of_any_length() {
        let (from, to) = (Rate::new(44_101, 3).unwrap(), Rate::new(24_000_000, 1001).unwrap());
        let tone: Vec<f32> = (0..3000).map(|i| (f64::from(i) * 0.3).sin() as f32).collect();
        let expected = resample(from, to, tone.clone(), ticks(1.0));
        for window in [to.span(1), to.span(7), ticks(0.00123)] {
            assert_eq!(resample(from, to, tone.clone(), window), expected);
        }
        for (j, x) in expected.iter().enumerate().skip(500).take(3000) {
            let at = j as f64 / to.as_f64() * from.as_f64();
            assert!((f64::from(*x) - (at * 0.3).sin()).abs() < 1e-4, "item {j}");
        }
    }
}
