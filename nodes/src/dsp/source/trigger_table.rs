//! Triggers from CSV.

use super::trigger::Trigger;
use crate::core::files::{excerpt, strip_bom};
use crate::io::csv_error;

/// Maximum number of triggers in a file.
pub const MAX_TRIGGERS: usize = 1 << 20;
/// Latest time of a trigger, in s.
pub const MAX_TIME: f64 = 86_400.0;
/// Columns, for messages.
const COLUMNS: &str = "time_s, gain, index, ratio";

/// Meaning of a column.
#[derive(Clone, Copy, PartialEq)]
enum Column {
    Time,
    Gain,
    Index,
    Ratio,
}

impl Column {
    fn of(name: &str) -> Option<Self> {
        match name {
            "time" | "time_s" => Some(Self::Time),
            "gain" => Some(Self::Gain),
            "index" => Some(Self::Index),
            "ratio" => Some(Self::Ratio),
            _ => None,
        }
    }
}

/// A number within limits.
fn number(text: &str, low: f64, high: f64) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|x| (low..=high).contains(x));
    value.ok_or_else(|| format!("{:?}; a number from {low} to {high} is needed", excerpt(text)))
}

/// Sets the field of a column; returns a description of the mistake in its text.
fn set(column: Column, text: &str, time: &mut f64, trigger: &mut Trigger) -> Result<(), String> {
    let [low, high] = [*Trigger::RATIOS.start(), *Trigger::RATIOS.end()].map(f64::from);
    match column {
        Column::Time => *time = number(text, 0.0, MAX_TIME)?,
        Column::Gain => trigger.gain = number(text, -1000.0, 1000.0)? as f32,
        Column::Ratio => trigger.ratio = number(text, low, high)? as f32,
        Column::Index => {
            let index = text.parse();
            trigger.index =
                index.map_err(|_| format!("{:?}; a whole number from 0 on is needed", excerpt(text)))?;
        }
    }
    Ok(())
}

/// Reads triggers with their times in s from CSV: a header with `time_s` or `time`, and optionally `gain` (1), `index` (0) and `ratio` (1),
/// in any order; in the order of the file.
///
/// # Errors
/// A message with line and column, the value found, and what is needed.
///
/// # Example
/// ```
/// use foley_nodes::dsp::{Trigger, read_trigger_table};
///
/// let triggers = read_trigger_table(b"time_s,index\n0.5,0\n0.75,2\n")?;
/// assert_eq!(triggers[1], (0.75, Trigger { index: 2, ..Trigger::of(1.0) }));
/// # Ok::<(), String>(())
/// ```
pub fn read_trigger_table(bytes: &[u8]) -> Result<Vec<(f64, Trigger)>, String> {
    let bytes = strip_bom(bytes);
    if bytes.trim_ascii().is_empty() {
        return Err(format!("line 1: the file is empty; a header such as {COLUMNS} is needed"));
    }
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let bad = |e: csv::Error| {
        let (line, message) = csv_error(&e);
        format!("line {line}: {message}")
    };
    let header = csv.headers().map_err(bad)?.clone();
    let line = header.position().map_or(1, csv::Position::line);
    let mut columns = Vec::new();
    for name in &header {
        let column = Column::of(name).ok_or_else(|| {
            format!("line {line}: there is no column {:?}; columns are {COLUMNS}", excerpt(name))
        })?;
        if columns.contains(&column) {
            return Err(format!("line {line}: column `{name}` occurs twice"));
        }
        columns.push(column);
    }
    if !columns.contains(&Column::Time) {
        return Err(format!("line {line}: column `time_s` is missing; columns are {COLUMNS}"));
    }
    let mut triggers = Vec::new();
    for record in csv.records() {
        let record = record.map_err(bad)?;
        let line = record.position().map_or(0, csv::Position::line);
        if triggers.len() == MAX_TRIGGERS {
            return Err(format!("line {line}: at most {MAX_TRIGGERS} triggers are read"));
        }
        let (mut time, mut trigger) = (0.0, Trigger::of(1.0));
        for ((text, column), name) in record.iter().zip(&columns).zip(&header) {
            set(*column, text, &mut time, &mut trigger)
                .map_err(|message| format!("line {line}, column `{name}`: {message}"))?;
        }
        triggers.push((time, trigger));
    }
    Ok(triggers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_may_have_any_order_and_all_but_the_time_may_be_missing() {
        let text = "\u{feff}ratio, time, index\n# a comment\n2, 0.25, 3\n0.5, 0.125, 0\n";
        let triggers = read_trigger_table(text.as_bytes()).unwrap();
        let second = Trigger { gain: 1.0, index: 0, ratio: 0.5 };
        assert_eq!(triggers, [(0.25, Trigger { gain: 1.0, index: 3, ratio: 2.0 }), (0.125, second)]);
        assert_eq!(read_trigger_table(b"gain,time_s\n-0.5,1\n").unwrap(), [(1.0, Trigger::of(-0.5))]);
        assert_eq!(read_trigger_table(b"time_s\n").unwrap(), []);
    }

    #[test]
    fn errors_name_line_and_column_and_what_would_be_right() {
        for (text, part) in [
            ("", "line 1: the file is empty; a header such as time_s"),
            (" \n", "line 1: the file is empty"),
            ("gain\n1\n", "line 1: column `time_s` is missing; columns are time_s, gain, index, ratio"),
            ("time_s,pitch\n0,1\n", "line 1: there is no column \"pitch\"; columns are time_s"),
            ("time,time_s\n0,0\n", "line 1: column `time_s` occurs twice"),
            ("time_s\n-1\n", "line 2, column `time_s`: \"-1\"; a number from 0 to 86400 is needed"),
            ("time_s\nNaN\n", "line 2, column `time_s`: \"NaN\""),
            ("time_s\ninf\n", "line 2, column `time_s`: \"inf\""),
            ("time_s,gain\n0,loud\n", "line 2, column `gain`: \"loud\""),
            ("time_s,gain\n0,\n", "line 2, column `gain`: \"\""),
            ("time_s,index\n0,1\n1,1.5\n", "line 3, column `index`: \"1.5\"; a whole number from 0 on"),
            ("time_s,index\n0,-1\n", "line 2, column `index`: \"-1\""),
            ("time_s,ratio\n0,0\n", "line 2, column `ratio`: \"0\"; a number from 0.0625 to 16 is needed"),
            ("time_s,ratio\n0\n", "line 2: 1 field(s) where the header has 2"),
        ] {
            let message = read_trigger_table(text.as_bytes()).unwrap_err();
            assert!(message.contains(part), "{text:?}: {message}");
        }
        assert_eq!(read_trigger_table(b"time_s\n0\n\xff\n").unwrap_err(), "line 3: not UTF-8 text");
    }
}
