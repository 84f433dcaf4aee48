//! The text of BVH files.

use super::{Bvh, BvhChannel, BvhError, BvhJoint};
use crate::core::files::{excerpt, strip_bom};

/// Maximum number of joints, with the ends of bones.
const MAX_JOINTS: usize = 4096;
/// Maximum number of channels of a joint.
const MAX_CHANNELS: usize = 64;
/// Maximum number of frames.
const MAX_FRAMES: usize = 1 << 22;
/// Maximum number of values.
const MAX_VALUES: usize = 1 << 26;
/// Largest length or angle.
const MAX_VALUE: f64 = 1e9;
/// Shortest and longest frame time, s.
const FRAME_TIMES: [f64; 2] = [1e-5, 100.0];
/// The content of a joint, for messages.
const CONTENT: &str = "OFFSET, CHANNELS, JOINT, End Site or `}`";

/// A word, or the end of the file, for messages.
fn shown(text: &str) -> String {
    match text {
        "" => "the end of the file".into(),
        _ => format!("{:?}", excerpt(text)),
    }
}

/// A text, word by word.
struct Words<'a> {
    rest: &'a str,
    line: u64,
}

impl<'a> Words<'a> {
    fn error(&self, message: String) -> BvhError {
        BvhError { line: self.line, message }
    }

    fn skip_blank(&mut self) {
        let rest = self.rest.trim_start();
        let (blank, _) = self.rest.split_at(self.rest.len() - rest.len());
        self.line += blank.matches('\n').count() as u64;
        self.rest = rest;
    }

    /// The text up to a delimiter, or all that is left.
    fn until(&mut self, is_end: impl Fn(char) -> bool) -> &'a str {
        let end = self.rest.find(is_end).unwrap_or(self.rest.len());
        let (text, rest) = self.rest.split_at(end);
        self.rest = rest;
        text
    }

    /// The next word or brace; empty at the end.
    fn word(&mut self) -> &'a str {
        self.skip_blank();
        if self.rest.starts_with(['{', '}']) {
            let (brace, rest) = self.rest.split_at(1);
            self.rest = rest;
            return brace;
        }
        self.until(|c| c.is_whitespace() || c == '{' || c == '}')
    }

    fn expect(&mut self, wanted: &str) -> Result<(), BvhError> {
        let found = self.word();
        if found.eq_ignore_ascii_case(wanted) {
            return Ok(());
        }
        Err(self.error(format!("found {}; `{wanted}` is needed", shown(found))))
    }

    /// The name of a joint and its opening brace.
    fn name(&mut self) -> Result<String, BvhError> {
        self.skip_blank();
        let name = self.until(|c| c == '\n' || c == '{').trim();
        if name.is_empty() {
            return Err(self.error("a joint without a name; a name is needed, as in `JOINT Hips`".into()));
        }
        self.expect("{")?;
        Ok(name.to_owned())
    }

    fn number(&mut self, what: &str) -> Result<f64, BvhError> {
        let word = self.word();
        number(word).ok_or_else(|| {
            self.error(format!("{what} is {}; a number from -1e9 to 1e9 is needed", shown(word)))
        })
    }

    /// The number after a label that ends in a colon, between limits.
    fn labelled(&mut self, label: &str, [low, high]: [f64; 2]) -> Result<f64, BvhError> {
        self.skip_blank();
        let found = self.until(|c| c == ':' || c == '\n');
        let is_same = found.split_whitespace().collect::<Vec<_>>().join(" ").eq_ignore_ascii_case(label);
        let Some(rest) = self.rest.strip_prefix(':').filter(|_| is_same) else {
            return Err(self.error(format!("found {}; `{label}:` and a number are needed", shown(found))));
        };
        self.rest = rest;
        let word = self.word();
        number(word).filter(|x| (low..=high).contains(x)).ok_or_else(|| {
            let message = format!("`{label}` is {}; a number from {low} to {high} is needed", shown(word));
            self.error(message)
        })
    }
}

