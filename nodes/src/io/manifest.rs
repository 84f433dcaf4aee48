//! Lists of recordings with their metadata, as CSV.

use crate::core::files::strip_bom;
use std::collections::HashMap;

/// Maximum number of entries of a manifest.
pub const MAX_ENTRIES: usize = 10_000;
/// Maximum number of characters of an entry.
const MAX_TEXT: usize = 500;

/// A line of a manifest.
pub trait ManifestEntry: Default {
    /// Name of an entry, such as `take`.
    const NAME: &'static str;
    /// Columns, for messages.
    const COLUMNS: &'static str;

    /// The field of a column; `file` is the path of the recording, relative to the manifest.
    fn field(column: &str) -> Option<fn(&mut Self) -> &mut String>;

    /// Checks the fields of an entry.
    ///
    /// # Errors
    /// A message that names the column, the value found, and what is needed.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }
}

/// Reads a manifest: a CSV with the columns of `E` in any order; `file` is required.
///
/// # Errors
/// A message with the line, the column, the value found, and what is needed.
pub fn read_manifest<E: ManifestEntry>(bytes: &[u8]) -> Result<Vec<E>, String> {
    let bytes = strip_bom(bytes);
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        format!("line {line}: bytes that are not UTF-8; save the list as CSV in UTF-8")
    })?;
    let mut csv = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .flexible(true)
        .from_reader(text.as_bytes());
    let header: Vec<String> = csv.headers().map_err(|e| e.to_string())?.iter().map(str::to_owned).collect();
    let mut columns = Vec::with_capacity(header.len());
    for (k, name) in header.iter().enumerate() {
        if header[..k].contains(name) {
            return Err(format!("line 1: column {:?} occurs twice", excerpt(name)));
        }
        columns.push(E::field(name).ok_or_else(|| {
            format!(
                "line 1: there is no column {:?} in a list of {}s; columns are {}",
                excerpt(name),
                E::NAME,
                E::COLUMNS
            )
        })?);
    }
    if !header.iter().any(|name| name == "file") {
        return Err(format!("line 1: column `file` is missing; columns are {}", E::COLUMNS));
    }
    let file = E::field("file").ok_or_else(|| "there is no column `file`".to_owned())?;
    let mut entries: Vec<E> = Vec::new();
    let mut lines: HashMap<String, u64> = HashMap::new();
    for record in csv.records() {
        let record = record.map_err(|e| e.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != header.len() {
            return Err(format!(
                "line {line}: {} entries, the header has {}; entries with a comma need quotes",
                record.len(),
                header.len()
            ));
        }
        let mut entry = E::default();
        for ((text, column), name) in record.iter().zip(&columns).zip(&header) {
            if text.chars().count() > MAX_TEXT || text.contains(|c: char| c.is_control()) {
                return Err(format!(
                    "line {line}, column `{name}`: {:?}; at most {MAX_TEXT} printable characters are needed",
                    excerpt(text)
                ));
            }
            text.clone_into(column(&mut entry));
        }
        let path = file(&mut entry).clone();
        if path.is_empty() {
            return Err(format!(
                "line {line}, column `file`: \"\"; the path of a recording is needed, relative to the list"
            ));
        }
        if path.starts_with('/') || path.contains('\\') {
            return Err(format!(
                "line {line}, column `file`: {:?}; a path relative to the list is needed, with `/` between folders",
                excerpt(&path)
            ));
        }
        if let Some(before) = lines.get(&path) {
            return Err(format!(
                "line {line}, column `file`: {:?} is already listed in line {before}; each recording is listed once",
                excerpt(&path)
            ));
        }
        lines.insert(path, line);
        entry.check().map_err(|text| format!("line {line}, {text}"))?;
        entries.push(entry);
        if entries.len() > MAX_ENTRIES {
            return Err(format!("line {line}: at most {MAX_ENTRIES} {}s are read", E::NAME));
        }
    }
    if entries.is_empty() {
        return Err(format!("no {} follows the header; a line such as `knock_1.wav` is needed", E::NAME));
    }
    Ok(entries)
}

fn excerpt(text: &str) -> String {
    text.chars().take(60).collect()
}

/// The path of a file that a list at `list` names.
#[must_use]
pub fn beside(list: &str, file: &str) -> String {
    let folder = list.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in file.split('/') {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|last| *last != "..") => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    let root = if folder.starts_with('/') || list.starts_with('/') { "/" } else { "" };
    format!("{root}{}", parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_lie_beside_the_list() {
        assert_eq!(beside("assets/takes.csv", "a.wav"), "assets/a.wav");
        assert_eq!(beside("assets/takes.csv", "../b/./a.wav"), "b/a.wav");
        assert_eq!(beside("takes.csv", "../a.wav"), "../a.wav");
        assert_eq!(beside("/data/takes.csv", "x/a.wav"), "/data/x/a.wav");
        assert_eq!(beside("../takes.csv", "a.wav"), "../a.wav");
    }
}
