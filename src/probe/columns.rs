//! Figures of streams of numbers: columns of features, speeds, coordinates.

use super::text::{Listing, figure, percent};
use super::{ProbeOptions, within};
use crate::run::{Columns, StreamChart};
use foley_nodes::core::item::StreamShape;
use foley_nodes::core::time::{Rate, seconds};
use serde::Serialize;

/// Largest number of columns with figures of their own.
const MAX_COLUMNS: usize = 12;
/// Numbers of an item that are shown.
const MAX_SHOWN: usize = 9;

/// Figures of a stream.
#[derive(Clone, Debug, Serialize)]
pub struct StreamFigures {
    /// Name of the item type.
    pub item: &'static str,
    /// The format: `39 values`, `1200 vertices`.
    pub format: String,
    /// Items per second.
    pub rate: f64,
    /// Elements of an item.
    pub width: usize,
    /// Numbers of an element.
    pub columns_of_element: Vec<&'static str>,
    /// Start of the measurement, s.
    pub from: f64,
    /// Its length, s.
    pub seconds: f64,
    /// Number of items.
    pub items: u64,
    /// Numbers that are not finite; they count nowhere else.
    pub not_finite: u64,
    /// Share of the numbers that are 0.
    pub zero_share: f64,
    /// Time of the first item with a number other than 0, s.
    pub first_active: Option<f64>,
    /// Share of the items with one.
    pub active_share: f64,
    /// Per column, or group of columns.
    pub columns: Vec<ColumnFigures>,
    /// The first items.
    pub first: Vec<Row>,
}

/// Figures of one column, or of a group of them.
#[derive(Clone, Debug, Serialize)]
pub struct ColumnFigures {
    /// Its name.
    pub name: String,
    /// Smallest number; `None` without any.
    pub min: Option<f64>,
    /// Largest number.
    pub max: Option<f64>,
    /// Mean.
    pub mean: Option<f64>,
    /// Standard deviation.
    pub deviation: Option<f64>,
    /// Share of the numbers that are 0.
    pub zero_share: f64,
}

/// One item.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Its time, s.
    pub time: f64,
    /// Its first numbers.
    pub numbers: Vec<f32>,
    /// Count of the other numbers.
    pub more: usize,
}

/// Mean and variance by Welford's recurrence, which does not cancel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Moments {
    pub(super) count: u64,
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) mean: f64,
    squares: f64,
    zeros: u64,
}

impl Default for Moments {
    fn default() -> Self {
        Self { count: 0, min: f64::INFINITY, max: f64::NEG_INFINITY, mean: 0.0, squares: 0.0, zeros: 0 }
    }
}

impl Moments {
    pub(super) fn push(&mut self, x: f64) {
        self.count += 1;
        (self.min, self.max) = (self.min.min(x), self.max.max(x));
        let distance = x - self.mean;
        self.mean += distance / self.count as f64;
        self.squares += distance * (x - self.mean);
        self.zeros += u64::from(x == 0.0);
    }

    pub(super) fn deviation(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }

    fn figures(&self, name: &str) -> ColumnFigures {
        let some = |x: f64| (self.count > 0).then_some(x);
        ColumnFigures {
            name: name.to_owned(),
            min: some(self.min),
            max: some(self.max),
            mean: some(self.mean),
            deviation: some(self.deviation()),
            zero_share: self.zeros as f64 / self.count.max(1) as f64,
        }
    }
}

/// Measures a stream of numbers.
#[derive(Debug)]
pub(super) struct StreamProbe {
    shape: StreamShape,
    columns: Columns,
    moments: Vec<Moments>,
    /// Items that are measured.
    range: [i64; 2],
    items: u64,
    active: u64,
    first_active: Option<i64>,
    not_finite: u64,
    rows: Vec<(i64, Vec<f32>)>,
    most_rows: usize,
    chart: StreamChart,
}

impl StreamProbe {
    pub(super) fn new(shape: &StreamShape, options: &ProbeOptions) -> Self {
        let columns = Columns::at_most(MAX_COLUMNS, shape.item, shape.width);
        let to = shape.end.map_or(options.to, |end| end.min(options.to));
        Self {
            shape: shape.clone(),
            moments: vec![Moments::default(); columns.names().len()],
            range: [shape.rate.first_at(options.from), shape.rate.first_at(to)],
            items: 0,
            active: 0,
            first_active: None,
            not_finite: 0,
            rows: Vec::new(),
            most_rows: options.first,
            chart: StreamChart::new(options.output.clone(), shape.rate, columns.clone()),
            columns,
        }
    }

    fn rate(&self) -> Rate {
        self.shape.rate
    }

