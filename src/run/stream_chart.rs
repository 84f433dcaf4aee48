//! Streams as line charts.

use super::columns::Columns;
use foley_nodes::core::time::{Rate, seconds};
use foley_nodes::plot::{Axis, Line, chart};

/// Largest number of intervals of a line.
const MAX_INTERVALS: usize = 2048;

/// Extremes of one line over consecutive intervals of equally many items.
#[derive(Debug)]
struct Extremes {
    /// Smallest and largest number of each interval.
    intervals: Vec<[f32; 2]>,
    /// Items of an interval, and those of the last one.
    items: [u64; 2],
}

impl Default for Extremes {
    fn default() -> Self {
        Self { intervals: Vec::new(), items: [1, 1] }
    }
}

foley_nodes::impl_state!(Extremes { intervals, items });

fn joined(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The extremes of no numbers.
const NOTHING: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

impl Extremes {
    /// Adds the smallest and the largest number of an item.
    fn push(&mut self, item: [f32; 2]) {
        let [full, last] = &mut self.items;
        if *last < *full {
            *last += 1;
            if let Some(interval) = self.intervals.last_mut() {
                *interval = joined(*interval, item);
            }
            return;
        }
        if self.intervals.len() == MAX_INTERVALS {
            let halves = self.intervals.chunks(2).map(|pair| pair.iter().copied().fold(NOTHING, joined));
            self.intervals = halves.collect();
            *full *= 2;
        }
        self.intervals.push(item);
        *last = 1;
    }

    /// The points of a line: two for an interval of several numbers.
    fn points(&self, rate: Rate, first: i64) -> Vec<[f64; 2]> {
        let time = |k: usize| seconds(rate.tick(first + (k as u64 * self.items[0]) as i64));
        let points = self.intervals.iter().enumerate().flat_map(|(k, [low, high])| {
            let both = [[time(k), f64::from(*low)], [time(k), f64::from(*high)]];
            both.into_iter().take(if low == high { 1 } else { 2 })
        });
        points.filter(|[_, y]| y.is_finite()).collect()
    }
}

/// The numbers of a stream over time, one line for each channel and column, or group of them.
///
/// A line has at most a fixed number of intervals, each with its smallest and largest number, so that no peak is lost.
#[derive(Debug)]
pub struct StreamChart {
    title: String,
    rate: Rate,
    columns: Columns,
    lines: Vec<Extremes>,
    first: Option<i64>,
}

foley_nodes::impl_state!(StreamChart { each lines, first });

impl StreamChart {
    /// An empty chart of a stream.
    #[must_use]
    pub fn new(title: String, rate: Rate, columns: Columns) -> Self {
        let lines = columns.names().iter().map(|_| Extremes::default()).collect();
        Self { title, rate, columns, lines, first: None }
    }

    /// Adds the numbers of the items from item `first` on.
    pub fn push(&mut self, first: i64, numbers: &[f32]) {
        if !numbers.is_empty() {
            self.first.get_or_insert(first);
        }
        let mut item = vec![NOTHING; self.lines.len()];
        for numbers in numbers.chunks_exact(self.columns.numbers().max(1)) {
            item.fill(NOTHING);
            for (k, x) in numbers.iter().enumerate() {
                let group = &mut item[self.columns.group(k)];
                *group = joined(*group, [*x, *x]);
            }
            self.lines.iter_mut().zip(&item).for_each(|(line, x)| line.push(*x));
        }
    }

    /// Draws it as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let first = self.first.unwrap_or(0);
        let names = self.columns.names().iter().zip(&self.lines);
        let lines: Vec<Line> =
            names.map(|(name, line)| Line::new(name.clone(), line.points(self.rate, first))).collect();
        let range = |k: usize| {
            let all = || lines.iter().flat_map(|line| &line.points).map(|p| p[k]);
            let [low, high] = [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)];
            if low < high {
                [low, high]
            } else {
                [low.min(0.0), low.max(0.0) + 1.0].map(|x| if x.is_finite() { x } else { 0.0 })
            }
        };
        let [low, high] = range(1);
        let axis = |label: &str, range| Axis { label: label.into(), range, log: false };
        chart(&self.title, &axis("time, s", range(0)), &axis("", [low.min(0.0), high.max(0.0)]), &lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_is_short_and_holds_every_peak() {
        let mut line = Extremes::default();
        for k in 0..100_000 {
            line.push([if k == 77_777 { 5.0 } else { (k % 2) as f32 }; 2]);
        }
        assert!(line.intervals.len() <= MAX_INTERVALS && line.intervals.len() > MAX_INTERVALS / 4);
        let points = line.points(Rate::hz(100), 0);
        let peak = points.iter().find(|p| p[1] == 5.0).unwrap();
        assert!((peak[0] - 777.77).abs() < line.items[0] as f64 / 100.0, "{peak:?}");
        let mut short = Extremes::default();
        (0..5).for_each(|k| short.push([k as f32; 2]));
        assert_eq!(short.points(Rate::hz(10), 20)[1], [2.1, 1.0]);
    }
}
