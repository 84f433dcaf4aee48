//! Edit lists as timelines of OpenTimelineIO.
//!
//! # Source
//! OpenTimelineIO, "Serialized Data Documentation" and "Timeline Structure" (Academy Software Foundation).

use super::{Edit, EditList};
use crate::artefact::text::{Location, TextError};
use crate::core::files::excerpt;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// The fields of all objects that are read.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Object {
    #[serde(rename = "OTIO_SCHEMA")]
    schema: Option<String>,
    name: Option<String>,
    kind: Option<String>,
    enabled: Option<bool>,
    tracks: Option<Box<Object>>,
    children: Option<Vec<Object>>,
    source_range: Option<TimeRange>,
    effects: Option<Vec<Object>>,
    media_reference: Option<Media>,
    media_references: Option<BTreeMap<String, Option<Media>>>,
    active_media_reference_key: Option<String>,
}

/// The file of a clip.
#[derive(Clone, Default, Deserialize)]
#[serde(default)]
struct Media {
    target_url: Option<String>,
    available_range: Option<TimeRange>,
}

#[derive(Clone, Copy, Deserialize)]
struct TimeRange {
    start_time: RationalTime,
    duration: RationalTime,
}

#[derive(Clone, Copy, Deserialize)]
struct RationalTime {
    value: f64,
    rate: f64,
}

impl RationalTime {
    fn seconds(self) -> Option<f64> {
        let seconds = self.value / self.rate;
        (self.rate > 0.0 && seconds.is_finite()).then_some(seconds)
    }
}

impl Object {
    /// The schema without its version, such as `Clip`.
    fn kind_of(&self) -> &str {
        let schema = self.schema.as_deref().unwrap_or_default();
        schema.split_once('.').map_or(schema, |(name, _)| name)
    }

    fn media(&self) -> Option<Media> {
        let key = self.active_media_reference_key.as_deref().unwrap_or("DEFAULT_MEDIA");
        let active = self.media_references.as_ref().and_then(|all| all.get(key).cloned().flatten());
        active.or_else(|| self.media_reference.clone())
    }

    /// Start and length in the source, s.
    fn range(&self) -> Result<(f64, f64), String> {
        let range = self.source_range.or_else(|| self.media()?.available_range).ok_or_else(|| {
            "there is neither a source_range nor an available_range; one of them is needed".to_owned()
        })?;
        let start = range.start_time.seconds();
        let (Some(start), Some(duration)) = (start, range.duration.seconds().filter(|x| *x >= 0.0)) else {
            let [a, b] = [range.start_time, range.duration].map(|t| format!("{}/{}", t.value, t.rate));
            return Err(format!(
                "the range starts at {a} and has the duration {b}; rates above 0 and a duration from 0 are needed"
            ));
        };
        Ok((start, duration))
    }
}

/// A container of a JSON text that is being read.
struct Level<'a> {
    key: &'a str,
    index: usize,
}

/// The locations of the items of a track, in order. The text must be JSON.
fn item_locations(text: &str, track: usize) -> Vec<Location> {
    let mut levels: Vec<Level<'_>> = Vec::new();
    let mut found = Vec::new();
    let (mut word, mut string_from, mut is_escaped) = ("", None, false);
    let (mut line, mut line_from) = (1, 0);
    for (k, byte) in text.bytes().enumerate() {
        if let Some(from) = string_from {
            if !is_escaped && byte == b'"' {
                word = text.get(from..k).unwrap_or_default();
                string_from = None;
            }
            is_escaped = byte == b'\\' && !is_escaped;
            continue;
        }
        match byte {
            b'"' => string_from = Some(k + 1),
            b'\n' => (line, line_from) = (line + 1, k + 1),
            b':' => levels.last_mut().into_iter().for_each(|level| level.key = word),
            b',' => levels.last_mut().into_iter().for_each(|level| level.index += 1),
            b'{' | b'[' => {
                if let [a, b, c, d, _] = levels.as_slice()
                    && [a.key, b.key, d.key] == ["tracks", "children", "children"]
                    && c.index == track
                {
                    let before = text.get(line_from..k).unwrap_or_default();
                    found.push(Location { line, column: 1 + before.chars().count() as u32 });
                }
                levels.push(Level { key: "", index: 0 });
            }
            b'}' | b']' => drop(levels.pop()),
            _ => {}
        }
    }
    found
}

