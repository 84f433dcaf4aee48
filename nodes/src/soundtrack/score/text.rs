//! Scores as files that people edit.

use super::curve::WeightCurve;
use super::model::{MAX_TARGETS, Outside, ScoreSource, ScoreTarget, SoundScore};
use crate::artefact::text::{
    Location, RawValue, RecordWriter, Seconds, TextError, TextWriter, Version, quote, read, records, within,
};
use crate::artefact::value_file::Artefact;
use crate::core::node::Summary;
use serde::{Deserialize, Deserializer};
use std::collections::HashMap;

/// Version of the format.
const VERSION: u32 = 1;
/// Maximum number of mistakes that are reported at once.
const MAX_ERRORS: usize = 20;
/// Shortest interval of a recording, s.
const SHORTEST: f64 = 1e-5;

#[derive(Deserialize)]
#[serde(rename = "SoundScore", deny_unknown_fields)]
struct FileText<'a> {
    #[serde(default, rename = "version")]
    _version: Option<Version<1, VERSION>>,
    #[serde(default)]
    duration: Option<Seconds>,
    #[serde(default)]
    pad: Option<Seconds>,
    #[serde(borrow)]
    sources: Vec<&'a RawValue>,
    #[serde(borrow)]
    targets: Vec<&'a RawValue>,
}

#[derive(Deserialize)]
#[serde(rename = "Source", deny_unknown_fields)]
struct SourceText {
    name: String,
    #[serde(default)]
    recording: Option<String>,
    segments: Vec<(Seconds, Seconds)>,
    #[serde(default)]
    outside: Option<Outside>,
}

#[derive(Deserialize)]
#[serde(rename = "Target", deny_unknown_fields)]
struct TargetText {
    #[serde(default)]
    source: Option<String>,
    #[serde(default)]
    sources: Option<Vec<String>>,
    #[serde(default)]
    from: Option<Seconds>,
    #[serde(default)]
    to: Option<Seconds>,
    #[serde(default)]
    weight: Option<Weight>,
    #[serde(default)]
    curve: Option<Vec<(Seconds, Weight)>>,
}

struct Weight(f64);

impl<'de> Deserialize<'de> for Weight {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        within(from, -1.0, 1.0).map(Self)
    }
}

fn source(
    location: Location,
    text: SourceText,
    earlier: &HashMap<String, usize>,
) -> Result<ScoreSource, TextError> {
    let wrong = |message: String| Err(TextError::new(location, message));
    let name = text.name;
    if name.trim().is_empty() {
        return wrong("`name` is empty; targets name a sound by it".into());
    }
    if earlier.contains_key(&name) {
        return wrong(format!("there are two sounds {name:?}; give each a name of its own"));
    }
    if text.segments.is_empty() {
        return wrong(format!(
            "{name:?} has no segment; give start and end in the recording, as in [(3.2, 4.05)]"
        ));
    }
    let segments: Vec<(f64, f64)> = text.segments.iter().map(|(from, to)| (from.0, to.0)).collect();
    if let Some((from, to)) = segments.iter().find(|(from, to)| to - from < SHORTEST) {
        return wrong(format!("{name:?} has the segment ({from}, {to}); its end must be after its start"));
    }
    Ok(ScoreSource {
        name,
        recording: text.recording,
        segments,
        outside: text.outside.unwrap_or(Outside::None),
        location,
    })
}

fn curve(text: &TargetText) -> Result<WeightCurve, String> {
    let (from, to) = (text.from.map(|s| s.0), text.to.map(|s| s.0));
    let Some(points) = &text.curve else {
        let (Some(from), Some(to)) = (from, to) else {
            return Err("give `from` and `to` in s, or a `curve` of times and weights".into());
        };
        if to <= from {
            return Err(format!("it is from {from} s to {to} s; its end must be after its start"));
        }
        return Ok(WeightCurve::constant(from, to, text.weight.as_ref().map_or(1.0, |w| w.0)));
    };
    if text.weight.is_some() {
        return Err("there are `weight` and `curve`; give one of them".into());
    }
    let points: Vec<(f64, f64)> = points.iter().map(|(t, w)| (t.0, w.0)).collect();
    if let Some(pair) = points.windows(2).find(|pair| pair[1].0 < pair[0].0) {
        return Err(format!(
            "the curve goes back from {} s to {} s; times must not decrease",
            pair[0].0, pair[1].0
        ));
    }
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return Err("the curve has no point".into());
    };
    if last.0 <= first.0 {
        return Err(format!("the curve has the length 0, at {} s; give it points at two times", first.0));
    }
    let wrong = |field, given: f64, found: f64| {
        Err(format!(
            "`{field}` is {given} s, and the curve has {found} s there; leave `{field}` out, or draw the curve to it"
        ))
    };
    match (from, to) {
        (Some(from), _) if from != first.0 => wrong("from", from, first.0),
        (_, Some(to)) if to != last.0 => wrong("to", to, last.0),
        _ => Ok(WeightCurve { points }),
    }
}

