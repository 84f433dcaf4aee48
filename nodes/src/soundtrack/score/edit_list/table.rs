//! Edit lists as tables.

use super::{Edit, EditList, LATEST};
use crate::artefact::text::{Location, TextError};
use crate::core::files::{excerpt, strip_bom};
use crate::io::csv_error;

/// The columns; the first four are required.
const COLUMNS: [&str; 6] = ["target_from", "target_to", "source_from", "source_to", "recording", "weight"];

fn error(line: u64, message: String) -> TextError {
    TextError::new(Location { line: u32::try_from(line).unwrap_or(u32::MAX), column: 1 }, message)
}

/// The index of each of the [`COLUMNS`].
fn columns(header: &csv::StringRecord) -> Result<[Option<usize>; 6], String> {
    let known = COLUMNS.join(", ");
    if let Some(name) = header.iter().find(|name| !COLUMNS.contains(name)) {
        return Err(format!("there is no column {:?}; columns are {known}", excerpt(name)));
    }
    let index = |wanted: &str| header.iter().position(|name| name == wanted);
    if let Some(name) = COLUMNS.iter().take(4).find(|name| index(name).is_none()) {
        return Err(format!("there is no column `{name}`; columns are {known}"));
    }
    if let Some(name) = COLUMNS.iter().find(|name| header.iter().filter(|n| n == *name).count() > 1) {
        return Err(format!("column `{name}` occurs twice"));
    }
    Ok(COLUMNS.map(index))
}

/// Reads CSV with a header.
pub(super) fn read(bytes: &[u8]) -> Result<EditList, TextError> {
    let mut csv =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(strip_bom(bytes));
    let bad = |e: csv::Error| {
        let (line, message) = csv_error(&e);
        error(line, message)
    };
    let header = csv.headers().map_err(bad)?.clone();
    let line = header.position().map_or(1, csv::Position::line);
    let indices = columns(&header).map_err(|message| error(line, message))?;
    let mut list = EditList::default();
    for row in csv.records() {
        let row = row.map_err(bad)?;
        let line = row.position().map_or(0, csv::Position::line);
        let [target_from, target_to, source_from, source_to, recording, weight] =
            indices.map(|k| k.and_then(|k| row.get(k)).unwrap_or_default());
        let number = |k: usize, text: &str, low: f64, high: f64| {
            text.parse::<f64>().ok().filter(|x| (low..=high).contains(x)).ok_or_else(|| {
                let (name, found) = (COLUMNS.get(k).unwrap_or(&""), excerpt(text));
                let message = format!("column `{name}`: {found:?}; a number from {low} to {high} is needed");
                error(line, message)
            })
        };
        let time = |k: usize, text: &str| number(k, text, 0.0, LATEST);
        let target = (time(0, target_from)?, time(1, target_to)?);
        let source = (time(2, source_from)?, time(3, source_to)?);
        for (name, (from, to), is_wrong) in
            [("target", target, target.1 <= target.0), ("source", source, source.1 < source.0)]
        {
            if is_wrong {
                let message =
                    format!("the {name} is from {from} s to {to} s; its end must be after its start");
                return Err(error(line, message));
            }
        }
        let weight = if weight.is_empty() { None } else { Some(number(5, weight, -1.0, 1.0)?) };
        list.edits.push(Edit {
            target,
            source,
            name: format!("edit {:03}", list.edits.len() + 1),
            recording: (!recording.is_empty()).then(|| recording.to_owned()),
            weight,
            line: u32::try_from(line).unwrap_or(u32::MAX),
        });
    }
    Ok(list)
}