    pub(super) fn push(&mut self, first: i64, numbers: &[f32]) {
        let width = self.columns.numbers();
        let [from, to] = self.range;
        let (first, numbers) = within(first, numbers, width, from, to);
        for (at, item) in (first..).zip(numbers.chunks_exact(width.max(1))) {
            self.items += 1;
            if self.rows.len() < self.most_rows {
                self.rows.push((at, item[..item.len().min(MAX_SHOWN)].to_vec()));
            }
            if item.iter().any(|x| *x != 0.0) {
                self.active += 1;
                self.first_active.get_or_insert(at);
            }
            for (k, x) in item.iter().enumerate() {
                if x.is_finite() {
                    self.moments[self.columns.group(k)].push(f64::from(*x));
                } else {
                    self.not_finite += 1;
                }
            }
        }
        self.chart.push(first, numbers);
    }

    pub(super) fn figures(&self) -> StreamFigures {
        let time = |item: i64| seconds(self.rate().tick(item));
        let count: u64 = self.moments.iter().map(|m| m.count).sum();
        let zeros: u64 = self.moments.iter().map(|m| m.zeros).sum();
        let row = |(at, numbers): &(i64, Vec<f32>)| Row {
            time: time(*at),
            numbers: numbers.clone(),
            more: self.columns.numbers() - numbers.len(),
        };
        let names = self.columns.names().iter().zip(&self.moments);
        StreamFigures {
            item: self.shape.item.name,
            format: self.shape.text.clone(),
            rate: self.rate().as_f64(),
            width: self.shape.width,
            columns_of_element: self.shape.item.columns.iter().copied().filter(|c| !c.is_empty()).collect(),
            from: time(self.range[0]),
            seconds: time(self.items as i64),
            items: self.items,
            not_finite: self.not_finite,
            zero_share: zeros as f64 / count.max(1) as f64,
            first_active: self.first_active.map(time),
            active_share: self.active as f64 / self.items.max(1) as f64,
            columns: names.map(|(name, moments)| moments.figures(name)).collect(),
            first: self.rows.iter().map(row).collect(),
        }
    }

    pub(super) fn draw(&self) -> String {
        self.chart.draw()
    }
}

impl StreamFigures {
    /// Lines for people.
    #[must_use]
    pub fn text(&self, output: &str) -> String {
        let heading = format!("{output}: {}, {} Hz, {}", self.item, figure(self.rate), self.format);
        let mut out = Listing::new(&heading);
        let from = if self.from > 0.0 { format!(" from {:.3} s on", self.from) } else { String::new() };
        out.line("length", format!("{:.3} s, {} items{from}", self.seconds, self.items));
        let columns = match &self.columns_of_element[..] {
            [] => String::new(),
            names => format!(" of {}", names.join(", ")),
        };
        out.line("item", format!("{} elements{columns}", self.width));
        out.line("zeros", format!("{} of the numbers", percent(self.zero_share)));
        out.line("not finite", format!("{} numbers", self.not_finite));
        match self.first_active {
            Some(first) => {
                out.line(
                    "active",
                    format!("from {first:.3} s on, {} of the items", percent(self.active_share)),
                );
            }
            None => out.line("active", "never: all numbers are 0"),
        }
        let number = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), figure);
        let row = |c: &ColumnFigures| {
            let [min, max, mean, deviation] = [c.min, c.max, c.mean, c.deviation].map(number);
            vec![c.name.clone(), min, max, mean, deviation, percent(c.zero_share)]
        };
        let rows: Vec<_> = self.columns.iter().map(row).collect();
        out.table(&["column", "min", "max", "mean", "deviation", "zeros"], &rows);
        for row in &self.first {
            let mut numbers: Vec<String> = row.numbers.iter().map(|x| figure(f64::from(*x))).collect();
            if row.more > 0 {
                numbers.push(format!("... {} more", row.more));
            }
            out.line(&format!("{:.4} s", row.time), numbers.join(", "));
        }
        out.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::core::time::ticks;
    use foley_nodes::spatial::Poses;

    #[test]
    fn columns_have_their_moments_and_a_range_restricts_them() {
        let shape = StreamShape::new::<Poses>(Rate::hz(10), (), None);
        let options = ProbeOptions { output: "p".into(), first: 2, from: ticks(1.0), to: ticks(2.0) };
        let mut probe = StreamProbe::new(&shape, &options);
        for k in 0..30 {
            let x = if k < 10 { 100.0 } else { (k - 10) as f32 };
            probe.push(k, &[x, 0.0, if k == 15 { f32::NAN } else { 1.0 }, 1.0, 0.0, 0.0, 0.0]);
        }
        let found = probe.figures();
        assert_eq!((found.items, found.not_finite, found.first.len(), found.from), (10, 1, 2, 1.0));
        let x = &found.columns[0];
        assert_eq!((x.name.as_str(), x.min, x.max, x.mean), ("x", Some(0.0), Some(9.0), Some(4.5)));
        assert!((x.deviation.unwrap() - 8.25_f64.sqrt()).abs() < 1e-9);
        assert_eq!(found.columns[1].zero_share, 1.0);
        assert_eq!(found.first_active, Some(1.0));
        let text = found.text("p");
        assert!(text.contains("10 items from 1.000 s on") && text.contains("1.1000 s"), "{text}");
    }
}
