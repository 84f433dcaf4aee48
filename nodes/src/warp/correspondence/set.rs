//! Marked moments of a target and of a database that should sound alike.

use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;

use crate::artefact::text::{
    Duration, Location, RawValue, RecordWriter, Seconds, TextError, TextWriter, Version, quote, read,
    records, within,
};
use crate::core::item::Data;
use crate::core::random::Rng;

/// Maximum number of correspondences of one file.
pub const MAX_CORRESPONDENCES: usize = 10_000;
/// Format of a file of correspondences that this code reads and writes.
pub const CORRESPONDENCES_VERSION: u32 = 1;
/// Maximum number of mistakes that are reported at once.
const MAX_ERRORS: usize = 20;

/// Name of a recording of a database.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SourceName {
    /// By its number, from 0.
    Index(u32),
    /// By its provenance in the database: its path, unless another one was set.
    Provenance(String),
}

/// A stretch of the target and one of the database that should sound alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correspondence {
    /// Label for users.
    pub label: String,
    /// Start in the target, s.
    pub target: f64,
    /// Start in the database, s: inside of `source`, or without one of the units put one after the other.
    pub database: f64,
    /// Recording that `database` is counted in.
    pub source: Option<SourceName>,
    /// Length of both, s.
    pub duration: f64,
    /// Channel that it is for; all if it is `None`.
    pub channel: Option<u32>,
    /// Weight in the fit.
    pub weight: f64,
    /// False to ignore it.
    pub enabled: bool,
    /// Location in its file.
    #[serde(rename = "place")]
    pub location: Location,
}

/// Correspondences with their file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CorrespondenceSet {
    /// Path of the file, for messages.
    pub file: String,
    /// The render that the times of targets are of, for people.
    pub target: String,
    /// Its length, s, if the file states it: it identifies the target.
    pub length: Option<f64>,
    /// The database, by the file names of its recordings as
    /// [`UnitDatabase::recordings`](crate::unit::UnitDatabase::recordings) returns them; empty if the file does not
    /// state them.
    pub database: String,
    /// All correspondences, also the disabled ones.
    pub pairs: Vec<Correspondence>,
}

impl CorrespondenceSet {
    /// Digest of its content, independent of the name and the layout of the file.
    #[must_use]
    pub fn content(&self) -> String {
        blake3::hash(write_correspondences(self, &[]).as_bytes()).to_hex()[..16].to_owned()
    }
}

impl Correspondence {
    /// Returns its name for messages: number, label and time.
    #[must_use]
    pub fn name(&self, index: usize) -> String {
        if self.label.is_empty() {
            format!("correspondence {index}")
        } else {
            format!("correspondence {index} ({:?})", self.label)
        }
    }
}

/// The fields of a file, in the order in which they are written.
#[derive(Deserialize)]
#[serde(rename = "Correspondences", deny_unknown_fields)]
struct FileText<'a> {
    #[serde(default, rename = "version")]
    _version: Option<Version<1, CORRESPONDENCES_VERSION>>,
    #[serde(default)]
    target: Option<String>,
    #[serde(default)]
    length: Option<Seconds>,
    #[serde(default)]
    database: Option<String>,
    #[serde(borrow)]
    pairs: Vec<&'a RawValue>,
}

/// The fields of one correspondence.
#[derive(Deserialize)]
#[serde(rename = "Correspondence", deny_unknown_fields)]
struct PairText {
    target: Seconds,
    database: Seconds,
    #[serde(default)]
    source: Option<SourceText>,
    duration: Duration,
    #[serde(default)]
    channel: Option<u32>,
    #[serde(default)]
    label: Option<String>,
    #[serde(default)]
    weight: Option<Weight>,
    #[serde(default)]
    enabled: Option<bool>,
}

struct Weight(f64);

impl<'de> Deserialize<'de> for Weight {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        within(from, 1e-6, 1e6).map(Self)
    }
}

/// A recording as people write it: its number, or a text.
struct SourceText(SourceName);

impl<'de> Deserialize<'de> for SourceText {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Visit;

