//! CSV tables with a header of known columns, read row by row.

use super::columns::{Columns, Field};
use super::error::{LogFault, csv_fault, shorten};
use crate::contact::vector::Vec3;

/// Largest number in a field, in SI units.
const MAX_NUMBER: f64 = 1e12;

/// One row of a table.
pub(super) struct Cells<'a> {
    pub columns: &'a Columns,
    pub record: &'a csv::ByteRecord,
    pub line: u64,
}

impl Cells<'_> {
    fn name(&self, k: usize) -> &str {
        self.columns.names.get(k).map_or("", String::as_str)
    }

    pub fn fault(&self, field: Field, message: impl Into<String>) -> LogFault {
        let column = self.columns.find(field).map_or("", |(k, _)| self.name(k));
        LogFault::at(self.line, column, message)
    }

    /// Text of a field; `None` without such a column, or if it is empty.
    pub fn text(&self, field: Field) -> Result<Option<&str>, LogFault> {
        let Some((k, _)) = self.columns.find(field) else { return Ok(None) };
        let bytes = self.record.get(k).unwrap_or_default();
        let text = std::str::from_utf8(bytes).map_err(|_| self.fault(field, "not UTF-8 text"))?;
        Ok(Some(text.trim_ascii()).filter(|t| !t.is_empty()))
    }

    /// Number of a field, in SI units; `None` without such a column, or if it is empty.
    pub fn optional_number(&self, field: Field) -> Result<Option<f64>, LogFault> {
        let Some(text) = self.text(field)? else { return Ok(None) };
        let factor = self.columns.find(field).map_or(1.0, |(_, factor)| factor);
        let wrong =
            |needed: &str| self.fault(field, format!("{:?} is there; {needed} is needed", shorten(text)));
        let number = text.parse::<f64>().ok().filter(|x| x.is_finite()).map(|x| x * factor);
        let number = number.ok_or_else(|| wrong("a finite number"))?;
        if number.abs() > MAX_NUMBER {
            return Err(wrong("a number of at most 1e12 in SI units"));
        }
        Ok(Some(number))
    }

    /// Number of a required field.
    pub fn number(&self, field: Field) -> Result<f64, LogFault> {
        self.optional_number(field)?
            .ok_or_else(|| self.fault(field, "nothing is there; a finite number is needed"))
    }

    /// Vector of three required fields.
    pub fn vector(&self, fields: [Field; 3]) -> Result<Vec3, LogFault> {
        let [x, y, z] = fields;
        Ok([self.number(x)?, self.number(y)?, self.number(z)?])
    }

    /// Vector of three fields; `None` if one is missing or empty.
    pub fn optional_vector(&self, fields: [Field; 3]) -> Result<Option<Vec3>, LogFault> {
        let [x, y, z] = fields;
        let Some(x) = self.optional_number(x)? else { return Ok(None) };
        Ok(self.optional_number(y)?.zip(self.optional_number(z)?).map(|(y, z)| [x, y, z]))
    }
}

/// Reads a header, and calls `each` with each row after it.
pub(super) fn read_table(
    bytes: &[u8],
    table: &[(&'static str, Field, super::columns::Unit)],
    check: impl FnOnce(&Columns, u64) -> Result<(), LogFault>,
    mut each: impl FnMut(&Cells<'_>) -> Result<(), LogFault>,
) -> Result<(), LogFault> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(LogFault::new(1, "the file is empty; a header and rows under it are needed"));
    }
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::Headers).comment(Some(b'#')).from_reader(bytes);
    let header = csv.headers().map_err(|e| csv_fault(&e))?;
    let line = header.position().map_or(1, csv::Position::line);
    let columns = Columns::of(table, header.iter().map(str::to_owned).collect())
        .map_err(|(column, message)| LogFault::at(line, &column, message))?;
    check(&columns, line)?;
    let mut record = csv::ByteRecord::new();
    while csv.read_byte_record(&mut record).map_err(|e| csv_fault(&e))? {
        let line = record.position().map_or(0, csv::Position::line);
        each(&Cells { columns: &columns, record: &record, line })?;
    }
    Ok(())
}
