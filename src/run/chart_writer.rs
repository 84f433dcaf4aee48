//! Streams as line charts.

use foley_nodes::archive_state;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::files::WriteSeek;
use foley_nodes::core::item::ItemType;
use foley_nodes::core::node::{DynNode, Summary};
use foley_nodes::core::stage::Cx;
use foley_nodes::core::time::{Rate, seconds};
use foley_nodes::plot::{Axis, Line, chart};
use std::any::Any;
use std::io::{self, Write};

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

impl Extremes {
    fn push(&mut self, x: f32) {
        let [full, last] = &mut self.items;
        if *last < *full {
            *last += 1;
            if let Some([low, high]) = self.intervals.last_mut() {
                (*low, *high) = (low.min(x), high.max(x));
            }
            return;
        }
        if self.intervals.len() == MAX_INTERVALS {
            let halves = self.intervals.chunks(2).map(|pair| {
                pair.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
            });
            self.intervals = halves.collect();
            *full *= 2;
        }
        self.intervals.push([x, x]);
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

/// Draws the numbers of a stream over time, one line for each channel and column.
///
/// A line has at most [`MAX_INTERVALS`] intervals, each with its smallest and largest number, so that no peak is lost.
pub(super) struct ChartWriter {
    file: Box<dyn WriteSeek>,
    item: &'static ItemType,
    title: String,
    rate: Rate,
    names: Vec<String>,
    lines: Vec<Extremes>,
    first: Option<i64>,
    numbers: Vec<f32>,
}

impl ChartWriter {
    pub(super) fn new(
        file: Box<dyn WriteSeek>,
        item: &'static ItemType,
        names: Vec<String>,
        rate: Rate,
        title: String,
    ) -> Self {
        let lines = names.iter().map(|_| Extremes::default()).collect();
        Self { file, item, title, rate, names, lines, first: None, numbers: Vec::new() }
    }

    fn draw(&self) -> String {
        let first = self.first.unwrap_or(0);
        let lines: Vec<Line> = self
            .names
            .iter()
            .zip(&self.lines)
            .map(|(name, line)| Line::new(name.clone(), line.points(self.rate, first)))
            .collect();
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

impl DynNode for ChartWriter {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        self.numbers.clear();
        let first = cx.raw_input(0, |buffer, span| {
            (self.item.numbers)(buffer, span.from, span.to, &mut self.numbers);
            span.from
        });
        self.first = self.first.or(first.filter(|_| !self.numbers.is_empty()));
        for numbers in self.numbers.chunks_exact(self.lines.len().max(1)) {
            self.lines.iter_mut().zip(numbers).for_each(|(line, x)| line.push(*x));
        }
        Ok(())
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        let written: io::Result<()> =
            self.file.write_all(self.draw().as_bytes()).and_then(|()| self.file.flush());
        written.map_err(|e| Fault::new("F080", format!("cannot write a tap: {e}")))?;
        Ok(Summary::new())
    }

    archive_state!(each lines, first);

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_is_short_and_holds_every_peak() {
        let mut line = Extremes::default();
        for k in 0..100_000 {
            line.push(if k == 77_777 { 5.0 } else { (k % 2) as f32 });
        }
        assert!(line.intervals.len() <= MAX_INTERVALS && line.intervals.len() > MAX_INTERVALS / 4);
        let points = line.points(Rate::hz(100), 0);
        let peak = points.iter().find(|p| p[1] == 5.0).unwrap();
        assert!((peak[0] - 777.77).abs() < line.items[0] as f64 / 100.0, "{peak:?}");
        let mut short = Extremes::default();
        (0..5).for_each(|k| short.push(k as f32));
        assert_eq!(short.points(Rate::hz(10), 20)[1], [2.1, 1.0]);
    }
}