/// `index` has the sounds by name, `sources` in order.
fn target(
    location: Location,
    text: &TargetText,
    index: &HashMap<String, usize>,
    sources: &[ScoreSource],
) -> Result<ScoreTarget, TextError> {
    let wrong = |message: String| TextError::new(location, message);
    let names = match (&text.source, &text.sources) {
        (Some(name), None) => std::slice::from_ref(name),
        (None, Some(names)) if !names.is_empty() => names.as_slice(),
        _ => return Err(wrong("give `source: \"NAME\"`, or `sources: [\"NAME\", \"NAME\"]`".into())),
    };
    let find = |name: &String| {
        index.get(name).copied().ok_or_else(|| {
            let known: Vec<&str> = sources.iter().map(|s| s.name.as_str()).take(MAX_ERRORS).collect();
            wrong(format!("there is no sound {name:?}; sounds are {}", known.join(", ")))
        })
    };
    let mut found = names.iter().map(find).collect::<Result<Vec<usize>, _>>()?;
    found.sort_unstable();
    found.dedup();
    Ok(ScoreTarget { sources: found, curve: curve(text).map_err(wrong)?, location })
}

/// Reads a score.
///
/// # Errors
/// Line, column, the value found and what is needed, for every sound, or else every target, that is invalid.
///
/// # Example
/// ```
/// let text = r#"SoundScore(
///     sources: [(name: "boom", segments: [(3.2, 4.05), (9.1, 9.8)])],
///     targets: [(source: "boom", curve: [(5.0, 0.0), (5.1, 1.0), (5.9, 1.0), (6.0, 0.0)])],
/// )"#;
/// let score = foley_nodes::soundtrack::score::read_score(text)?;
/// assert_eq!((score.sources[0].segments.len(), score.targets[0].curve.points.len()), (2, 4));
/// # Ok::<(), foley_nodes::artefact::text::TextError>(())
/// ```
pub fn read_score(text: &str) -> Result<SoundScore, TextError> {
    let file: FileText<'_> = read(text)?;
    let count = file.sources.len().max(file.targets.len());
    if count > MAX_TARGETS {
        let message = format!("{count} records in a list; at most {MAX_TARGETS} are read");
        return Err(TextError::new(Location { line: 1, column: 1 }, message));
    }
    let join = |errors| TextError::join(errors, MAX_ERRORS).unwrap_or_default();
    let (mut sources, mut errors) = (Vec::new(), Vec::new());
    let mut index = HashMap::new();
    for (location, text) in records::<SourceText>(text, &file.sources).map_err(join)? {
        match source(location, text, &index) {
            Ok(source) => {
                index.insert(source.name.clone(), sources.len());
                sources.push(source);
            }
            Err(e) => errors.push(e),
        }
    }
    if !errors.is_empty() {
        return Err(join(errors));
    }
    let mut targets = Vec::new();
    for (location, text) in records::<TargetText>(text, &file.targets).map_err(join)? {
        match target(location, &text, &index, &sources) {
            Ok(target) => targets.push(target),
            Err(e) => errors.push(e),
        }
    }
    if !errors.is_empty() {
        return Err(join(errors));
    }
    Ok(SoundScore {
        file: String::new(),
        duration: file.duration.map(|d| d.0),
        sources,
        targets,
        pad: file.pad.map(|pad| pad.0),
    })
}

/// Writes a score as [`read_score`] reads it, one sound and one target a line, below lines of comments.
#[must_use]
pub fn write_score(score: &SoundScore, comments: &[&str]) -> String {
    let mut file = TextWriter::new(comments, "SoundScore", VERSION);
    for (name, value) in [("duration", score.duration), ("pad", score.pad)] {
        if let Some(value) = value {
            file.field(name, format!("{value:?}"));
        }
    }
    let pairs = |pairs: &[(f64, f64)]| {
        let all: Vec<String> = pairs.iter().map(|(a, b)| format!("({a:?}, {b:?})")).collect();
        format!("[{}]", all.join(", "))
    };
    file.list(
        "sources",
        score.sources.iter().map(|source| {
            RecordWriter::default()
                .field("name", Some(quote(&source.name)))
                .field("recording", source.recording.as_deref().map(quote))
                .field("segments", Some(pairs(&source.segments)))
                .field("outside", (source.outside != Outside::None).then(|| format!("{:?}", source.outside)))
        }),
    );
    file.list(
        "targets",
        score.targets.iter().map(|target| {
            let names: Vec<String> =
                target.sources.iter().filter_map(|k| score.sources.get(*k)).map(|s| quote(&s.name)).collect();
            let record = match names.as_slice() {
                [one] => RecordWriter::default().field("source", Some(one)),
                all => RecordWriter::default().field("sources", Some(format!("[{}]", all.join(", ")))),
            };
            match target.curve.points.as_slice() {
                [(from, a), (to, b)] if a == b => record
                    .field("from", Some(format!("{from:?}")))
                    .field("to", Some(format!("{to:?}")))
                    .field("weight", (*a != 1.0).then(|| format!("{a:?}"))),
                points => record.field("curve", Some(pairs(points))),
            }
        }),
    );
    file.finish()
}