fn number(word: &str) -> Option<f64> {
    word.parse::<f64>().ok().filter(|x| x.abs() <= MAX_VALUE)
}

/// A joint that is not yet closed.
struct Open {
    index: usize,
    is_end: bool,
    has_offset: bool,
    has_channels: bool,
    ends: usize,
}

/// The joints so far.
#[derive(Default)]
struct Skeleton {
    joints: Vec<BvhJoint>,
    width: usize,
    open: Vec<Open>,
}

impl Skeleton {
    /// Opens a joint below the last that is open, or below none.
    fn add(&mut self, words: &Words<'_>, name: String, is_end: bool) -> Result<(), BvhError> {
        if self.joints.len() == MAX_JOINTS {
            return Err(words.error(format!("more joints than {MAX_JOINTS}; at most these are read")));
        }
        let index = self.joints.len();
        let parent = self.open.last().map(|open| open.index);
        self.joints.push(BvhJoint {
            name,
            parent,
            offset: [0.0; 3],
            channels: Vec::new(),
            first: self.width,
        });
        self.open.push(Open { index, is_end, has_offset: false, has_channels: is_end, ends: 0 });
        Ok(())
    }

    /// Reads one entry of the last joint that is open.
    fn entry(&mut self, words: &mut Words<'_>) -> Result<(), BvhError> {
        let word = words.word();
        let Some(open) = self.open.last_mut() else { return Ok(()) };
        let Some(joint) = self.joints.get_mut(open.index) else { return Ok(()) };
        match word.to_ascii_lowercase().as_str() {
            "offset" if !open.has_offset => {
                for (axis, out) in ["x", "y", "z"].iter().zip(&mut joint.offset) {
                    *out = words.number(&format!("{axis} of the OFFSET of `{}`", joint.name))?;
                }
                open.has_offset = true;
            }
            "channels" if !open.has_channels && !open.is_end => {
                joint.channels = channels(words, &joint.name)?;
                self.width += joint.channels.len();
                open.has_channels = true;
            }
            _ if open.is_end && word != "}" => {
                let message = format!("found {} in an End Site; OFFSET or `}}` is needed", shown(word));
                return Err(words.error(message));
            }
            "joint" => {
                let name = words.name()?;
                self.add(words, name, false)?;
            }
            "end" => {
                words.expect("Site")?;
                words.until(|c| c == '{' || c == '\n');
                words.expect("{")?;
                open.ends += 1;
                let number = if open.ends > 1 { open.ends.to_string() } else { String::new() };
                let name = format!("{}/end{number}", joint.name);
                self.add(words, name, true)?;
            }
            "}" => {
                for (has, what) in [(open.has_offset, "OFFSET"), (open.has_channels, "CHANNELS")] {
                    if !has {
                        let message = format!("`{}` ends without {what}; each joint needs it", joint.name);
                        return Err(words.error(message));
                    }
                }
                self.open.pop();
            }
            "offset" | "channels" => {
                return Err(words.error(format!("`{}` has a second {word}; one is needed", joint.name)));
            }
            _ => {
                let message = format!("found {} in `{}`; {CONTENT} is needed", shown(word), joint.name);
                return Err(words.error(message));
            }
        }
        Ok(())
    }
}

fn channels(words: &mut Words<'_>, joint: &str) -> Result<Vec<BvhChannel>, BvhError> {
    let word = words.word();
    let count = word.parse::<usize>().ok().filter(|n| *n <= MAX_CHANNELS).ok_or_else(|| {
        let found = shown(word);
        words.error(format!(
            "`{joint}` has {found} CHANNELS; a whole number from 0 to {MAX_CHANNELS} is needed"
        ))
    })?;
    let channel = |k: usize| {
        let word = words.word();
        let known = BvhChannel::ALL.iter().find(|(name, _)| name.eq_ignore_ascii_case(word));
        known.map(|(_, channel)| *channel).ok_or_else(|| {
            let names = BvhChannel::ALL.map(|(name, _)| name).join(", ");
            let found = shown(word);
            words.error(format!("channel {} of {count} of `{joint}` is {found}; channels are {names}", k + 1))
        })
    };
    (0..count).map(channel).collect()
}

