//! Metadata of a recording.

use super::kind::SourceKind;
use crate::io::manifest::ManifestEntry;
use serde::{Deserialize, Serialize};

/// Component of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Component {
    /// The recording as a whole.
    #[default]
    Whole,
    /// Its sinusoids.
    Steady,
    /// The recording without its sinusoids.
    Transient,
}

/// A line of a manifest of recordings for grains.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingLabel {
    /// Path, relative to the manifest.
    pub file: String,
    /// Words that describe it, separated by spaces, such as `stone scrape`.
    pub tags: String,
    /// `impulsive` or `continuous`; empty for a guess.
    pub kind: String,
    /// Speed of the motion that was recorded, m/s; empty if it is unknown.
    pub speed: String,
    /// Licence.
    pub licence: String,
}

impl ManifestEntry for RecordingLabel {
    const NAME: &'static str = "recording";
    const COLUMNS: &'static str = "file, and optionally tags, kind, speed, licence";

    fn field(column: &str) -> Option<fn(&mut Self) -> &mut String> {
        Some(match column {
            "file" => |label| &mut label.file,
            "tags" => |label| &mut label.tags,
            "kind" => |label| &mut label.kind,
            "speed" => |label| &mut label.speed,
            "licence" => |label| &mut label.licence,
            _ => return None,
        })
    }

    fn check(&self) -> Result<(), String> {
        self.given_kind()?;
        self.given_speed().map(drop)
    }
}

/// The words of a text, in lower case.
pub(super) fn words(text: &str) -> Vec<String> {
    let separators = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '_' | '-' | '.');
    let is_word = |word: &&str| !word.is_empty() && !word.chars().all(|c| c.is_ascii_digit());
    text.split(separators).filter(is_word).map(str::to_lowercase).collect()
}

impl RecordingLabel {
    /// The tags: those given, or else the words of the file name without its numbers and its ending.
    #[must_use]
    pub fn tag_words(&self) -> Vec<String> {
        if !self.tags.trim().is_empty() {
            return words(&self.tags);
        }
        let name = self.file.rsplit('/').next().unwrap_or_default();
        words(name.rsplit_once('.').map_or(name, |(stem, _)| stem))
    }

    /// The kind, if it is given.
    ///
    /// # Errors
    /// Another word than `impulsive` and `continuous`.
    pub fn given_kind(&self) -> Result<Option<SourceKind>, String> {
        match self.kind.to_lowercase().as_str() {
            "" => Ok(None),
            "impulsive" => Ok(Some(SourceKind::Impulsive)),
            "continuous" => Ok(Some(SourceKind::Continuous)),
            _ => Err(format!(
                "column `kind`: {:?}; `impulsive`, `continuous`, or nothing for a guess is needed",
                self.kind
            )),
        }
    }

    /// The speed, if it is given.
    ///
    /// # Errors
    /// A text that names the value, if it is no positive number.
    pub fn given_speed(&self) -> Result<Option<f64>, String> {
        if self.speed.is_empty() {
            return Ok(None);
        }
        match self.speed.parse::<f64>() {
            Ok(v) if v.is_finite() && v > 0.0 => Ok(Some(v)),
            _ => Err(format!(
                "column `speed`: {:?}; a number above 0 in m/s, or nothing, is needed",
                self.speed
            )),
        }
    }
}

/// Returns the indices of the sets of tags that contain the most of the wanted words, and true if one contains all of them.
///
/// Without a wanted word all sets match. Where no set contains a word, the result is empty.
#[must_use]
pub fn matching_tags<'a>(
    wanted: &str,
    sets: impl Iterator<Item = &'a [String]> + Clone,
) -> (Vec<usize>, bool) {
    let wanted = words(wanted);
    let shared = |tags: &[String]| wanted.iter().filter(|word| tags.contains(word)).count();
    let most = sets.clone().map(shared).max().unwrap_or(0);
    let found = sets.enumerate().filter(|(_, tags)| shared(tags) == most).map(|(k, _)| k);
    if most == 0 && !wanted.is_empty() {
        (Vec::new(), false)
    } else {
        (found.collect(), most == wanted.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::manifest::read_manifest;

    #[test]
    fn tags_are_those_of_the_manifest_or_the_words_of_the_file_name() {
        let csv =
            "file,tags,kind,speed\na/footstep_wood_03.flac,,,\nb.wav,\"Stone, scrape\",continuous,0.4\n";
        let labels: Vec<RecordingLabel> = read_manifest(csv.as_bytes()).unwrap();
        assert_eq!(labels[0].tag_words(), ["footstep", "wood"]);
        assert_eq!(labels[1].tag_words(), ["stone", "scrape"]);
        assert_eq!(labels[1].given_kind(), Ok(Some(SourceKind::Continuous)));
        assert_eq!((labels[0].given_kind(), labels[1].given_speed()), (Ok(None), Ok(Some(0.4))));
        let wrong = RecordingLabel { kind: "loud".into(), speed: "-1".into(), ..labels[0].clone() };
        assert!(wrong.given_kind().unwrap_err().contains("`kind`: \"loud\""));
        assert!(wrong.given_speed().unwrap_err().contains("`speed`: \"-1\""));
    }

    #[test]
    fn the_nearest_tags_are_those_that_share_the_most_words() {
        let sets = [vec!["stone".to_owned(), "scrape".into()], vec!["wood".into(), "scrape".into()]];
        let find = |wanted: &str| matching_tags(wanted, sets.iter().map(Vec::as_slice));
        assert_eq!(find("wood scrape"), (vec![1], true));
        assert_eq!(find("scrape"), (vec![0, 1], true));
        assert_eq!(find("stone roll"), (vec![0], false));
        assert_eq!(find(""), (vec![0, 1], true));
        assert_eq!(find("glass"), (vec![], false));
    }
}