impl Artefact for SoundScore {
    const CODE: &'static str = "F156";

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        let text = crate::artefact::text::decode(bytes).map_err(|e| e.to_string())?;
        read_score(text).map_err(|e| e.to_string())
    }

    fn summary(&self) -> Summary {
        vec![("sounds", self.sources.len().into()), ("targets", self.targets.len().into())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;

    const SOUNDS: &str = "SoundScore(\n  sources: [\n    (name: \"a\", segments: [(0, 1)]),\n    (name: \"b\", segments: [(1, 2)]),\n  ],\n  targets: [\n";

    #[test]
    fn what_is_written_is_read_again() {
        let mut score = SoundScore::trial(&mut Rng::new(3));
        score.targets[1].curve =
            WeightCurve { points: vec![(0.0, -1.0), (0.25, 1.0), (0.5, 1.0), (0.5, 0.0)] };
        score.targets[2].sources = vec![0, 1];
        score.targets[0].curve = WeightCurve::constant(0.0, 0.1, 1.0);
        score.sources[1].recording = Some("gun \"1\".wav".into());
        score.sources[0].outside = Outside::Exclude;
        (score.duration, score.pad) = (Some(3.5), Some(0.0));
        let text = write_score(&score, &["Made by a test."]);
        let mut found = read_score(&text).unwrap();
        found.sources.iter_mut().for_each(|s| s.location = Location::default());
        found.targets.iter_mut().for_each(|t| t.location = Location::default());
        assert_eq!(found, score, "{text}");
    }

    #[test]
    fn every_mistake_has_line_and_column() {
        for (target, location, part) in [
            ("(source: \"c\", from: 0, to: 1)", "7:1", "no sound \"c\"; sounds are a, b"),
            ("(source: \"a\", from: 1, to: 1)", "7:1", "end must be after its start"),
            ("(source: \"a\", from: 0, to: 1, weight: 1.5)", "7:39", "found 1.5; a number from -1 to 1"),
            ("(source: \"a\", from: -1, to: 1)", "7:21", "found -1"),
            ("(source: \"a\")", "7:1", "`from` and `to`"),
            ("(from: 0, to: 1)", "7:1", "give `source"),
            ("(sources: [], from: 0, to: 1)", "7:1", "give `source"),
            ("(source: \"a\", curve: [(0, 1), (2, 1), (1, 1)])", "7:1", "back from 2 s to 1 s"),
            ("(source: \"a\", curve: [(1, 1)])", "7:1", "length 0"),
            ("(source: \"a\", curve: [])", "7:1", "no point"),
            ("(source: \"a\", curve: [(0, 1), (1, 2)])", "7:35", "found 2"),
            ("(source: \"a\", from: 0.5, curve: [(0, 1), (1, 1)])", "7:1", "`from` is 0.5 s"),
            ("(source: \"a\", weight: 1, curve: [(0, 1), (1, 1)])", "7:1", "give one of them"),
            ("(source: \"a\", from: 0, until: 1)", "7:24", "no field `until`"),
        ] {
            let e = read_score(&format!("{SOUNDS}{target}\n]\n)")).unwrap_err();
            assert!(e.location.to_string() == location && e.message.contains(part), "{target}: {e}");
        }
        for (source, part) in [
            ("(name: \"\", segments: [(0, 1)])", "`name` is empty"),
            ("(name: \"a\", segments: [])", "no segment"),
            ("(name: \"a\", segments: [(1, 1)])", "end must be after"),
            ("(name: \"a\", segments: [(0, 1)], outside: Include)", "Include"),
        ] {
            let e = read_score(&format!("SoundScore(sources: [{source}], targets: [])")).unwrap_err();
            assert!(e.message.contains(part), "{source}: {e}");
        }
        let twice = "SoundScore(sources: [(name: \"a\", segments: [(0, 1)]),\n(name: \"a\", segments: [(0, 1)])], targets: [])";
        assert_eq!(read_score(twice).unwrap_err().location.to_string(), "2:1");
        let two = format!("{SOUNDS}(source: \"c\", from: 0, to: 1),\n(source: \"a\", from: 2, to: 1)\n]\n)");
        assert!(read_score(&two).unwrap_err().to_string().contains("; 8:1: it is from 2 s"));
    }
}
