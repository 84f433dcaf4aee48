//! Waveforms in figures, coloured by sound.

use crate::impl_state;
use crate::plot::Line;

/// Greatest number of columns of a waveform.
const COLUMNS: usize = 1200;

/// The extremes of equal stretches of a signal.
#[derive(Clone, Debug)]
pub struct Waveform {
    /// Samples of a column.
    stride: usize,
    /// Least and greatest value of each column.
    extremes: Vec<[f32; 2]>,
    /// Samples so far.
    count: usize,
}

impl Waveform {
    /// Creates the empty waveform of `samples` samples.
    pub fn new(samples: usize) -> Self {
        let stride = samples.div_ceil(COLUMNS).max(1);
        Self { stride, extremes: Vec::with_capacity(samples.div_ceil(stride)), count: 0 }
    }

    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.extremes.is_empty()
    }

    /// Adds samples; samples beyond the length are left out, and those that are not finite count as 0.
    pub fn add(&mut self, samples: impl Iterator<Item = f32>) {
        for x in samples.map(|x| if x.is_finite() { x } else { 0.0 }) {
            let column = self.count / self.stride;
            if column == self.extremes.len() && column < self.extremes.capacity() {
                self.extremes.push([x, x]);
            }
            if let Some([low, high]) = self.extremes.get_mut(column) {
                (*low, *high) = (low.min(x), high.max(x));
            }
            self.count += 1;
        }
    }

    /// Lines over the time in s: one for each name with the columns that it owns, and one for all others. `owner` gives the owner of a time.
    pub fn lines(&self, rate: f64, names: &[String], owner: impl Fn(f64) -> Option<usize>) -> Vec<Line> {
        let rest = names.len();
        let mut points: Vec<Vec<[f64; 2]>> = vec![Vec::new(); rest + 1];
        let mut last = None;
        for (k, [low, high]) in self.extremes.iter().enumerate() {
            let time = |k: f64| k * self.stride as f64 / rate;
            let own = owner(time(k as f64 + 0.5)).unwrap_or(rest).min(rest);
            if last != Some(own) {
                // A line of zeros leads to the stretch.
                last.into_iter().for_each(|last: usize| points[last].push([time(k as f64), 0.0]));
                points[own].push([time(k as f64), 0.0]);
                last = Some(own);
            }
            points[own].extend([
                [time(k as f64 + 0.25), f64::from(*low)],
                [time(k as f64 + 0.75), f64::from(*high)],
            ]);
        }
        let labels = names.iter().map(String::as_str).chain(["other"]);
        labels.zip(points).map(|(label, points)| Line::new(label, points)).collect()
    }
}

impl_state!(Waveform { extremes, count });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_the_extremes_of_their_samples_in_the_line_of_their_owner() {
        let mut wave = Waveform::new(12_000);
        wave.add((0..12_500).map(|k| if k % 10 == 3 { k as f32 } else { -1.0 }));
        assert_eq!(
            (wave.extremes.len(), wave.extremes[0], wave.extremes[1199]),
            (1200, [-1.0, 3.0], [-1.0, 11_993.0])
        );
        let names = ["a".to_owned(), "b".to_owned()];
        let lines = wave.lines(1000.0, &names, |t| (2.0..3.0).contains(&t).then_some(1));
        assert_eq!(lines.iter().map(|l| l.label.as_str()).collect::<Vec<_>>(), ["a", "b", "other"]);
        assert!(lines[0].points.is_empty() && lines[1].points.len() == 2 * 100 + 2);
        assert_eq!((lines[1].points[0], lines[1].points[201]), ([2.0, 0.0], [3.0, 0.0]));
        assert_eq!(lines[2].points.len(), 2 * 1100 + 3);
    }
}
