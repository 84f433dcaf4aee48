//! Reports of the extraction of modes from recordings.

use super::feature::Feature;
use super::one_object::TakePair;
use super::takes::Take;
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::{Axis, Image, Line, beside, chart_over};
use foley_fft::RealFftPlanner;
use serde::{Deserialize, Serialize};
use std::f64::consts::{LN_10, TAU};

/// Size of the picture of a spectrogram, pixels, and its range in dB.
pub(super) const PICTURE: [usize; 2] = [260, 180];
const RANGE: f64 = 70.0;
/// Range of frequencies of the picture, Hz.
const FREQUENCIES: [f64; 2] = [40.0, 20_000.0];
/// Maximum duration of the picture, s.
const LONGEST: f64 = 2.0;
/// Minimum difference at which a recording that is explained better than its surrogate rings, dB.
pub const RINGING: f64 = 5.0;

/// Results for one impact of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordingReport {
    /// Name of the recording.
    pub recording: String,
    /// The object, the hit point and the striker; `file` is the path as it was given.
    #[serde(default)]
    pub take: Take,
    /// Time of the onset, s.
    pub onset_s: f64,
    /// Number of modes.
    pub modes: usize,
    /// Number of modes that belong to the object: their decay is certain.
    pub certain: usize,
    /// Energy of the residual from the onset to the end, dB.
    pub unexplained_db: f64,
    /// The same from 5 ms after the onset on.
    pub unexplained_after_5_ms_db: f64,
    /// Energy of the residual of noise with the same spectrogram; `None` if it was not computed.
    pub surrogate_db: Option<f64>,
    /// True if the recording is explained better than its surrogate by 5 dB or more.
    pub ringing: Option<bool>,
    /// Energy that the modes of other takes of the object leave unexplained, from 5 ms after the onset on: the median over them, dB.
    #[serde(default)]
    pub by_other_takes_db: Option<f64>,
    /// Reasons to doubt the modes.
    pub warnings: Vec<String>,
    /// The modes.
    pub features: Vec<Feature>,
    /// Largest departure of the phase of each mode from that of a constant frequency while it decays by 20 dB, rad; `None` if this takes
    /// fewer than 16 periods. The cause of a drift is a complex mode shape, a dependence on the amplitude, or a fit of two modes as one.
    #[serde(default)]
    pub phase_drifts: Vec<Option<f64>>,
    /// The spectrogram.
    pub picture: Image,
    /// Duration of the picture, s.
    pub seconds: f64,
}

/// Results for recordings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExtractionReport {
    /// One for each impact.
    pub recordings: Vec<RecordingReport>,
    /// Pairs of takes of one object, by the indices of `recordings`.
    #[serde(default)]
    pub pairs: Vec<TakePair>,
    /// Recordings that were left out, with the reason.
    #[serde(default)]
    pub unusable: Vec<String>,
}

impl RecordingReport {
    /// The spectrogram with the modes drawn in: each from the onset to its decay by 20 dB.
    fn plot(&self) -> String {
        let time = Axis { label: "Time after the onset (s)".into(), range: [0.0, self.seconds], log: false };
        let frequency = Axis { label: "Frequency (Hz)".into(), range: FREQUENCIES, log: true };
        let line = |f: &Feature| {
            let end = (LN_10 / f.decay).min(self.seconds);
            Line::new("", vec![[0.0, f.freq_hz], [end, f.freq_hz]])
        };
        let lines: Vec<Line> = self.features.iter().map(line).collect();
        let surrogate = self.surrogate_db.map_or(String::new(), |db| format!(" (surrogate {db:.1} dB)"));
        let takes =
            self.by_other_takes_db.map_or(String::new(), |db| format!(", {db:.1} dB by other takes' modes"));
        let title =
            format!("{}: {:.1} dB unexplained{surrogate}{takes}", self.recording, self.unexplained_db);
        chart_over(Some(&self.picture), &title, &time, &frequency, &lines)
    }
}