/// The track that is read, with its index: the first of video, or else the first.
fn track(timeline: &Object) -> Result<(usize, &Object), String> {
    if timeline.kind_of() != "Timeline" {
        let found = excerpt(timeline.schema.as_deref().unwrap_or("no OTIO_SCHEMA"));
        return Err(format!("found {found:?}; a file with one Timeline.1 is needed"));
    }
    let children = timeline.tracks.as_ref().and_then(|stack| stack.children.as_deref()).unwrap_or_default();
    let mut tracks = children.iter().enumerate().filter(|(_, child)| child.kind_of() == "Track");
    let is_video =
        |track: &Object| track.kind.as_deref().is_some_and(|kind| kind.eq_ignore_ascii_case("video"));
    let video = tracks.clone().find(|(_, track)| is_video(track));
    video
        .or_else(|| tracks.next())
        .ok_or_else(|| "the timeline has no Track.1 in `tracks`; one is needed".into())
}

/// Reads a timeline.
pub(super) fn read(text: &str) -> Result<EditList, TextError> {
    let start = Location { line: 1, column: 1 };
    let timeline: Object = serde_json::from_str(text).map_err(|e| {
        let location = Location { line: e.line() as u32, column: e.column() as u32 };
        let message = e.to_string();
        let message = message.split_once(" at line ").map_or(message.as_str(), |(message, _)| message);
        TextError::new(location, format!("{message}; JSON of OpenTimelineIO is needed"))
    })?;
    let (index, track) = track(&timeline).map_err(|message| TextError::new(start, message))?;
    if track.source_range.is_some() {
        let message =
            format!("track {index} has a source_range; clips with their own and a track without are needed");
        return Err(TextError::new(start, message));
    }
    let locations = item_locations(text, index);
    let mut list = EditList::default();
    let (mut transitions, mut effects, mut media) = (Vec::new(), Vec::new(), BTreeSet::new());
    let mut at = 0.0;
    for (k, item) in track.children.iter().flatten().enumerate() {
        let location = locations.get(k).copied().unwrap_or(start);
        let wrong = |message: String| {
            TextError::new(location, format!("tracks.children[{index}].children[{k}]: {message}"))
        };
        match item.kind_of() {
            "Transition" => {
                transitions.push(location.line);
                continue;
            }
            "Clip" | "Gap" => {}
            "Stack" | "Track" => {
                return Err(wrong(
                    "found a nested stack or track; clips are needed: flatten the timeline first".into(),
                ));
            }
            other => {
                return Err(wrong(format!("found {:?}; Clip, Gap or Transition is needed", excerpt(other))));
            }
        }
        let (from, duration) = item.range().map_err(wrong)?;
        let target = (at, at + duration);
        at = target.1;
        if item.kind_of() == "Gap" || item.enabled == Some(false) || duration == 0.0 {
            continue;
        }
        if item.effects.iter().flatten().any(|e| e.kind_of().contains("Time") || e.kind_of() == "FreezeFrame")
        {
            effects.push(location.line);
        }
        media.extend(item.media().and_then(|media| media.target_url));
        let name = item.name.clone().filter(|name| !name.trim().is_empty());
        list.edits.push(Edit {
            target,
            source: (from, from + duration),
            name: name.unwrap_or_else(|| format!("edit {:03}", list.edits.len() + 1)),
            recording: None,
            weight: None,
            line: location.line,
        });
    }
    list.note(&transitions, "a transition is read as the cut in its middle");
    list.note(&effects, "a change of speed is ignored");
    let stack = timeline.tracks.iter().flat_map(|stack| stack.children.iter().flatten());
    let tracks = stack.filter(|child| child.kind_of() == "Track").count();
    if tracks > 1 {
        let name = track.name.as_deref().unwrap_or_default();
        list.notices.push(format!("of {tracks} tracks the one at {index}, {name:?}, is read"));
    }
    if media.len() > 1 {
        list.notices.push(format!("{} media files are read as times of the first recording", media.len()));
    }
    Ok(list)
}
