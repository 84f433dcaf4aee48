//! Edit lists in the format CMX 3600.
//!
//! # Source
//! SMPTE ST 258:2004, "Transfer of Edit Decision Lists"; SMPTE ST 12-1, drop-frame timecode.

use super::{Edit, EditList};
use crate::artefact::text::{Location, TextError};
use crate::core::files::excerpt;
use std::collections::BTreeSet;

/// Frames per second that have a variant at 1000/1001 of their value.
const FILM_RATES: [f64; 5] = [24.0, 30.0, 48.0, 60.0, 120.0];
/// Largest difference of a rate that is rounded to two digits, Hz.
const ROUNDING: f64 = 0.005;
/// An event, for messages.
const EXAMPLE: &str =
    "an event such as `001 AX V C 00:00:01:00 00:00:02:00 00:00:00:00 00:00:01:00` is needed";
/// First words of lines that contain no picture times.
const IGNORED: [&str; 12] = [
    "TITLE:", "SPLIT:", "AUD", "REEL:", "REEL", "EFFECTS", "FINAL", "BLEND,", "CONTROL", "KEY", "MOTION",
    "SOURCE",
];

/// A rate of timecodes.
struct Timebase {
    /// Frames per second of the picture.
    rate: f64,
    /// Frames that a second of timecode counts.
    count: u32,
    /// True if timecodes may drop frames: at 1000/1001 of 30 or 60 frames per second.
    may_drop: bool,
}

impl Timebase {
    /// The rate for a number with two digits, such as 23.98 for 24000/1001.
    fn new(fps: f64) -> Self {
        let film = FILM_RATES.iter().map(|rate| rate / 1.001).find(|rate| (fps - rate).abs() < ROUNDING);
        let rate = film.unwrap_or(fps);
        let count = rate.round().max(1.0) as u32;
        Self { rate, count, may_drop: film.is_some() && [30, 60].contains(&count) }
    }

    /// The rate for messages.
    fn rounded(&self) -> f64 {
        (self.rate * 1000.0).round() / 1000.0
    }

    /// The time of a timecode, s, or a description of its error.
    fn seconds(&self, text: &str, drop: bool) -> Result<f64, String> {
        let fields: Vec<&str> = text.split([':', ';', '.', ',']).collect();
        let number = |field: &&str, end: u32| field.parse::<u32>().ok().filter(|x| *x < end);
        let numbers = match fields.as_slice() {
            [h, m, s, f] => number(h, 24).zip(number(m, 60)).zip(number(s, 60)).zip(number(f, self.count)),
            _ => None,
        };
        let Some((((hours, minutes), seconds), frames)) = numbers else {
            let last = self.count - 1;
            return Err(format!(
                "{:?}; a timecode from 00:00:00:00 to 23:59:59:{last:02} is needed, at {} frames per second",
                excerpt(text),
                self.rounded()
            ));
        };
        let minutes = 60 * hours + minutes;
        let mut index = (60 * minutes + seconds) * self.count + frames;
        if drop {
            if !self.may_drop {
                return Err(format!(
                    "{text:?} is drop-frame timecode at {} frames per second; `fps` of 29.97 or 59.94 is needed",
                    self.rounded()
                ));
            }
            // Each minute but every tenth leaves out the first two of 30 numbers, or four of 60.
            let dropped = self.count / 15;
            if seconds == 0 && frames < dropped && !minutes.is_multiple_of(10) {
                return Err(format!("{text:?}; drop-frame timecode leaves this number out"));
            }
            index -= dropped * (minutes - minutes / 10);
        }
        Ok(f64::from(index) / self.rate)
    }
}

/// Words of a line with their columns, from 1.
fn words(line: &str) -> Vec<(u32, &str)> {
    let column = |word: &str| {
        // A word is part of the line, since it is borrowed from it.
        let offset = (word.as_ptr() as usize).saturating_sub(line.as_ptr() as usize);
        1 + line.get(..offset).unwrap_or_default().chars().count() as u32
    };
    line.split_whitespace().map(|word| (column(word), word)).collect()
}

/// An event of a list.
struct Event {
    edit: Edit,
    reel: String,
    has_picture: bool,
    is_cut: bool,
    /// True if its name is that of the incoming clip of a dissolve.
    is_incoming: bool,
}

fn is_number(word: &str) -> bool {
    !word.is_empty() && word.len() <= 9 && word.bytes().all(|b| b.is_ascii_digit())
}

