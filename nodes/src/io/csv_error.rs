//! Errors of CSV files.

/// The line of an error of the `csv` crate, from 1, and its description.
pub fn csv_error(e: &csv::Error) -> (u64, String) {
    let message = match e.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} field(s) where the header has {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "not UTF-8 text".into(),
        _ => "not comma-separated text".into(),
    };
    (e.position().map_or(1, csv::Position::line), message)
}
