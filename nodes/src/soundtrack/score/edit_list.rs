//! Edit lists of a recut picture, and the scores that make its soundtrack follow them.
//!
//! An edit shows an interval of a source at an interval of the picture that results. A score includes the sound of the same interval of
//! the source there, so that a soundtrack of the source becomes one of the new cut.

mod cmx;
mod otio;
mod table;

use super::curve::WeightCurve;
use super::model::{MAX_TARGETS, Outside, ScoreSource, ScoreTarget, SoundScore};
use crate::artefact::text::{Location, TextError, decode};
use std::collections::{HashMap, HashSet};

/// Latest time of a score, s.
const LATEST: f64 = 86_400.0;
/// Shortest interval, s.
const SHORTEST: f64 = 1e-5;
/// Least difference of the lengths of an edit that is a change of speed, s.
const SPEED_CHANGE: f64 = 1e-3;
/// Maximum number of lines that a notice lists.
const MAX_LISTED: usize = 10;

/// An interval of a source, shown at an interval of the new picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edit {
    /// Start and end in the new picture, s.
    pub target: (f64, f64),
    /// Start and end in the source, s.
    pub source: (f64, f64),
    /// Its clip, or its number in the list.
    pub name: String,
    /// The recording, by the end of its path; `None` for the first.
    pub recording: Option<String>,
    /// Its weight from -1 to 1, if the list has one.
    pub weight: Option<f64>,
    /// Line of its file, from 1.
    pub line: u32,
}

/// The edits of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EditList {
    /// The edits, in the order of the file.
    pub edits: Vec<Edit>,
    /// Parts of the file that have no effect, or an unexpected one.
    pub notices: Vec<String>,
}

/// Rules by which edits become a score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EditRules {
    /// Frames per second of the timecodes of a CMX 3600 list.
    pub fps: f64,
    /// Time of a sound in the recording after that of its picture in the source, s.
    pub av_offset: f64,
    /// Time in the list of the first frame of the source, s.
    pub source_start: f64,
    /// Weight of edits without their own, -1 to 1.
    pub weight: f64,
    /// True to let the first edit begin at 0 s.
    pub from_zero: bool,
}

impl Default for EditRules {
    fn default() -> Self {
        Self { fps: 25.0, av_offset: 0.0, source_start: 0.0, weight: 1.0, from_zero: true }
    }
}

/// Lines for a notice: the first ten.
fn listed(lines: &[u32]) -> String {
    let first: Vec<String> = lines.iter().take(MAX_LISTED).map(u32::to_string).collect();
    let more = if lines.len() > MAX_LISTED { ", ..." } else { "" };
    format!("line{} {}{more}", if lines.len() == 1 { "" } else { "s" }, first.join(", "))
}

impl EditList {
    /// Adds a notice about lines, if there are any.
    fn note(&mut self, lines: &[u32], what: &str) {
        if !lines.is_empty() {
            self.notices.push(format!("{}: {what}", listed(lines)));
        }
    }

    /// Leaves out edits without an interval of the source, and reports changes of speed.
    fn finish(mut self) -> Result<Self, TextError> {
        let length = |(from, to): (f64, f64)| to - from;
        let lines = |edits: &[Edit], is_it: &dyn Fn(&Edit) -> bool| -> Vec<u32> {
            edits.iter().filter(|edit| is_it(edit)).map(|edit| edit.line).collect()
        };
        let is_still = |edit: &Edit| length(edit.source) < SHORTEST;
        let still = lines(&self.edits, &is_still);
        self.note(&still, "the source has the length 0, as a freeze frame has, and no sound: left out");
        self.edits.retain(|edit| !is_still(edit));
        let is_changed = |edit: &Edit| (length(edit.source) - length(edit.target)).abs() > SPEED_CHANGE;
        let changed = lines(&self.edits, &is_changed);
        self.note(
            &changed,
            "the picture has another speed than its source; source and target keep their lengths",
        );
        let location = Location { line: self.edits.get(MAX_TARGETS).map_or(1, |edit| edit.line), column: 1 };
        match self.edits.len() {
            0 => Err(TextError::new(location, "the list has no edit; at least one with a length is needed")),
            n if n > MAX_TARGETS => {
                Err(TextError::new(location, format!("{n} edits; at most {MAX_TARGETS} are read")))
            }
            _ => Ok(self),
        }
    }
}

