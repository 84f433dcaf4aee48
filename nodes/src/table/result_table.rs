//! A table of results, as CSV and as charts.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::{Chart, Line, grid};
use serde::{Deserialize, Serialize};

/// Number of charts in a row of the figure.
const CHARTS_IN_A_ROW: usize = 2;

/// One entry of a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Cell {
    /// A finite number.
    Number(f64),
    /// A text.
    Text(String),
    /// Nothing: the quantity does not exist.
    Empty,
}

impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        if x.is_finite() { Self::Number(x) } else { Self::Empty }
    }
}

impl From<usize> for Cell {
    fn from(x: usize) -> Self {
        Self::Number(x as f64)
    }
}

impl From<Option<f64>> for Cell {
    fn from(x: Option<f64>) -> Self {
        x.map_or(Self::Empty, Self::from)
    }
}

impl From<&str> for Cell {
    fn from(x: &str) -> Self {
        Self::Text(x.to_owned())
    }
}

impl From<String> for Cell {
    fn from(x: String) -> Self {
        Self::Text(x)
    }
}

impl Cell {
    /// The entry as text, a number with six significant digits.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Empty => String::new(),
            Self::Number(x) if *x == 0.0 || x.fract() == 0.0 && x.abs() < 1e9 => format!("{x}"),
            Self::Number(x) if (1e-3..1e6).contains(&x.abs()) => {
                let digits = (5.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
                format!("{x:.digits$}")
            }
            Self::Number(x) => format!("{x:.5e}"),
        }
    }
}

/// Rows of named columns with charts of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResultTable {
    /// Names of the columns with their units, such as `frequency_hz`.
    pub columns: Vec<String>,
    /// Rows of as many entries.
    pub rows: Vec<Vec<Cell>>,
    /// Charts of the table.
    pub charts: Vec<Chart>,
}

impl ResultTable {
    /// A table without rows.
    #[must_use]
    pub fn new(columns: &[&str]) -> Self {
        Self { columns: columns.iter().map(|c| (*c).to_owned()).collect(), ..Self::default() }
    }

    /// Adds a row.
    pub fn push(&mut self, row: impl IntoIterator<Item = Cell>) {
        self.rows.push(row.into_iter().collect());
    }

    /// The table as CSV; empty entries are nothing between two commas.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut csv = csv::Writer::from_writer(Vec::new());
        // Writing to memory cannot fail, and all rows have the same length.
        let _ = csv.write_record(&self.columns);
        for row in &self.rows {
            let _ = csv.write_record(row.iter().map(Cell::text));
        }
        csv.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
    }
}

impl Data for ResultTable {
    const NAME: &'static str = "table of results";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mut table = Self::new(&["what", "x", "y"]);
        let points: Vec<[f64; 2]> =
            (0..3 + rng.below(4)).map(|k| [k as f64, rng.between(1.0, 2.0)]).collect();
        for [x, y] in &points {
            table.push(["trial".into(), (*x).into(), (*y).into()]);
        }
        table.charts = vec![Chart::of("trial", ("x", false), ("y", true), vec![Line::new("y", points)])];
        table
    }

    fn plot(&self) -> Option<String> {
        let charts: Vec<String> = self.charts.iter().map(Chart::draw).collect();
        (!charts.is_empty()).then(|| grid(&charts, CHARTS_IN_A_ROW))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits_and_what_is_missing_is_empty() {
        let mut table = ResultTable::new(&["name", "x"]);
        table.push(["a, b".into(), 1.234_567_89e-9.into()]);
        table.push(["c".into(), f64::NAN.into()]);
        table.push(["d".into(), 1_234.567_89.into()]);
        table.push(["e".into(), 30_usize.into()]);
        assert_eq!(table.csv(), "name,x\n\"a, b\",1.23457e-9\nc,\nd,1234.57\ne,30\n");
        assert!(table.plot().is_none());
    }

    #[test]
    fn charts_stand_in_rows_of_two() {
        let mut table = ResultTable::trial(&mut Rng::new(1));
        table.charts = vec![table.charts[0].clone(); 3];
        let svg = table.plot().unwrap();
        assert!(svg.contains("viewBox=\"0 0 1440 880\"") && svg.contains("x=\"0\" y=\"440\""), "{svg}");
    }
}
