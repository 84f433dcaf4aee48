//! Lists of takes from a table: recordings of impacts with object, support and striker.

use crate::io::manifest::{ManifestEntry, read_manifest};
use serde::{Deserialize, Serialize};

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
    /// Support of the object, such as `two fingers, edge`.
    pub support: String,
    /// Hit point.
    pub hit: String,
    /// Striker.
    pub striker: String,
    /// Licence of the recording.
    pub licence: String,
}

/// Reads a list of takes from a CSV with the columns `file`, and optionally `object`, `material`, `support`, `hit`, `striker` and
/// `licence`, in any order.
///
/// # Errors
/// A message with the line, the column, the value found, and what is needed.
///
/// # Example
/// ```
/// let csv = "file,object,support\nplate_1.wav,plate,fingers\nplate_2.wav,plate,foam\n";
/// let takes = foley_nodes::modal::read_takes(csv.as_bytes())?;
/// assert_eq!((takes.len(), takes[1].support.as_str()), (2, "foam"));
/// # Ok::<(), String>(())
/// ```
pub fn read_takes(bytes: &[u8]) -> Result<Vec<Take>, String> {
    read_manifest(bytes)
}

impl ManifestEntry for Take {
    const NAME: &'static str = "take";
    const COLUMNS: &'static str = "file, and optionally object, material, support, hit, striker, licence";

    fn field(column: &str) -> Option<fn(&mut Self) -> &mut String> {
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
            ("file\na.wav\nb.wav\na.wav\n", "line 4, column `file`: \"a.wav\" is already listed in line 2"),
            (&long, "line 2, column `hit`: \"xxx"),
        ] {
            let e = read_takes(text.as_bytes()).unwrap_err();
            assert!(e.contains(part), "{text:?}: {e}");
        }
        assert!(read_takes(b"file\na.wav\n\xff\n").unwrap_err().contains("line 3: bytes that are not UTF-8"));
    }
}