/// Reads an edit list: OpenTimelineIO if the first character is `{`, a table if the first line has the column `target_from`, otherwise
/// CMX 3600. `fps` are the frames per second of CMX timecodes.
///
/// A table is CSV with the columns `target_from`, `target_to`, `source_from`, `source_to` (s) and, optionally, `recording` and `weight`.
/// CMX 3600: the events with picture are read or, if there is none, those with sound; OpenTimelineIO: the first video track or, if
/// there is none, the first track.
///
/// # Errors
/// Line and column, the value found, and what is needed.
///
/// # Example
/// ```
/// use foley_nodes::soundtrack::score::edit_list::read_edits;
///
/// let list = read_edits(b"001 AX V C 01:00:02:00 01:00:04:12 00:00:00:00 00:00:02:12", 25.0)?;
/// assert_eq!((list.edits[0].source, list.edits[0].target), ((3602.0, 3604.48), (0.0, 2.48)));
/// # Ok::<(), foley_nodes::artefact::text::TextError>(())
/// ```
pub fn read_edits(bytes: &[u8], fps: f64) -> Result<EditList, TextError> {
    // Clip names of old lists may have any code page.
    let text = String::from_utf8_lossy(bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let is_empty = |line: &str| line.trim().is_empty() || line.starts_with('#');
    let header = text.lines().find(|line| !is_empty(line)).unwrap_or_default();
    if text.trim_start().starts_with('{') {
        otio::read(decode(bytes)?)?.finish()
    } else if header.contains("target_from") && header.contains(',') {
        table::read(bytes)?.finish()
    } else {
        cmx::read(text, fps)?.finish()
    }
}

/// A source of a score in the coordinates of the recording, and its target.
fn placed(edit: &Edit, rules: &EditRules, origin: f64) -> Result<[(f64, f64); 2], String> {
    let wrong = |message: String| Err(format!("line {}: {message}", edit.line));
    let (from, to) = (edit.source.0 - rules.source_start, edit.source.1 - rules.source_start);
    if from < -SHORTEST {
        return wrong(format!(
            "the source begins at {} s, before the start of the source at {} s; an earlier `source_start` is needed",
            edit.source.0, rules.source_start
        ));
    }
    let source = ((from + rules.av_offset).max(0.0), to + rules.av_offset);
    if source.1 - source.0 < SHORTEST {
        return wrong(format!(
            "with `av_offset` the source ends at {} s of the recording, which begins at 0 s",
            source.1
        ));
    }
    let target = (edit.target.0 - origin, edit.target.1 - origin);
    for (what, (from, to)) in [("source", source), ("target", target)] {
        let is_inside = from >= 0.0 && to <= LATEST;
        if !is_inside || to - from < SHORTEST {
            return wrong(format!(
                "the {what} is from {from} s to {to} s; an interval from 0 s to {LATEST} s that ends after its start is needed"
            ));
        }
    }
    Ok([source, target])
}

/// Converts edits to a score, with a sound for each interval of a source and a target of constant weight for each edit.
///
/// Sounds have the names of their edits, with a number if the name occurs before.
///
/// # Errors
/// Times outside of a day or before the start of the source, and weights outside of -1 to 1. The message has the line of the edit.
///
/// # Example
/// ```
/// use foley_nodes::soundtrack::score::edit_list::{EditRules, edits_to_score, read_edits};
///
/// let table = b"target_from,target_to,source_from,source_to\n2,3,10,11\n3,5,4,6\n";
/// let rules = EditRules { av_offset: 0.5, ..EditRules::default() };
/// let score = edits_to_score(&read_edits(table, rules.fps).unwrap().edits, &rules)?;
/// assert_eq!(score.sources[0].segments, [(10.5, 11.5)]);
/// assert_eq!(score.targets[1].curve.points, [(1.0, 1.0), (3.0, 1.0)]);
/// # Ok::<(), String>(())
/// ```
pub fn edits_to_score(edits: &[Edit], rules: &EditRules) -> Result<SoundScore, String> {
    let first = edits.iter().map(|edit| edit.target.0).min_by(f64::total_cmp).unwrap_or(0.0);
    let origin = if rules.from_zero { first } else { 0.0 };
    let mut score = SoundScore::default();
    let (mut known, mut names) = (HashMap::new(), Names::default());
    let mut duration = 0.0_f64;
    for edit in edits {
        let [segment, (from, to)] = placed(edit, rules, origin)?;
        let weight = edit.weight.unwrap_or(rules.weight);
        if !(-1.0..=1.0).contains(&weight) {
            return Err(format!(
                "line {}: the weight is {weight}; a number from -1 to 1 is needed",
                edit.line
            ));
        }
        let location = Location { line: edit.line, column: 1 };
        let key = (edit.recording.clone(), segment.0.to_bits(), segment.1.to_bits());
        let source = *known.entry(key).or_insert_with(|| {
            score.sources.push(ScoreSource {
                name: names.unique(&edit.name),
                recording: edit.recording.clone(),
                segments: vec![segment],
                outside: Outside::None,
                location,
            });
            score.sources.len() - 1
        });
        let curve = WeightCurve::constant(from, to, weight);
        score.targets.push(ScoreTarget { sources: vec![source], curve, location });
        duration = duration.max(to);
    }
    score.duration = Some(duration);
    Ok(score)
}

/// Names that are each used once.
#[derive(Default)]
struct Names {
    used: HashSet<String>,
    counts: HashMap<String, usize>,
}

impl Names {
    /// The name, with a number from 2 if it is used.
    fn unique(&mut self, name: &str) -> String {
        let name = if name.trim().is_empty() { "edit" } else { name.trim() };
        let count = self.counts.entry(name.to_owned()).or_insert(0);
        loop {
            *count += 1;
            let free = if *count == 1 { name.to_owned() } else { format!("{name} {count}") };
            if self.used.insert(free.clone()) {
                return free;
            }
        }
    }
}

#[cfg(test)]
mod tests;
