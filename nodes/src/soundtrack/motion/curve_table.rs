//! Curves from tables: CSV, and JSON lines.

use crate::core::files::{excerpt, strip_bom};
use crate::io::csv_error;
use thiserror::Error;

/// Maximum number of rows.
const MAX_ROWS: usize = 1 << 24;
/// Latest time, s.
const MAX_TIME: f64 = 86_400.0;
/// Longest time without a value that a straight line fills, s.
const BRIDGED: f64 = 0.1;

/// The reason why a table has no curve.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {message}")]
pub struct CurveTableError {
    /// Line, from 1.
    pub line: u64,
    /// The value found, and what is needed.
    pub message: String,
}

fn wrong<T>(line: u64, message: impl Into<String>) -> Result<T, CurveTableError> {
    Err(CurveTableError { line, message: message.into() })
}

/// A number of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    row: usize,
    time: f64,
    value: f64,
}

/// Numbers at increasing times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurveTable {
    /// Names of the numbers.
    pub names: Vec<String>,
    /// The finite numbers of each column, in order of time.
    columns: Vec<Vec<Point>>,
    rows: usize,
    end: f64,
}

/// A number that may be missing.
fn value(text: &str) -> Option<f64> {
    match text {
        "" | "nan" | "NaN" | "NAN" | "null" => Some(f64::NAN),
        _ => text.parse().ok().filter(|x: &f64| x.abs() <= 1e30),
    }
}

impl CurveTable {
    fn new(names: Vec<String>) -> Self {
        Self { columns: vec![Vec::new(); names.len()], names, rows: 0, end: f64::NEG_INFINITY }
    }

    fn push(
        &mut self,
        line: u64,
        time: f64,
        row: impl Iterator<Item = Result<f64, CurveTableError>>,
    ) -> Result<(), CurveTableError> {
        if !(0.0..=MAX_TIME).contains(&time) {
            return wrong(line, format!("the time is {time}; a number from 0 to {MAX_TIME} is needed"));
        }
        if time <= self.end {
            return wrong(line, format!("the time {time} s follows {} s; times must increase", self.end));
        }
        if self.rows == MAX_ROWS {
            return wrong(line, format!("there are more than {MAX_ROWS} rows"));
        }
        for (column, value) in self.columns.iter_mut().zip(row) {
            let value = value?;
            if value.is_finite() {
                column.push(Point { row: self.rows, time, value });
            }
        }
        (self.rows, self.end) = (self.rows + 1, time);
        Ok(())
    }

    /// Time of the last row, s.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.end.max(0.0)
    }

    /// The number of a column at a time: on straight lines between rows, the first before the first row. Between rows, more than 0.1 s apart,
    /// that enclose rows without a number, it is NaN.
    ///
    /// # Complexity
    /// Logarithmic in the rows.
    #[must_use]
    pub fn at(&self, column: usize, time: f64) -> f64 {
        let Some(points) = self.columns.get(column) else { return f64::NAN };
        let next = points.partition_point(|p| p.time <= time);
        match (next.checked_sub(1).map(|k| points[k]), points.get(next)) {
            (Some(a), _) if a.time == time => a.value,
            (Some(a), Some(b)) if b.row - a.row == 1 || b.time - a.time <= BRIDGED => {
                a.value + (b.value - a.value) * (time - a.time) / (b.time - a.time)
            }
            (Some(_), Some(_)) | (None, None) => f64::NAN,
            (Some(a), None) => a.value,
            (None, Some(b)) => b.value,
        }
    }
}

/// Reads a table of numbers over time.
///
/// CSV has a header with `time_s` or `time`, and a column for each number; `column` selects one of them, and is empty for all. JSON lines are
/// objects such as `{"time": 0.5, "height": 1.2}`, with the names of the first line. Empty fields, `nan` and `null` are gaps.
///
/// # Errors
/// The line, the value found, and what is needed.
///
/// # Example
/// ```
/// use foley_nodes::soundtrack::motion::read_curve_table;
///
/// let table = read_curve_table(b"time_s,speed\n0,1\n0.5,2\n", "")?;
/// assert_eq!([0.0, 0.25, 0.5].map(|t| table.at(0, t)), [1.0, 1.5, 2.0]);
/// # Ok::<(), foley_nodes::soundtrack::motion::CurveTableError>(())
/// ```
pub fn read_curve_table(bytes: &[u8], column: &str) -> Result<CurveTable, CurveTableError> {
    let bytes = strip_bom(bytes);
    let first = bytes.trim_ascii_start().first();
    let table = match first {
        None => return wrong(1, "the file is empty; a header such as time_s,speed is needed"),
        Some(b'{') => read_lines(bytes, column)?,
        Some(_) => read_csv(bytes, column)?,
    };
    if table.rows == 0 {
        return wrong(1, "there is no row");
    }
    Ok(table)
}

/// Indices of the columns to read.
fn selected(names: &[String], column: &str, line: u64) -> Result<(usize, Vec<usize>), CurveTableError> {
    let is_time = |name: &String| name == "time_s" || name == "time";
    let Some(time) = names.iter().position(is_time) else {
        return wrong(
            line,
            format!("there is no column `time_s` or `time`; columns are {}", names.join(", ")),
        );
    };
    let is_value =
        |k: &usize| *k != time && names[*k] != "comment" && (column.is_empty() || names[*k] == column);
    let values: Vec<usize> = (0..names.len()).filter(is_value).collect();
    if values.is_empty() {
        let what = if column.is_empty() { "a number".into() } else { format!("{column:?}") };
        return wrong(line, format!("there is no column for {what}; columns are {}", names.join(", ")));
    }
    Ok((time, values))
}