        impl Visitor<'_> for Visit {
            type Value = SourceName;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number from 0 on, or a text in quotes")
            }

            fn visit_u64<E: Error>(self, index: u64) -> Result<SourceName, E> {
                let index =
                    u32::try_from(index).map_err(|_| E::invalid_value(Unexpected::Unsigned(index), &self));
                index.map(SourceName::Index)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<SourceName, E> {
                Ok(SourceName::Provenance(text.to_owned()))
            }
        }

        from.deserialize_any(Visit).map(Self)
    }
}

impl PairText {
    fn at(self, location: Location) -> Correspondence {
        Correspondence {
            label: self.label.unwrap_or_default(),
            target: self.target.0,
            database: self.database.0,
            source: self.source.map(|source| source.0),
            duration: self.duration.0,
            channel: self.channel,
            weight: self.weight.map_or(1.0, |weight| weight.0),
            enabled: self.enabled.unwrap_or(true),
            location,
        }
    }
}

/// Reads correspondences.
///
/// # Errors
/// Line, column, the value found and what is needed, for every correspondence that is invalid.
///
/// # Example
/// ```
/// let text = r#"Correspondences(pairs: [
///     (label: "slow drag", target: 1.25, source: 0, database: 3.4, duration: 0.1),
///     (target: 2.0, database: 12.5, duration: 0.2, weight: 2.0, enabled: false),
/// ])"#;
/// let set = foley_nodes::warp::read_correspondences(text)?;
/// assert_eq!((set.pairs.len(), set.pairs[0].label.as_str()), (2, "slow drag"));
/// # Ok::<(), foley_nodes::warp::TextError>(())
/// ```
pub fn read_correspondences(text: &str) -> Result<CorrespondenceSet, TextError> {
    let file: FileText<'_> = read(text)?;
    if file.pairs.len() > MAX_CORRESPONDENCES {
        let message = format!("{} correspondences; at most {MAX_CORRESPONDENCES} are read", file.pairs.len());
        return Err(TextError::new(Location { line: 1, column: 1 }, message));
    }
    let pairs = records::<PairText>(text, &file.pairs)
        .map_err(|errors| TextError::join(errors, MAX_ERRORS).unwrap_or_default())?;
    Ok(CorrespondenceSet {
        file: String::new(),
        target: file.target.unwrap_or_default(),
        length: file.length.map(|length| length.0),
        database: file.database.unwrap_or_default(),
        pairs: pairs.into_iter().map(|(location, pair)| pair.at(location)).collect(),
    })
}

/// Writes correspondences as [`read_correspondences`] reads them, one a line, below lines of comments.
#[must_use]
pub fn write_correspondences(set: &CorrespondenceSet, comments: &[&str]) -> String {
    let mut file = TextWriter::new(comments, "Correspondences", CORRESPONDENCES_VERSION);
    let text = |text: &str| (!text.is_empty()).then(|| quote(text));
    let head = [
        ("target", text(&set.target)),
        ("length", set.length.map(|length| format!("{length:?}"))),
        ("database", text(&set.database)),
    ];
    for (name, value) in head {
        if let Some(value) = value {
            file.field(name, value);
        }
    }
    let number = |x: f64| Some(format!("{x:?}"));
    let record = |c: &Correspondence| {
        let source = c.source.as_ref().map(|source| match source {
            SourceName::Index(k) => k.to_string(),
            SourceName::Provenance(path) => quote(path),
        });
        RecordWriter::default()
            .field("label", text(&c.label))
            .field("target", number(c.target))
            .field("source", source)
            .field("database", number(c.database))
            .field("duration", number(c.duration))
            .field("channel", c.channel)
            .field("weight", number(c.weight).filter(|_| c.weight != 1.0))
            .field("enabled", (!c.enabled).then_some(false))
    };
    file.list("pairs", set.pairs.iter().map(record));
    file.finish()
}

impl Data for CorrespondenceSet {
    const NAME: &'static str = "correspondences";

