//! The waveforms of a target and of recordings with the intervals that should sound alike, as figure 11 of the paper.

use serde::{Deserialize, Serialize};

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::impl_state;
use crate::plot::{Axis, Line, Span, chart, colour, grid, with_spans};

/// Most points of a drawn waveform.
const MAX_POINTS: usize = 1500;
/// Number of colours of marks.
const COLOURS: usize = 8;

/// Least and greatest samples of equal steps of a sound.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Waveform {
    /// Duration of a step, s.
    pub step: f64,
    /// Least and greatest sample of each step.
    pub extremes: Vec<[f32; 2]>,
}

fn extremes(samples: &[f32]) -> [f32; 2] {
    samples.iter().fold([0.0; 2], |[low, high], x| [low.min(*x), high.max(*x)])
}

/// A waveform of samples that arrive in parts.
#[derive(Clone, Debug, Default)]
pub(super) struct WaveformMeter {
    waveform: Waveform,
    /// Samples of a step that is not whole yet.
    rest: Vec<f32>,
    /// Samples of a step, of all channels.
    width: usize,
}
impl_state!(WaveformMeter { waveform, rest });

impl WaveformMeter {
    /// A meter of a sound of no sample yet, whose steps of `step` seconds have `width` samples.
    pub fn new(step: f64, width: usize) -> Self {
        let width = width.max(1);
        Self { waveform: Waveform { step, extremes: Vec::new() }, rest: Vec::with_capacity(width), width }
    }

    /// Adds samples.
    pub fn add(&mut self, samples: &[f32]) {
        let (first, others) = samples.split_at((self.width - self.rest.len()).min(samples.len()));
        self.rest.extend_from_slice(first);
        if self.rest.len() == self.width {
            let whole = others.len() / self.width * self.width;
            self.waveform.push(&self.rest, self.width);
            self.waveform.push(&others[..whole], self.width);
            self.rest.clear();
            self.rest.extend_from_slice(&others[whole..]);
        }
    }

    /// Returns the waveform of all samples.
    pub fn finish(&mut self) -> Waveform {
        self.waveform.push(&self.rest, self.width);
        self.rest.clear();
        std::mem::take(&mut self.waveform)
    }
}

impl Waveform {
    /// Adds samples, `width` to a step; the last step may be shorter.
    pub(super) fn push(&mut self, samples: &[f32], width: usize) {
        self.extremes.extend(samples.chunks(width.max(1)).map(extremes));
    }

    /// The waveform in at most `most` longer steps.
    pub(super) fn reduced(&self, most: usize) -> Self {
        let each = self.extremes.len().div_ceil(most.max(1)).max(1);
        let join =
            |x: &[[f32; 2]]| x.iter().fold([0.0_f32; 2], |[low, high], x| [low.min(x[0]), high.max(x[1])]);
        Self { step: self.step * each as f64, extremes: self.extremes.chunks(each).map(join).collect() }
    }

    fn seconds(&self) -> f64 {
        self.step * self.extremes.len() as f64
    }
}

/// An interval of a target and one of recordings that should sound alike.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// Label of the correspondence.
    pub label: String,
    /// Channel of the target.
    pub channel: usize,
    /// Start and end in the target, s.
    pub target: [f64; 2],
    /// Start and end in the recordings, one after the other, s.
    pub recordings: [f64; 2],
}

/// The waveforms of a target and of recordings with the intervals that should sound alike.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkedWaveforms {
    /// The target.
    pub target: Waveform,
    /// The recordings of the database, one after the other, without their silences.
    pub recordings: Waveform,
    /// All intervals, in the order of their file.
    pub marks: Vec<Mark>,
}

impl MarkedWaveforms {
    fn panel(&self, title: &str, waveform: &Waveform, of: impl Fn(&Mark) -> [f64; 2]) -> String {
        let drawn = waveform.reduced(MAX_POINTS);
        let at = |(k, ends): (usize, &[f32; 2])| ends.map(|y| [(k as f64 + 0.5) * drawn.step, f64::from(y)]);
        let points: Vec<[f64; 2]> = drawn.extremes.iter().enumerate().flat_map(at).collect();
        let x = Axis { label: "time, s".into(), range: [0.0, waveform.seconds().max(1e-3)], log: false };
        let y = Axis::over("sample", points.iter().map(|p| p[1]), false);
        let spans: Vec<Span> = self
            .marks
            .iter()
            .enumerate()
            .map(|(k, mark)| Span {
                range: of(mark),
                label: format!("{}", k + 1),
                colour: colour(k % COLOURS, COLOURS),
                is_full: true,
            })
            .collect();
        with_spans(&chart(title, &x, &y, &[Line::new("samples", points)]), &x, &spans)
    }
}

impl Data for MarkedWaveforms {
    const NAME: &'static str = "marked waveforms";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mut waveform = |steps: usize| {
            let extremes = |_| [rng.between(-1.0, 0.0) as f32, rng.between(0.0, 1.0) as f32];
            Waveform { step: 1.0 / 240.0, extremes: (0..steps).map(extremes).collect() }
        };
        let (target, recordings) = (waveform(240), waveform(480));
        let mark = Mark { label: "drag".into(), channel: 0, target: [0.1, 0.2], recordings: [1.2, 1.3] };
        Self { target, recordings, marks: vec![mark] }
    }

    /// The target above and the recordings below it; equal numbers should sound alike.
    fn plot(&self) -> Option<String> {
        let panels = [
            self.panel("Target", &self.target, |mark| mark.target),
            self.panel("Recordings", &self.recordings, |mark| mark.recordings),
        ];
        Some(grid(&panels, 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_waveform_keeps_its_extremes_when_it_is_reduced() {
        let mut wave = Waveform { step: 0.5, extremes: Vec::new() };
        wave.push(&[0.1, -0.4, 0.3, 0.2, 0.0, -0.1, 0.7], 2);
        assert_eq!(wave.extremes, [[-0.4, 0.1], [0.0, 0.3], [-0.1, 0.0], [0.0, 0.7]]);
        let half = wave.reduced(2);
        assert_eq!((half.step, &half.extremes[..]), (1.0, &[[-0.4, 0.3], [-0.1, 0.7]][..]));
        assert_eq!(wave.reduced(9), wave);
        for parts in [1, 2, 3, 7] {
            let mut meter = WaveformMeter::new(0.5, 2);
            [0.1, -0.4, 0.3, 0.2, 0.0, -0.1, 0.7].chunks(parts).for_each(|part| meter.add(part));
            assert_eq!(meter.finish(), wave, "in parts of {parts}");
        }
    }

    #[test]
    fn each_mark_stands_in_both_panels_at_its_time() {
        let figure = MarkedWaveforms::trial(&mut Rng::new(1)).plot().unwrap();
        assert_eq!(figure.matches("fill-opacity=\"0.25\"").count(), 2, "one interval in each");
        assert!(figure.contains("Target") && figure.contains("Recordings"));
        assert!(!MarkedWaveforms::default().plot().unwrap().contains("NaN"));
    }
}