fn read_csv(bytes: &[u8], column: &str) -> Result<CurveTable, CurveTableError> {
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let bad = |e: csv::Error| {
        let (line, message) = csv_error(&e);
        CurveTableError { line, message }
    };
    let header = csv.headers().map_err(bad)?.clone();
    let line = header.position().map_or(1, csv::Position::line);
    let names: Vec<String> = header.iter().map(str::to_owned).collect();
    let (time, values) = selected(&names, column, line)?;
    let mut table = CurveTable::new(values.iter().map(|k| names[*k].clone()).collect());
    for row in csv.records() {
        let row = row.map_err(bad)?;
        let line = row.position().map_or(0, csv::Position::line);
        let number = |k: usize| {
            let text = row.get(k).unwrap_or_default();
            value(text).ok_or_else(|| CurveTableError {
                line,
                message: format!("`{}` is {:?}; a number, or nothing, is needed", names[k], excerpt(text)),
            })
        };
        let at = number(time)?;
        table.push(line, at, values.iter().map(|k| number(*k)))?;
    }
    Ok(table)
}

fn read_lines(bytes: &[u8], column: &str) -> Result<CurveTable, CurveTableError> {
    let mut found: Option<(String, CurveTable)> = None;
    for (k, text) in bytes.split(|b| *b == b'\n').enumerate() {
        let line = k as u64 + 1;
        if text.trim_ascii().is_empty() {
            continue;
        }
        let object: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(text)
            .map_err(|e| CurveTableError { line, message: format!("this is not a JSON object: {e}") })?;
        let (time, table) = match &mut found {
            Some(found) => found,
            None => {
                let names: Vec<String> = object.keys().cloned().collect();
                let (time, values) = selected(&names, column, line)?;
                let table = CurveTable::new(values.iter().map(|k| names[*k].clone()).collect());
                found.insert((names[time].clone(), table))
            }
        };
        let number = |name: &String| match object.get(name) {
            None | Some(serde_json::Value::Null) => Ok(f64::NAN),
            Some(x) => x.as_f64().ok_or_else(|| CurveTableError {
                line,
                message: format!("`{name}` is {}; a number or null is needed", excerpt(&x.to_string())),
            }),
        };
        let at = number(time)?;
        let names = table.names.clone();
        table.push(line, at, names.iter().map(number))?;
    }
    Ok(found.map(|(_, table)| table).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(text: &str, times: &[f64]) -> Vec<f32> {
        let table = read_curve_table(text.as_bytes(), "").unwrap();
        let all = |t: &f64| (0..table.names.len()).map(|c| table.at(c, *t) as f32).collect::<Vec<f32>>();
        times.iter().flat_map(all).collect()
    }

    #[test]
    fn rows_at_any_times_are_on_straight_lines() {
        let text = "time_s, a, comment\n0.5,1,first\n0.75,2,\n2,4,\n";
        assert_eq!(sampled(text, &[0.0, 0.5, 0.625, 1.375, 2.0, 3.0]), [1.0, 1.0, 1.5, 3.0, 4.0, 4.0]);
        let two = "x,time,y\n1,0,5\n3,1,7\n";
        assert_eq!(sampled(two, &[0.5]), [2.0, 6.0]);
        assert_eq!(read_curve_table(two.as_bytes(), "y").unwrap().at(0, 0.5), 6.0);
        let lines = "{\"time\": 0, \"h\": 1, \"v\": null}\n\n{\"time\": 1, \"h\": 2, \"v\": 3}\n";
        assert_eq!(sampled(lines, &[0.5]), [1.5, 3.0]);
    }

    #[test]
    fn short_gaps_are_bridged_and_long_ones_stay() {
        let text = "time_s,a\n0,0\n0.04,nan\n0.08,2\n0.3,\n0.6,5\n";
        let x = sampled(text, &[0.04, 0.08, 0.3, 0.6]);
        assert!((x[0] - 1.0).abs() < 1e-6 && x[1] == 2.0 && x[2].is_nan() && x[3] == 5.0, "{x:?}");
    }

    #[test]
    fn mistakes_have_a_line() {
        for (text, line, part) in [
            ("", 1, "empty"),
            ("a,b\n1,2\n", 1, "no column `time_s`"),
            ("time_s\n1\n", 1, "no column for a number"),
            ("time_s,a\n0,1\n1,x\n", 3, "`a` is \"x\""),
            ("time_s,a\n1,1\n0,2\n", 3, "times must increase"),
            ("time_s,a\n0,1\nnan,2\n", 3, "the time is NaN"),
            ("time_s,a\n-1,1\n", 2, "the time is -1"),
            ("time_s,a\n0,1,2\n", 2, "3 field"),
            ("time_s,a\n", 1, "no row"),
            ("{\"time\": 0, \"a\": 1}\n{\"time\": 1, \"a\": \"x\"}", 2, "a number or null"),
            ("{\"time\": 0, \"a\": 1}\n{", 2, "not a JSON object"),
        ] {
            let e = read_curve_table(text.as_bytes(), "").unwrap_err();
            assert!(e.line == line && e.message.contains(part), "{text:?}: {e}");
        }
        let e = read_curve_table(b"time_s,a\n0,1\n", "b").unwrap_err();
        assert_eq!(e.message, "there is no column for \"b\"; columns are time_s, a");
    }
}
