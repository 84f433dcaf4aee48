//! Figures as text.

use std::fmt::Write as _;

/// A number with four significant digits.
#[must_use]
pub fn figure(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return if x == 0.0 { "0".to_owned() } else { x.to_string() };
    }
    if x.abs() < 1e-3 || x.abs() >= 1e7 {
        return format!("{x:.3e}");
    }
    let digits = (3.0 - x.abs().log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A level in dB.
#[must_use]
pub fn db(x: f64) -> String {
    if x == f64::NEG_INFINITY { "-inf dB".to_owned() } else { format!("{x:.2} dB") }
}

/// A share in percent.
pub fn percent(share: f64) -> String {
    format!("{} %", figure((1000.0 * share).round() / 10.0))
}

/// A heading with labelled lines under it, whose texts are aligned.
pub struct Listing {
    text: String,
}

impl Listing {
    /// A heading.
    pub fn new(heading: &str) -> Self {
        Self { text: format!("{heading}\n") }
    }

    /// Adds a line.
    pub fn line(&mut self, label: &str, text: impl AsRef<str>) {
        let _ = writeln!(self.text, "  {label:<11} {}", text.as_ref());
    }

    /// Adds a table whose columns are aligned: the first to the left, the others to the right.
    pub fn table(&mut self, heading: &[&str], rows: &[Vec<String>]) {
        let cell = |row: &[String], k: usize| row.get(k).map_or(0, |cell| cell.chars().count());
        let width = |k: usize| {
            rows.iter().map(|row| cell(row, k)).chain([heading[k].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..heading.len()).map(width).collect();
        let heading: Vec<String> = heading.iter().map(|text| (*text).to_owned()).collect();
        for row in [&heading].into_iter().chain(rows) {
            let cells = row.iter().zip(&widths).enumerate().map(|(k, (cell, &width))| match k {
                0 => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            });
            let _ = writeln!(self.text, "    {}", cells.collect::<Vec<_>>().join("  ").trim_end());
        }
    }

    /// Adds a text as it is.
    pub fn raw(&mut self, text: &str) {
        self.text.push_str(text);
    }

    /// The whole text.
    pub fn finish(self) -> String {
        self.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_four_digits() {
        assert_eq!(figure(0.0), "0");
        assert_eq!(figure(1.0), "1");
        assert_eq!(figure(-12.3456), "-12.35");
        assert_eq!(figure(48_000.0), "48000");
        assert_eq!(figure(0.000_123_4), "1.234e-4");
        assert_eq!(percent(0.8765), "87.7 %");
        assert_eq!(db(f64::NEG_INFINITY), "-inf dB");
    }

    #[test]
    fn tables_are_aligned() {
        let mut listing = Listing::new("head");
        listing.line("label", "text");
        listing
            .table(&["column", "min"], &[vec!["x".into(), "1".into()], vec!["yy".into(), "-100.5".into()]]);
        let expected =
            "head\n  label       text\n    column     min\n    x            1\n    yy      -100.5\n";
        assert_eq!(listing.finish(), expected);
    }
}
