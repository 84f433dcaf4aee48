//! The node `TriggerFile`.

use super::midi_notes::{NoteRules, midi_file, read_midi_notes};
use super::trigger::Trigger;
use super::trigger_table::read_trigger_table;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::{AssetPath, Params};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, ticks};
use crate::{params, ports};

params! {
    /// Triggers from a file: CSV with a header, or a standard MIDI file.
    ///
    /// Required in CSV is the column `time_s` or `time` (s). Optional are `gain` (amplitude factor, 1), `index` (a number from 0, the sound
    /// among those of the node that plays it, 0) and `ratio` (speed of playback as a factor, 0.0625 to 16, 1). Columns may have any order; rows
    /// are sorted by time.
    ///
    /// A MIDI file is one whose name ends in `.mid` or `.midi`, or that begins with `MThd`; its format is 0 or 1. Each note has the gain
    /// `velocity / 127` and its number as index; its time follows the changes of tempo.
    pub struct TriggerFileParams {
        /// The file.
        path: AssetPath;
        /// Channel of a MIDI file whose notes are read; None for all.
        channel: Option<u16> = None, unit "", range 1..=16_u16;
        /// Note of a MIDI file that plays sound 0 at its own speed, while others play it at their interval, with the ratio
        /// `2^((note - base) / 12)`. None if the number of a note is its index.
        base: Option<u16> = None, unit "", range 0..=127_u16;
    }
}
ports! {
    /// Ports of `TriggerFile`.
    pub struct TriggerFilePorts / TriggerFileIo {
        in {}
        out {
            /// The triggers.
            triggers: Events<Trigger>,
        }
    }
}

/// The node `TriggerFile`.
#[derive(Debug)]
pub struct TriggerFile {
    triggers: Vec<(Tick, Trigger)>,
}

/// The triggers in order of time; true if the file has another order.
fn read(p: &TriggerFileParams, bytes: &[u8]) -> Result<(Vec<(Tick, Trigger)>, bool), Reject> {
    let name = p.path.0.to_ascii_lowercase();
    let is_midi = name.ends_with(".mid") || name.ends_with(".midi") || bytes.starts_with(b"MThd");
    let triggers = if is_midi {
        read_midi_notes(bytes, NoteRules { channel: p.channel, base: p.base })
    } else {
        read_trigger_table(bytes)
    };
    let mut triggers =
        triggers.map_err(|e| Reject::new("F152", format!("{:?}: {e}", p.path.0)).at("path"))?;
    let is_sorted = triggers.is_sorted_by(|a, b| a.0 <= b.0);
    triggers.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok((triggers.into_iter().map(|(time, trigger)| (ticks(time), trigger)).collect(), !is_sorted))
}

impl Node for TriggerFile {
    type Params = TriggerFileParams;
    type Ports = TriggerFilePorts;
    const NAME: &'static str = "TriggerFile";
    const CLASS: Class = Class::Audio;

    fn shape(p: &TriggerFileParams, s: &mut Shape<'_, '_, TriggerFilePorts>) -> Result<(), Reject> {
        let (triggers, was_unsorted) = read(p, &s.bytes("path", &p.path.0)?)?;
        if triggers.is_empty() {
            s.note(format!("{:?} holds no trigger", p.path.0));
        }
        if was_unsorted {
            s.note(format!("{:?} has times that decrease; its triggers are sorted", p.path.0));
        }
        s.ends(Some(triggers.last().map_or(0, |(tick, _)| tick + 1)));
        Ok(())
    }

    fn build(p: &TriggerFileParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (triggers, _) = read(p, &cx.bytes("path", &p.path.0)?)?;
        Ok(Self { triggers })
    }

    fn run(&mut self, mut io: TriggerFileIo<'_>) -> Result<(), Fault> {
        let (from, to) = io.triggers.window();
        let first = self.triggers.partition_point(|(tick, _)| *tick < from);
        for (tick, trigger) in self.triggers.iter().skip(first).take_while(|(tick, _)| *tick < to) {
            io.triggers.push(*tick, *trigger);
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (TriggerFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let is_midi = rng.below(2) == 0;
        let path = if is_midi { "notes.mid" } else { "triggers.csv" };
        if is_midi {
            // Quarter notes of 20 to 60 ms, and notes near the base.
            let mut track = vec![0, 0xff, 0x51, 3, 0, 80 + rng.below(150) as u8, 0];
            for _ in 0..rng.below(20) {
                let note = 30 + rng.below(60) as u8;
                track.extend([rng.below(96) as u8, 0x90, note, rng.below(128) as u8]);
            }
            files.insert(path, midi_file(0, 96, &[&track]));
        } else {
            let mut text = String::from("time_s,gain,index,ratio\n");
            for _ in 0..rng.below(20) {
                let (time, gain) = (rng.between(0.0, 0.6), rng.between(-1.0, 1.0));
                text += &format!("{time},{gain},{},{}\n", rng.below(4), [0.5, 1.0, 2.0][rng.below(3)]);
            }
            files.insert(path, text);
        }
        let params = TriggerFileParams {
            path: path.into(),
            base: (rng.below(2) == 0).then_some(60),
            ..TriggerFileParams::trial(rng)
        };
        let channel = params.channel.map(|channel| 1 + channel % 2);
        (TriggerFileParams { channel, ..params }, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Datum;
    use crate::core::standalone::Standalone;

    fn standalone(name: &str, file: impl Into<Vec<u8>>) -> Standalone {
        let path = Datum::Text(name.into());
        let p = TriggerFileParams::read(&|field| (field == "path").then(|| path.clone())).unwrap();
        let mut standalone = Standalone::new::<TriggerFile>(p);
        standalone.files.insert(name, file);
        standalone
    }

    #[test]
    fn triggers_have_their_times_with_any_window_and_are_sorted() {
        let file = "time_s,index\n0.1,1\n0,0\n0.1,2\n0.25,3\n";
        let standalone = standalone("taps.csv", file).window(ticks(0.03));
        let notes = standalone.shape().unwrap().notes;
        assert_eq!(notes, [r#""taps.csv" has times that decrease; its triggers are sorted"#]);
        let triggers = standalone.run().unwrap().events(TriggerFilePorts::triggers);
        let found: Vec<(Tick, u32)> = triggers.iter().map(|(tick, t)| (*tick, t.index)).collect();
        assert_eq!(found, [(0, 0), (ticks(0.1), 1), (ticks(0.1), 2), (ticks(0.25), 3)]);
    }

    #[test]
    fn midi_files_are_known_by_their_names_or_by_their_first_bytes() {
        let file = midi_file(0, 96, &[b"\x60\x90\x3c\x7f"]);
        for name in ["notes.MID", "notes.midi", "notes"] {
            let run = standalone(name, file.clone()).run().unwrap();
            let want = Trigger { index: 60, ..Trigger::of(1.0) };
            assert_eq!(run.events(TriggerFilePorts::triggers), [(ticks(0.5), want)]);
        }
        let reject = standalone("notes.mid", "time_s\n0\n").shape().unwrap_err();
        assert!(reject.code == "F152" && reject.message.contains("not a standard MIDI file"), "{reject}");
    }

    #[test]
    fn a_file_without_triggers_is_noted_and_a_wrong_line_is_named_before_the_run() {
        assert_eq!(standalone("a.csv", "time_s\n").shape().unwrap().notes, [r#""a.csv" holds no trigger"#]);
        let reject = standalone("a.csv", "time_s\n0\nsoon\n").shape().unwrap_err();
        assert!(reject.code == "F152" && reject.message.contains("\"a.csv\": line 3, column `time_s`"));
    }
}
