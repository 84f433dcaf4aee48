//! Formats of files that people write beside graphs: correspondences, materials and scores. Their fields are those of the readers
//! that nodes use, so that the server cannot differ from them.

use super::file::TextFile;
use crate::lang::cursor::{Cursor, Frame, Slot};
use crate::lang::{Span, SyntaxKind};
#[cfg(feature = "material")]
use foley_nodes::material::read_material;
#[cfg(feature = "numbers")]
use foley_nodes::soundtrack::score::read_score;
use foley_nodes::warp::{TextError, read_correspondences};

/// A format of files.
pub struct Format {
    /// The name before the brackets of a file.
    pub name: &'static str,
    /// Description of the format.
    pub doc: &'static str,
    check: fn(&str) -> Result<(), TextError>,
}

/// All formats.
pub static FORMATS: &[Format] = &[
    Format {
        name: "Correspondences",
        doc: "Moments of a motion and of recordings that should sound alike.",
        check: |text| read_correspondences(text).map(drop),
    },
    #[cfg(feature = "material")]
    Format {
        name: "Material",
        doc: "Damping and elasticity of a material.",
        check: |text| read_material(text.as_bytes()).map(drop),
    },
    #[cfg(feature = "numbers")]
    Format {
        name: "SoundScore",
        doc: "Sounds of recordings, and when they occur in the output.",
        check: |text| read_score(text).map(drop),
    },
];

/// A field that no format has, which makes a reader list those that it has.
const PROBE: &str = "__";
/// Maximum number of required fields of a file.
const MAX_REQUIRED: usize = 8;

impl Format {
    /// The format of a text, by its name.
    #[must_use]
    pub fn of(file: &TextFile) -> Option<&'static Self> {
        let kind = file.kind()?;
        FORMATS.iter().find(|format| format.name == kind)
    }

    /// The first mistake that the reader finds in a text, or those of all records, with its location.
    #[must_use]
    pub fn mistake(&self, file: &TextFile) -> Option<(Span, String)> {
        let TextError { location, message } = (self.check)(&file.text).err()?;
        let start = file.offset_of(location.line as usize, location.column as usize);
        // The value or word that begins there.
        let root = file.parse.syntax();
        let at = u32::try_from(start).ok().map(rowan::TextSize::from);
        let at = at.filter(|at| root.text_range().contains(*at));
        let token = at.and_then(|at| root.token_at_offset(at).right_biased());
        let end = token.map_or(start, |token| usize::from(token.text_range().end()));
        Some((start..end.max(start), message))
    }

    /// The names that are valid at a cursor: fields of a record, or the choices of a value.
    #[must_use]
    pub fn names(&self, cursor: &Cursor) -> Vec<String> {
        let probe = match &cursor.slot {
            Slot::Item if cursor.frames.last().is_some_and(|frame| frame.opener == SyntaxKind::LParen) => {
                format!("{PROBE}: 0")
            }
            Slot::Value(key) => format!("{}: {PROBE}", key.text),
            _ => return Vec::new(),
        };
        let mut required = Vec::new();
        for _ in 0..MAX_REQUIRED {
            let text = nested(&cursor.frames[1..], &probe, &required);
            let Err(TextError { message, .. }) = (self.check)(&text) else { return Vec::new() };
            match message.strip_suffix("` is missing").and_then(|rest| rest.rsplit('`').next()) {
                Some(field) if !required.contains(&field.to_owned()) => required.push(field.to_owned()),
                _ => return listed(&message),
            }
        }
        Vec::new()
    }
}

/// A text whose brackets contain only the path to the probe, and the required fields of the file.
fn nested(frames: &[Frame], probe: &str, required: &[String]) -> String {
    let (mut text, mut closers) = (String::new(), String::new());
    for (depth, frame) in frames.iter().enumerate() {
        if depth > 0
            && let Some(key) = frame.key()
        {
            text += &format!("{key}: ");
        }
        let (open, close) = match frame.opener {
            SyntaxKind::LBracket => ('[', ']'),
            SyntaxKind::LBrace => ('{', '}'),
            _ => ('(', ')'),
        };
        text += frame.name().unwrap_or_default();
        text.push(open);
        closers.insert(0, close);
        if depth == 0 {
            let given = |name: &&String| frames.get(1).and_then(Frame::key) != Some(name.as_str());
            text.extend(required.iter().filter(given).map(|name| format!("{name}: [], ")));
        }
    }
    text + probe + &closers
}

/// The names that a reader lists in its message about an unknown one.
fn listed(message: &str) -> Vec<String> {
    // Of several mistakes the first is about the probe.
    let first = message.split("; and ").next().unwrap_or(message);
    if let Some((_, fields)) = first.split_once("fields are ") {
        return fields.split(", ").map(|name| name.trim_matches('`').to_owned()).collect();
    }
    match first.split_once("expected one of ").or_else(|| first.split_once("expected either ")) {
        Some((_, names)) => names.split('`').skip(1).step_by(2).map(str::to_owned).collect(),
        None => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        let offset = text.find('|').unwrap();
        let file = TextFile::new(text.replacen('|', "", 1));
        let format = Format::of(&file).unwrap();
        format.names(&Cursor::at(&file.text, offset).unwrap())
    }

    #[test]
    fn readers_name_the_fields_and_choices_of_their_formats() {
        assert_eq!(names("Correspondences(|)"), ["version", "target", "length", "database", "pairs"]);
        let pair = names("Correspondences(version: 1, pairs: [(target: 1.0, |), (target: 2)])");
        assert!(pair.contains(&"duration".to_owned()) && pair.contains(&"weight".to_owned()), "{pair:?}");
        let target = names("SoundScore(sources: [(name: \"a\")], targets: [(|)])");
        assert!(target.contains(&"curve".to_owned()), "{target:?}");
        assert!(names("SoundScore(sources: [(name: \"a\", outside: |)])").contains(&"Exclude".to_owned()));
        assert!(names("Material(|)").contains(&"damping".to_owned()));
        let models = names("Material(damping: (model: |))");
        assert!(models.contains(&"Rayleigh".to_owned()), "{models:?}");
    }

    #[test]
    fn mistakes_have_their_places() {
        let file =
            TextFile::new("Correspondences(\n  pairs: [(target: 1.0, database: 2.0, duration: -3)],\n)");
        let (span, message) = Format::of(&file).unwrap().mistake(&file).unwrap();
        assert_eq!(&file.text[span], "-3", "{message}");
        assert!(message.contains("found -3"), "{message}");
    }
}