impl Data for ExtractionReport {
    const NAME: &'static str = "extraction report";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let samples: Vec<f64> = (0..3000).map(|_| rng.between(-1.0, 1.0)).collect();
        let (pixels, seconds) = spectrogram(&samples, 8000.0);
        let picture = Image::grey(PICTURE, &pixels).unwrap_or_default();
        let report = RecordingReport { recording: "trial".into(), picture, seconds, ..Default::default() };
        Self { recordings: vec![report], ..Self::default() }
    }

    fn plot(&self) -> Option<String> {
        let charts: Vec<String> = self.recordings.iter().map(RecordingReport::plot).collect();
        (!charts.is_empty()).then(|| beside(&charts))
    }
}

/// Grey pixels of the spectrogram of a sound, low levels white, over log frequency, and the duration that they cover in s.
///
/// # Complexity
/// O(frames log 2048).
pub(super) fn spectrogram(sound: &[f64], rate: f64) -> (Vec<u8>, f64) {
    let [width, height] = PICTURE;
    let total = sound.iter().map(|x| x * x).sum::<f64>();
    let mut sum = 0.0;
    let passed = sound.iter().position(|x| {
        sum += x * x;
        sum >= 0.9999 * total
    });
    let seconds = (1.2 * passed.unwrap_or(sound.len()) as f64 / rate).clamp(0.1, LONGEST);
    let frame = ((0.023 * rate) as usize).next_power_of_two();
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(frame);
    let (mut time, mut bins) = (plan.make_input_vec(), plan.make_output_vec());
    let mut levels = vec![f64::NEG_INFINITY; width * height];
    for column in 0..width {
        let first = (column as f64 / width as f64 * seconds * rate) as usize;
        for (k, t) in time.iter_mut().enumerate() {
            let w = 0.5 - 0.5 * libm::cos(TAU * k as f64 / frame as f64);
            *t = sound.get(first + k).map_or(0.0, |x| x * w);
        }
        if plan.process(&mut time, &mut bins).is_err() {
            continue;
        }
        for row in 0..height {
            let up = (height - 1 - row) as f64 / height as f64;
            let frequency = |up: f64| FREQUENCIES[0] * (FREQUENCIES[1] / FREQUENCIES[0]).powf(up);
            let bin = |f: f64| (f * frame as f64 / rate) as usize;
            let (low, high) = (bin(frequency(up)), bin(frequency(up + 1.0 / height as f64)));
            let part = bins.get(low..(high + 1).min(bins.len())).unwrap_or_default();
            let power = part.iter().map(|z| z.norm_sqr()).fold(0.0, f64::max);
            levels[row * width + column] = 10.0 * power.max(1e-30).log10();
        }
    }
    let loudest = levels.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let grey = |db: &f64| (255.0 * ((loudest - db) / RANGE).clamp(0.0, 1.0)) as u8;
    (levels.iter().map(grey).collect(), seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_is_drawn_where_the_spectrogram_is_dark() {
        let sound: Vec<f64> = (0..22_050)
            .map(|n| {
                let t = f64::from(n) / 44_100.0;
                libm::exp(-9.0 * t) * libm::sin(TAU * 1000.0 * t)
            })
            .collect();
        let (pixels, seconds) = spectrogram(&sound, 44_100.0);
        let picture = Image::grey(PICTURE, &pixels).unwrap();
        let darkest = pixels.iter().enumerate().min_by_key(|(_, x)| **x).unwrap().0 / PICTURE[0];
        let expected = (1.0 - (1000.0_f64 / 40.0).ln() / 500.0_f64.ln()) * 180.0;
        assert!((darkest as f64 - expected).abs() < 4.0, "{darkest} {expected}");
        let feature = Feature { freq_hz: 1000.0, decay: 9.0, amp: 1.0, ..Feature::default() };
        let report = RecordingReport { features: vec![feature], picture, seconds, ..Default::default() };
        let svg = ExtractionReport { recordings: vec![report], ..Default::default() }.plot().unwrap();
        assert!(svg.contains("data:image/png;base64") && svg.matches("<polyline").count() == 1);
        assert!(ExtractionReport::default().plot().is_none());
    }
}