/// Reads an event; `None` if it shows nothing: black, or an event of the length 0, which a dissolve begins with.
fn event(number: u32, line: &str, base: &Timebase, is_drop: bool) -> Result<Option<Event>, TextError> {
    let wrong = |column: u32, message: String| TextError::new(Location { line: number, column }, message);
    let words = words(line);
    let (head, times) = words.split_at(words.len().saturating_sub(4));
    let [(_, index), (_, reel), (_, channels), (column, transition), middle @ ..] = head else {
        return Err(wrong(1, format!("found {:?}; {EXAMPLE}", excerpt(line.trim()))));
    };
    let kind = transition.to_ascii_uppercase();
    let is_wipe = kind.strip_prefix('W').is_some_and(is_number);
    if !is_wipe && !["C", "D", "K", "KB", "KO"].contains(&kind.as_str()) {
        let found = excerpt(transition);
        return Err(wrong(
            *column,
            format!("the transition {found:?}; C, D, a wipe such as W001, or K is needed"),
        ));
    }
    if let Some((column, word)) =
        middle.iter().find(|(_, word)| !is_number(word) && !matches!(*word, "B" | "O" | "(F)"))
    {
        let found = excerpt(word);
        return Err(wrong(*column, format!("found {found:?}; a length in frames or a timecode is needed")));
    }
    // A list may state drop-frame timecode once, or in the timecodes of an event.
    let marked = |text: &str| text.contains([';', ',']);
    let is_unmarked = !times.iter().any(|(_, text)| marked(text));
    let time = |(column, text): &(u32, &str)| {
        base.seconds(text, marked(text) || (is_drop && is_unmarked))
            .map_err(|message| wrong(*column, message))
    };
    let [source_in, source_out, record_in, record_out] = times else { return Ok(None) };
    let source = (time(source_in)?, time(source_out)?);
    let target = (time(record_in)?, time(record_out)?);
    for (name, (from, to), (column, text)) in [("source", source, source_out), ("record", target, record_out)]
    {
        if to < from {
            let message = format!("the {name} ends at {text}, before it begins; a later end is needed");
            return Err(wrong(*column, message));
        }
    }
    let (reel, channels) = (reel.to_ascii_uppercase(), channels.to_ascii_uppercase());
    if target.1 == target.0 || reel == "BL" || channels == "NONE" {
        return Ok(None);
    }
    let name = format!("edit {index}");
    let edit = Edit { target, source, name, recording: None, weight: None, line: number };
    let has_picture = channels == "B" || channels.contains('V');
    Ok(Some(Event { edit, reel, has_picture, is_cut: kind == "C", is_incoming: false }))
}

/// Names an event after the clip of a comment. The incoming clip of a dissolve is in `* TO CLIP NAME:`, if there is one.
fn name(comment: &str, event: &mut Event) {
    let Some((key, clip)) = comment.split_once(':') else { return };
    let (key, clip) = (key.trim().to_ascii_uppercase(), clip.trim());
    let is_incoming = key == "TO CLIP NAME" && !event.is_cut;
    if !clip.is_empty() && (is_incoming || (key == "FROM CLIP NAME" && !event.is_incoming)) {
        event.edit.name = clip.to_owned();
        event.is_incoming = is_incoming;
    }
}

/// Reads a list with timecodes at `fps` frames per second.
pub(super) fn read(text: &str, fps: f64) -> Result<EditList, TextError> {
    let base = Timebase::new(fps);
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    let mut events: Vec<Event> = Vec::new();
    let (mut is_drop, mut speeds, mut others) = (false, Vec::new(), Vec::new());
    let (mut has_event, mut is_shown) = (false, false);
    for (number, line) in (1..).zip(text.split('\n')) {
        let line = line.trim_end();
        let upper = line.trim_start().to_ascii_uppercase();
        let head = upper.split_whitespace().next().unwrap_or_default();
        if let Some(comment) = line.trim_start().strip_prefix('*') {
            events.last_mut().filter(|_| is_shown).into_iter().for_each(|event| name(comment, event));
        } else if let Some(mode) = upper.strip_prefix("FCM:") {
            is_drop = mode.trim_start().starts_with("DROP");
        } else if head == "M2" {
            speeds.push(number);
        } else if is_number(head) {
            has_event = true;
            let event = event(number, line, &base, is_drop)?;
            is_shown = event.is_some();
            events.extend(event);
        } else if !(head.is_empty() || head.starts_with('>') || IGNORED.contains(&head)) {
            others.push((number, line));
        }
    }
    if !has_event {
        let (line, found) = others.first().map_or((1, ""), |(number, line)| (*number, line.trim()));
        let message = format!(
            "found {:?}; {EXAMPLE}, or JSON of OpenTimelineIO, or a table with the column `target_from`",
            excerpt(found)
        );
        return Err(TextError::new(Location { line, column: 1 }, message));
    }
    let has_picture = events.iter().any(|event| event.has_picture);
    let mut list = EditList::default();
    let others: Vec<u32> = others.iter().map(|(number, _)| *number).collect();
    list.note(&others, "no event, comment or known keyword: ignored");
    list.note(&speeds, "M2, a change of speed, is ignored");
    let lines = |is_it: &dyn Fn(&Event) -> bool| -> Vec<u32> {
        events.iter().filter(|event| is_it(event)).map(|event| event.edit.line).collect()
    };
    let unread = lines(&|event| has_picture && !event.has_picture);
    list.note(&unread, "sound without picture is ignored, since the list has picture");
    let soft = lines(&|event| event.has_picture == has_picture && !event.is_cut);
    list.note(&soft, "a dissolve, wipe or key is read as a cut at its beginning");
    let mut reels = BTreeSet::new();
    for event in events.into_iter().filter(|event| event.has_picture == has_picture) {
        reels.insert(event.reel);
        // Sound on several channels is one edit.
        let is_same = |e: &Edit| e.target == event.edit.target && e.source == event.edit.source;
        if has_picture || !list.edits.iter().rev().take(16).any(is_same) {
            list.edits.push(event.edit);
        }
    }
    if reels.len() > 1 {
        let names = reels.iter().take(10).map(String::as_str).collect::<Vec<_>>().join(", ");
        list.notices
            .push(format!("{} reels ({names}) are read as times of the first recording", reels.len()));
    }
    Ok(list)
}