    fn trial(rng: &mut Rng) -> Self {
        // Short times, most of which fit the targets and databases of trials.
        let pair = |rng: &mut Rng| Correspondence {
            label: String::new(),
            target: rng.between(0.0, 0.004),
            database: rng.between(0.0, 0.004),
            source: None,
            duration: rng.between(0.001, 0.003),
            channel: None,
            weight: rng.between(0.5, 2.0),
            enabled: rng.below(4) > 0,
            location: Location::default(),
        };
        let pairs = (0..rng.below(4)).map(|_| pair(rng)).collect();
        Self { pairs, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let mut rng = Rng::new(4);
        for _ in 0..20 {
            let mut set = CorrespondenceSet::trial(&mut rng);
            set.target = "render \"7\"".into();
            set.length = Some(7.6);
            for (k, c) in set.pairs.iter_mut().enumerate() {
                c.source = [None, Some(SourceName::Index(3)), Some(SourceName::Provenance("a\\b".into()))]
                    [k % 3]
                    .clone();
                c.channel = [None, Some(1)][k % 2];
                c.label = ["", "two\nlines"][k % 2].into();
            }
            let text = write_correspondences(&set, &["Marked by ear.", "Times in s."]);
            assert!(text.starts_with("// Marked by ear.\n// Times in s.\nCorrespondences("), "{text}");
            let mut found = read_correspondences(&text).unwrap();
            found.pairs.iter_mut().for_each(|c| c.location = Location::default());
            assert_eq!(found, set, "{text}");
        }
    }

    #[test]
    fn a_set_is_identified_by_its_content_and_not_by_its_layout() {
        let text = "(pairs: [(label: \"drag\", target: 1, database: 2, duration: 0.1)])";
        let set = CorrespondenceSet { file: "a.ron".into(), ..read_correspondences(text).unwrap() };
        let spread = "// Marked by ear.\nCorrespondences(version: 1, pairs: [\n    (target: 1.0, database: 2.0, duration: 0.10, label: \"drag\", \
                      weight: 1, enabled: true),\n])";
        let other = CorrespondenceSet { file: "b.ron".into(), ..read_correspondences(spread).unwrap() };
        assert!(set.content().len() == 16 && set.content() == other.content());
        for (from, to) in
            [("1,", "1.001,"), ("0.1", "0.1, weight: 2"), ("0.1", "0.1, enabled: false"), ("drag", "drop")]
        {
            let changed = read_correspondences(&text.replacen(from, to, 1)).unwrap();
            assert_ne!(set.content(), changed.content(), "{to}");
        }
    }

    #[test]
    fn errors_say_line_and_column() {
        for (text, location, part) in [
            ("(pairs: [\n(target: 1, duration: 0.1)])", "2:1", "`database` is missing"),
            ("(pairs: [(target: -1, database: 1, duration: 0.1)])", "1:19", "found -1; a number from 0 to"),
            (
                "(pairs: [(target: 1, database: 1, duration: 0)])",
                "1:45",
                "found 0; a number from 0.000001 to",
            ),
            ("(pairs: [(target: 1, database: 1, duration: 1, source: 1.5)])", "1:56", "whole number"),
            ("(pairs: [(target: 1, database: 1, duration: 1, enabled: 1)])", "1:57", "xpected boolean"),
            ("(pairs: [(target: 1, database: 1, duration: 1, gain: 1)])", "1:48", "no field `gain`"),
            ("(target: \"a\")", "1:1", "`pairs` is missing"),
            ("(length: \"a\", pairs: [])", "1:10", "xpected float"),
            ("(version: 2, pairs: [])", "1:11", "has version 2; this reads version 1"),
            // All that are wrong.
            (
                "(pairs: [(database: 1, duration: 1),\n(target: 1, database: 1, duration: 1),\n(target: 1, duration: 1)])",
                "1:10",
                "`target` is missing; 3:1: `database` is missing",
            ),
        ] {
            let e = read_correspondences(text).unwrap_err();
            assert!(e.location.to_string() == location && e.message.contains(part), "{text}: {e}");
        }
    }
}
