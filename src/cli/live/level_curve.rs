//! Curves of levels in a terminal.

use crate::diag::plain;
use crate::live::input::MeterReadings;
use foley_nodes::dsp::linear_to_db;
use std::collections::VecDeque;

/// Columns of a curve: with its name and its level it fits a line of 80.
const COLUMNS: usize = 48;
/// Characters of a name.
const NAME: usize = 16;
/// Columns per second.
pub(super) const COLUMNS_PER_SECOND: f64 = 10.0;
/// Range of a curve below its maximum, dB.
const RANGE: f64 = 48.0;
const BLOCKS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

fn db(x: f32) -> f64 {
    linear_to_db(f64::from(x.max(1e-9)))
}

/// The last peaks of one meter.
#[derive(Debug)]
struct Curve {
    name: String,
    peaks: VecDeque<f32>,
    /// Largest peak since the start.
    maximum: f32,
    /// The peak of the incomplete column, and its share of a column.
    next: (f32, f64),
}

/// The curves of all meters.
#[derive(Debug, Default)]
pub(super) struct LevelCurves(Vec<Curve>);

impl LevelCurves {
    /// Adds readings; curves of meters that have ended disappear.
    pub fn add(&mut self, all: &[MeterReadings]) {
        self.0.retain(|curve| all.iter().any(|m| m.name == curve.name));
        for MeterReadings { name, rate, readings } in all {
            let known = self.0.iter().position(|curve| curve.name == *name);
            let index = known.unwrap_or_else(|| {
                let peaks = VecDeque::from(vec![0.0; COLUMNS]);
                self.0.push(Curve { name: name.clone(), peaks, maximum: 0.0, next: (0.0, 0.0) });
                self.0.len() - 1
            });
            let curve = &mut self.0[index];
            for reading in readings {
                curve.next.0 = curve.next.0.max(reading.peak);
                curve.next.1 += COLUMNS_PER_SECOND / rate;
                while curve.next.1 >= 1.0 - 1e-9 {
                    curve.peaks.pop_front();
                    curve.peaks.push_back(curve.next.0);
                    curve.next.1 -= 1.0;
                }
                if curve.next.1 < COLUMNS_PER_SECOND / rate {
                    curve.maximum = curve.maximum.max(curve.next.0);
                    curve.next.0 = 0.0;
                }
            }
        }
    }

    /// Returns true if there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Draws the curves in lines of their own below the line of the cursor, which returns to it. Each is 48 dB high with its maximum
    /// so far at the top, and is followed by the last level in dB.
    pub fn draw(&self) -> String {
        let draw = |curve: &Curve| {
            let top = db(curve.maximum);
            let block = |peak: &f32| {
                let height = ((db(*peak) - top) / RANGE + 1.0).clamp(0.0, 1.0);
                BLOCKS[(height * (BLOCKS.len() - 1) as f64).round() as usize]
            };
            let bars: String = curve.peaks.iter().map(block).collect();
            let last = curve.peaks.back().copied().unwrap_or(0.0);
            let name: String = plain(&curve.name).chars().take(NAME).collect();
            format!("\r\n{name:>NAME$} {bars} {:6.1} dB\x1b[K", db(last).max(-99.9))
        };
        let lines: String = self.0.iter().map(draw).collect();
        if lines.is_empty() { lines } else { format!("{lines}\x1b[{}A", self.0.len()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::dsp::Level;

    #[test]
    fn a_column_shows_the_largest_peak_of_a_tenth_of_a_second() {
        let mut curves = LevelCurves::default();
        let readings = |peaks: &[f32]| {
            let readings = peaks.iter().map(|&peak| Level { peak, rms: 0.0 }).collect();
            vec![MeterReadings { name: "force".into(), rate: 30.0, readings }]
        };
        curves.add(&readings(&[0.1, 1.0, 0.5, 0.5, 0.25, 0.0, 0.0]));
        curves.add(&readings(&[0.0, 0.063]));
        let text = curves.draw();
        assert!(
            text.starts_with("\r\n           force  ") && text.ends_with("█▇▄  -24.0 dB\x1b[K\x1b[1A"),
            "{text:?}"
        );
        let line = text.lines().nth(1).unwrap().split('\x1b').next().unwrap();
        assert!(line.chars().count() < 80, "{line}");
        curves.add(&[]);
        assert!(curves.is_empty() && curves.draw().is_empty());
    }
}
