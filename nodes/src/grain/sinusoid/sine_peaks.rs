//! The node `SinePeaks`.

use super::item::{FrameFormat, PeakFrames};
use super::peaks::{PeakFinder, PeakRules, PeakWindow, SinePeak};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::grain::segmentation::spectral_flux::{frame_rate, mono};
use crate::{params, ports};

params! {
    /// Finds the sinusoids in each frame of a sound: frequency, amplitude and phase of the peaks of its spectrum.
    ///
    /// Frame `k` is centred on sample `k hop`; outside the sound is silence. A parabola through the levels of a bin and of its neighbours
    /// gives frequency and amplitude. A long window separates tones that are close; a short one, such as 1023 samples, follows glides and decays.
    /// A steady tone between 300 and 5000 Hz is found within 0.009 Hz and 0.003 dB with the defaults, 0.017 Hz and 0.005 dB with
    /// `Blackman`, 0.036 Hz and 0.014 dB with `Hann`, and 0.08 Hz and 0.03 dB with `Hamming`.
    ///
    /// # Source
    /// Serra and Smith, "Spectral modeling synthesis" (Computer Music Journal 14(4), 1990).
    pub struct SinePeaksParams {
        /// Samples of a frame, an even number plus one; None for 46 ms, 2047 at 44.1 kHz.
        window: Option<usize> = None, unit "samples", range 3..=65_537_usize;
        /// Shape of the window.
        window_shape: PeakWindow = PeakWindow::BlackmanHarris;
        /// Samples of the transform, at least those of the window, rounded up to an even number; None for twice the window, rounded up to a
        /// power of two.
        transform: Option<usize> = None, unit "samples", range 4..=524_288_usize;
        /// Samples from one frame to the next, at most a quarter of a window for `PartialTracks`; None for 5.8 ms, 256 at 44.1 kHz.
        hop: Option<usize> = None, unit "samples", range 1..=65_536_usize;
        /// Lowest level of a peak: a sinusoid of full scale has 0 dB.
        threshold: f64 = -80.0, unit "dB", range -160.0..=0.0;
        /// Maximum number of peaks of a frame; the largest count.
        max_peaks: usize = 100, unit "", range 1..=1000_usize;
    }
}
ports! {
    /// Ports of `SinePeaks`.
    pub struct SinePeaksPorts / SinePeaksIo {
        in {
            /// The sound, mono.
            audio: Stream<f32>,
        }
        out {
            /// The sinusoids of each frame, the largest first.
            peaks: Stream<PeakFrames>,
        }
    }
}

/// The node over [`PeakFinder`].
pub struct SinePeaks {
    finder: PeakFinder,
    hop: i64,
    found: Vec<SinePeak>,
}

impl SinePeaksParams {
    fn rules(&self, rate: f64) -> Result<PeakRules, Reject> {
        let default = PeakRules::at_rate(rate);
        let window = self.window.unwrap_or(default.window);
        let size = self.transform.unwrap_or_else(|| PeakRules::transform(window));
        if window.is_multiple_of(2) {
            let message = format!("`window` has {window} samples, an even number: it has no middle");
            let help = format!("set it to {} or {}", window - 1, window + 1);
            return Err(Reject::new("F051", message).at("window").help(help));
        }
        if size < window {
            let message = format!("`transform` has {size} samples, fewer than the window, {window}");
            return Err(Reject::new("F051", message).at("transform"));
        }
        Ok(PeakRules {
            shape: self.window_shape,
            window,
            size,
            hop: self.hop.unwrap_or(default.hop),
            threshold: self.threshold,
            max_peaks: self.max_peaks,
        })
    }
}

impl Node for SinePeaks {
    type Params = SinePeaksParams;
    type Ports = SinePeaksPorts;
    const NAME: &'static str = "SinePeaks";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 400.0;

    fn shape(p: &SinePeaksParams, s: &mut Shape<'_, '_, SinePeaksPorts>) -> Result<(), Reject> {
        let audio = s.input(SinePeaksPorts::audio);
        s.check(mono(audio.format, "audio"));
        let PeakRules { window, hop, max_peaks, .. } = p.rules(audio.rate.as_f64())?;
        s.lookaround(SinePeaksPorts::audio, window / 2, window / 2);
        // The last frame may be centred on the end.
        s.ends(audio.items().map(|n| audio.rate.tick(n) + 1));
        s.output(
            SinePeaksPorts::peaks,
            frame_rate(audio.rate, hop)?,
            FrameFormat { count: max_peaks, hop, window },
        );
        Ok(())
    }

    fn build(p: &SinePeaksParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rate = cx.input(SinePeaksPorts::audio).rate.as_f64();
        let rules = p.rules(rate)?;
        let finder = PeakFinder::new(rules, rate);
        Ok(Self { hop: rules.hop as i64, found: Vec::with_capacity(finder.room()), finder })
    }

    fn run(&mut self, mut io: SinePeaksIo<'_>) -> Result<(), Fault> {
        let first = io.audio.first() - io.audio.behind() as i64;
        let (mut k, width) = (io.peaks.first(), io.peaks.width());
        for out in io.peaks.items().chunks_exact_mut(width) {
            self.finder.find_at(io.audio.around(), k * self.hop - first, &mut self.found);
            out.fill(SinePeak::default());
            out[..self.found.len()].copy_from_slice(&self.found);
            k += 1;
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (SinePeaksParams, MemoryFiles) {
        let p = SinePeaksParams::trial(rng);
        let window = 3 + 2 * rng.below(16);
        let params = SinePeaksParams {
            window: Some(window),
            transform: p.transform.map(|size| window + size % 40),
            hop: Some(1 + rng.below(12)),
            threshold: p.threshold - 20.0 * (p.threshold + 160.0) / 160.0,
            max_peaks: 1 + p.max_peaks % 8,
            ..p
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn a_tone_is_the_first_peak_of_each_frame_and_the_others_are_empty() {
        let tone: Vec<f32> = (0..8820).map(|i| 0.5 * (0.1 * i as f32).cos()).collect();
        let params = SinePeaksParams::read(&|_| None).unwrap();
        let run = Standalone::new::<SinePeaks>(params).input(
            SinePeaksPorts::audio,
            Rate::hz(44_100),
            Channels(1),
            tone,
        );
        let peaks = run.run().unwrap().stream(SinePeaksPorts::peaks);
        assert_eq!(peaks.len(), 100 * (8820 / 256 + 1));
        for frame in peaks.chunks_exact(100).take(30).skip(5) {
            assert!((frame[0].frequency - 0.1 * 44_100.0 / std::f64::consts::TAU).abs() < 0.01, "{frame:?}");
            assert!((frame[0].amplitude - 0.5).abs() < 1e-3);
            assert!(frame[1..].iter().all(|peak| peak.amplitude < 1e-4));
        }
    }

    #[test]
    fn windows_without_a_middle_and_stereo_are_refused() {
        let params = SinePeaksParams { window: Some(2048), ..SinePeaksParams::read(&|_| None).unwrap() };
        let standalone = |channels| {
            Standalone::new::<SinePeaks>(params.clone()).input(
                SinePeaksPorts::audio,
                Rate::hz(44_100),
                Channels(channels),
                vec![0.0; 100],
            )
        };
        assert!(standalone(1).shape().unwrap_err().to_string().contains("2048"));
        assert_eq!(standalone(2).shape().unwrap_err().code, "F046");
    }
}
