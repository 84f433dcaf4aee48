//! Lists of takes: recordings of impacts with what was struck, held and used, from a table.

use crate::core::files::strip_bom;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Maximum number of takes of a list.
pub const MAX_TAKES: usize = 10_000;
/// Maximum number of characters of an entry.
const MAX_TEXT: usize = 500;
const COLUMNS: &str = "file, and optionally object, material, support, hit, striker, licence";

/// One recording of impacts on an object.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Take {
    /// Path of the recording, relative to the list.
    pub file: String,
    /// Name of the object that was struck; takes of one object share modes.
    pub object: String,
    /// Material of the object.
    pub material: String,
    /// What held the object, such as `two fingers, edge`.
    pub support: String,
    /// Where it was hit.
    pub hit: String,
    /// What it was hit with.
    pub striker: String,
    /// Licence of the recording.
    pub licence: String,
}

/// Reads a list of takes from a CSV with the columns `file`, and optionally `object`, `material`, `support`, `hit`, `striker` and
/// `licence`, in any order.
///
/// # Errors
/// A message with the line, the column, what was found, and what would be right.
///
/// # Example
/// ```
/// let csv = "file,object,support\nplate_1.wav,plate,fingers\nplate_2.wav,plate,foam\n";
/// let takes = foley_nodes::modal::read_takes(csv.as_bytes())?;
/// assert_eq!((takes.len(), takes[1].support.as_str()), (2, "foam"));
/// # Ok::<(), String>(())
/// ```
pub fn read_takes(bytes: &[u8]) -> Result<Vec<Take>, String> {
    let bytes = strip_bom(bytes);
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        format!("line {line}: bytes that are no UTF-8; save the list as CSV in UTF-8")
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
        columns.push(field(name).ok_or_else(|| {
            format!(
                "line 1: there is no column {:?} in a list of takes; columns are {COLUMNS}",
                excerpt(name)
            )
        })?);
    }
    if !header.iter().any(|name| name == "file") {
        return Err(format!("line 1: column `file` is missing; columns are {COLUMNS}"));
    }
    let mut takes: Vec<Take> = Vec::new();
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
        let mut take = Take::default();
        for ((text, column), name) in record.iter().zip(&columns).zip(&header) {
            if text.chars().count() > MAX_TEXT || text.contains(|c: char| c.is_control()) {
                return Err(format!(
                    "line {line}, column `{name}`: {:?}; at most {MAX_TEXT} printable characters are needed",
                    excerpt(text)
                ));
            }
            text.clone_into(column(&mut take));
        }
        if take.file.is_empty() {
            return Err(format!(
                "line {line}, column `file`: \"\"; the path of a recording is needed, relative to the list"
            ));
        }
        if take.file.starts_with('/') || take.file.contains('\\') {
            return Err(format!(
                "line {line}, column `file`: {:?}; a path relative to the list is needed, with `/` between folders",
                excerpt(&take.file)
            ));
        }
        if let Some(before) = lines.get(&take.file) {
            return Err(format!(
                "line {line}, column `file`: {:?} stands in line {before} already; each recording is listed once",
                excerpt(&take.file)
            ));
        }
        lines.insert(take.file.clone(), line);
        takes.push(take);
        if takes.len() > MAX_TAKES {
            return Err(format!("line {line}: at most {MAX_TAKES} takes are read"));
        }
    }
    if takes.is_empty() {
        return Err("no take follows the header; a line such as `knock_1.wav` is needed".into());
    }
    Ok(takes)
}

/// The field of a column.
fn field(column: &str) -> Option<fn(&mut Take) -> &mut String> {
    Some(match column {
        "file" => |take| &mut take.file,
        "object" => |take| &mut take.object,
        "material" => |take| &mut take.material,
        "support" => |take| &mut take.support,
        "hit" => |take| &mut take.hit,
        "striker" => |take| &mut take.striker,
        "licence" => |take| &mut take.licence,
        _ => return None,
    })
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
    fn columns_may_have_any_order_and_be_left_out() {
        let text =
            "\u{feff}# knocks\nsupport, file ,object\n\"fingers, edge\",a.wav,plate\nfoam,../b.wav,plate\n";
        let takes = read_takes(text.as_bytes()).unwrap();
        assert_eq!((takes[0].support.as_str(), takes[1].file.as_str()), ("fingers, edge", "../b.wav"));
        assert!(takes[0].material.is_empty() && takes[1].object == "plate");
    }

    #[test]
    fn errors_name_line_and_column_and_what_would_be_right() {
        let long = format!("file,hit\na.wav,{}\n", "x".repeat(600));
        for (text, part) in [
            ("", "column `file` is missing"),
            ("object,hit\nplate,edge\n", "column `file` is missing"),
            ("file,colour\na.wav,red\n", "no column \"colour\" in a list of takes; columns are file"),
            ("file,file\na.wav,b.wav\n", "column \"file\" occurs twice"),
            ("file,object\n", "no take follows the header"),
            ("file,object\na.wav\n", "line 2: 1 entries, the header has 2"),
            ("file,object\na.wav,x\n,y\n", "line 3, column `file`: \"\"; the path of a recording"),
            ("file\n/a.wav\n", "line 2, column `file`: \"/a.wav\"; a path relative to the list"),
            ("file\na.wav\nb.wav\na.wav\n", "line 4, column `file`: \"a.wav\" stands in line 2 already"),
            (&long, "line 2, column `hit`: \"xxx"),
        ] {
            let e = read_takes(text.as_bytes()).unwrap_err();
            assert!(e.contains(part), "{text:?}: {e}");
        }
        assert!(read_takes(b"file\na.wav\n\xff\n").unwrap_err().contains("line 3: bytes that are no UTF-8"));
    }

    #[test]
    fn files_lie_beside_the_list() {
        assert_eq!(beside("assets/takes.csv", "a.wav"), "assets/a.wav");
        assert_eq!(beside("assets/takes.csv", "../b/./a.wav"), "b/a.wav");
        assert_eq!(beside("takes.csv", "../a.wav"), "../a.wav");
        assert_eq!(beside("/data/takes.csv", "x/a.wav"), "/data/x/a.wav");
        assert_eq!(beside("../takes.csv", "a.wav"), "../a.wav");
    }
}