/// Joint and name of a column, for messages.
fn column_name(joints: &[BvhJoint], column: usize) -> String {
    let joint = joints.iter().rev().find(|joint| joint.first <= column && !joint.channels.is_empty());
    let channel = joint.and_then(|joint| joint.channels.get(column - joint.first));
    let name = BvhChannel::ALL.iter().find(|(_, known)| Some(known) == channel).map_or("", |(name, _)| name);
    format!("value {}, {name} of `{}`,", column + 1, joint.map_or("", |joint| joint.name.as_str()))
}

/// Reads the rows of values.
fn rows(words: &Words<'_>, skeleton: &Skeleton, frames: usize) -> Result<Vec<f32>, BvhError> {
    let width = skeleton.width;
    // A value takes two bytes at least, whatever the header promises.
    let mut values = Vec::with_capacity((frames * width).min(words.rest.len() / 2 + 1));
    let mut line = words.line;
    let mut count = 0;
    for (at, row) in (words.line..).zip(words.rest.split('\n')) {
        let wrong = |message: String| BvhError { line: at, message };
        if row.trim().is_empty() {
            continue;
        }
        if count == frames {
            return Err(wrong(format!("a row of values after the {frames} that `Frames:` states")));
        }
        let mut found = 0;
        for word in row.split_whitespace() {
            if found < width {
                let value = number(word).ok_or_else(|| {
                    let column = column_name(&skeleton.joints, found);
                    wrong(format!("{column} is {}; a number from -1e9 to 1e9 is needed", shown(word)))
                })?;
                values.push(value as f32);
            }
            found += 1;
        }
        if found != width {
            return Err(wrong(format!("{found} value(s) where the joints have {width} channels")));
        }
        (line, count) = (at, count + 1);
    }
    if count < frames {
        let message = format!("the file ends after {count} of the {frames} rows that `Frames:` states");
        return Err(BvhError { line, message });
    }
    Ok(values)
}

pub(super) fn read(bytes: &[u8]) -> Result<Bvh, BvhError> {
    let text = String::from_utf8_lossy(strip_bom(bytes)).replace("\r\n", "\n").replace('\r', "\n");
    let text = text.trim_end_matches(['\0', '\u{1a}']);
    let mut words = Words { rest: text, line: 1 };
    words.expect("HIERARCHY")?;
    words.expect("ROOT")?;
    let mut skeleton = Skeleton::default();
    let root = words.name()?;
    skeleton.add(&words, root, false)?;
    while !skeleton.open.is_empty() {
        skeleton.entry(&mut words)?;
    }
    match words.word() {
        word if word.eq_ignore_ascii_case("MOTION") => {}
        word if word.eq_ignore_ascii_case("ROOT") => {
            return Err(words.error("a second ROOT; a file with one skeleton is needed".into()));
        }
        word => return Err(words.error(format!("found {}; `MOTION` is needed", shown(word)))),
    }
    if skeleton.width == 0 {
        return Err(words.error("no joint has a channel; at least one is needed".into()));
    }
    let frames = words.labelled("Frames", [1.0, MAX_FRAMES as f64])?;
    if frames.fract() != 0.0 || frames * skeleton.width as f64 > MAX_VALUES as f64 {
        let width = skeleton.width;
        let message = format!(
            "{frames} frames of {width} values; a whole number of frames with {MAX_VALUES} values at most is needed"
        );
        return Err(words.error(message));
    }
    let frames = frames as usize;
    let frame_time = words.labelled("Frame Time", FRAME_TIMES)?;
    let values = rows(&words, &skeleton, frames)?;
    Ok(Bvh { joints: skeleton.joints, frames, frame_time, values })
}
