//! Triggers from the notes of a standard MIDI file.

use super::trigger::Trigger;
use super::trigger_table::{MAX_TIME, MAX_TRIGGERS};
use midly::{Format, MetaMessage, MidiMessage, Timing, TrackEventKind};

/// Duration of a quarter note until the file gives another one, us.
const DEFAULT_TEMPO: u32 = 500_000;

/// Selection and meaning of notes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoteRules {
    /// Channel whose notes are read, 1 to 16; `None` for all.
    pub channel: Option<u16>,
    /// Note that plays sound 0 at its own speed, while others play it at their interval from it; `None` if each note plays the sound of its
    /// number.
    pub base: Option<u16>,
}

impl NoteRules {
    fn trigger(&self, note: u8, velocity: u8) -> Result<Trigger, String> {
        let gain = f32::from(velocity) / 127.0;
        let Some(base) = self.base else { return Ok(Trigger { index: note.into(), ..Trigger::of(gain) }) };
        let ratio = libm::exp2((f64::from(note) - f64::from(base)) / 12.0) as f32;
        let trigger = Trigger { ratio, ..Trigger::of(gain) };
        let wrong = || format!("note {note} is more than four octaves from `base`, {base}");
        trigger.is_valid().then_some(trigger).ok_or_else(wrong)
    }
}

/// Times of the ticks of a file.
struct TempoMap {
    /// First tick of each tempo, its time in s, and the duration of its ticks in s.
    parts: Vec<(u64, f64, f64)>,
}

impl TempoMap {
    /// The times of a file with these changes of the tempo: tick, us of a quarter note.
    fn new(timing: Timing, mut tempos: Vec<(u64, u32)>) -> Result<Self, String> {
        let ticks = match timing {
            Timing::Metrical(ticks) => f64::from(ticks.as_int()),
            Timing::Timecode(frames, ticks) => {
                // 29 stands for 29.97.
                let frames = if frames.as_int() == 29 { 30.0 / 1.001 } else { f64::from(frames.as_int()) };
                // Ticks of SMPTE do not depend on the tempo.
                tempos.clear();
                frames * f64::from(ticks) * f64::from(DEFAULT_TEMPO) * 1e-6
            }
        };
        if ticks <= 0.0 {
            return Err("header: 0 ticks in a quarter note or frame; at least 1 is needed".into());
        }
        tempos.sort_by_key(|tempo| tempo.0);
        let mut map = Self { parts: vec![(0, 0.0, f64::from(DEFAULT_TEMPO) * 1e-6 / ticks)] };
        for (tick, tempo) in tempos {
            map.parts.push((tick, map.seconds(tick), f64::from(tempo) * 1e-6 / ticks));
        }
        Ok(map)
    }

    fn seconds(&self, tick: u64) -> f64 {
        let after = self.parts.partition_point(|part| part.0 <= tick);
        let (first, time, duration) = self.parts[after.max(1) - 1];
        time + (tick - first) as f64 * duration
    }
}

/// A message of the decoder.
fn unreadable(part: &str, e: &midly::Error) -> String {
    format!("{part}: {}; a complete MIDI file is needed", e.kind().message())
}

/// Reads the notes of a standard MIDI file of format 0 or 1 as triggers with their times in s, in order of time. The gain is the velocity
/// over 127; times follow the changes of tempo of all tracks.
///
/// # Errors
/// A message with the track, the value found, and what is needed.
pub fn read_midi_notes(bytes: &[u8], rules: NoteRules) -> Result<Vec<(f64, Trigger)>, String> {
    if !bytes.starts_with(b"MThd") {
        return Err("this is not a standard MIDI file, which begins with `MThd`".into());
    }
    // The decoder cannot negate this number of frames.
    if bytes.get(12) == Some(&0x80) {
        return Err("header: 128 frames a second; 24, 25, 29 or 30 are needed".into());
    }
    let (header, tracks) = midly::parse(bytes).map_err(|e| unreadable("header", &e))?;
    if header.format == Format::Sequential {
        return Err("header: format 2, of independent pieces; save it as format 0 or 1".into());
    }
    let declared = tracks.size_hint().0;
    let (mut tempos, mut notes, mut count) = (Vec::new(), Vec::new(), 0);
    for track in tracks {
        count += 1;
        let mut tick = 0_u64;
        for event in track.map_err(|e| unreadable(&format!("track {count}"), &e))? {
            let event = event.map_err(|e| unreadable(&format!("track {count}, tick {tick}"), &e))?;
            tick += u64::from(event.delta.as_int());
            match event.kind {
                TrackEventKind::Meta(MetaMessage::Tempo(tempo)) => tempos.push((tick, tempo.as_int())),
                TrackEventKind::Midi { channel, message: MidiMessage::NoteOn { key, vel } }
                    // A note with velocity 0 ends.
                    if vel.as_int() > 0
                        && rules.channel.is_none_or(|c| c == u16::from(channel.as_int()) + 1) =>
                {
                    if notes.len() == MAX_TRIGGERS {
                        return Err(format!("track {count}: at most {MAX_TRIGGERS} notes are read"));
                    }
                    let trigger = rules.trigger(key.as_int(), vel.as_int());
                    notes.push((tick, trigger.map_err(|e| format!("track {count}, tick {tick}: {e}"))?));
                }
                _ => {}
            }
        }
    }
    if count != declared {
        return Err(format!("the file ends after {count} track(s); its header announces {declared}"));
    }
    notes.sort_by_key(|note| note.0);
    let map = TempoMap::new(header.timing, tempos)?;
    let last = notes.last().map_or(0.0, |note| map.seconds(note.0));
    if last > MAX_TIME {
        return Err(format!("the last note is at {last} s; notes within {MAX_TIME} s are read"));
    }
    Ok(notes.into_iter().map(|(tick, trigger)| (map.seconds(tick), trigger)).collect())
}

/// The bytes of a file with tracks of events: `timing` is the division of the header.
#[must_use]
pub(super) fn midi_file(format: u8, timing: u16, tracks: &[&[u8]]) -> Vec<u8> {
    let mut file = b"MThd\0\0\0\x06\0".to_vec();
    file.push(format);
    file.extend((tracks.len() as u16).to_be_bytes());
    file.extend(timing.to_be_bytes());
    for track in tracks {
        let events = [track, b"\0\xff\x2f\0".as_slice()].concat();
        file.extend(b"MTrk");
        file.extend((events.len() as u32).to_be_bytes());
        file.extend(events);
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn read(file: &[u8]) -> Vec<(f64, Trigger)> {
        read_midi_notes(file, NoteRules::default()).unwrap()
    }

    fn rounded(notes: &[(f64, Trigger)]) -> Vec<(f64, u32)> {
        notes.iter().map(|(time, t)| ((time * 1e6).round() / 1e6, t.index)).collect()
    }

    #[test]
    fn notes_become_triggers_by_running_status() {
        // Note 60 at a velocity of 127; half a second later the end of it, and note 64 at 64.
        let file = midi_file(0, 96, &[b"\0\x90\x3c\x7f\x60\x3c\0\0\x40\x40"]);
        let notes = read(&file);
        assert_eq!(rounded(&notes), [(0.0, 60), (0.5, 64)]);
        assert_eq!((notes[0].1.gain, notes[1].1.gain, notes[1].1.ratio), (1.0, 64.0 / 127.0, 1.0));
    }

    #[test]
    fn the_tempo_of_one_track_holds_for_all() {
        // A quarter note takes 0.5 s, from the second one on 1 s, and from the fourth one on 0.25 s.
        let tempos = b"\x60\xff\x51\x03\x0f\x42\x40\x81\x40\xff\x51\x03\x03\xd0\x90";
        // Notes at quarter notes 0, 1, 2, 3 and 5.
        let notes = b"\0\x91\x01\x7f\x60\x02\x7f\x60\x03\x7f\x60\x04\x7f\x81\x40\x05\x7f";
        let want = [(0.0, 1), (0.5, 2), (1.5, 3), (2.5, 4), (3.0, 5)];
        assert_eq!(rounded(&read(&midi_file(1, 96, &[tempos, notes]))), want);
        assert_eq!(rounded(&read(&midi_file(1, 96, &[notes, tempos]))), want);
    }

    #[test]
    fn tracks_are_one_sequence_and_a_channel_is_selected() {
        let file = midi_file(1, 96, &[b"\x30\x90\x01\x7f", b"\0\x93\x02\x7f\x60\x03\x7f"]);
        assert_eq!(rounded(&read(&file)), [(0.0, 2), (0.25, 1), (0.5, 3)]);
        let rules = NoteRules { channel: Some(1), base: None };
        assert_eq!(rounded(&read_midi_notes(&file, rules).unwrap()), [(0.25, 1)]);
        assert_eq!(read_midi_notes(&file, NoteRules { channel: Some(9), base: None }).unwrap(), []);
    }

    #[test]
    fn frames_of_smpte_do_not_follow_the_tempo() {
        // 25 frames of 40 ticks a second, and a tempo that has no effect; then 29.97 frames of 100 ticks.
        let track = b"\0\xff\x51\x03\x01\0\0\x87\x68\x90\x01\x7f";
        assert_eq!(rounded(&read(&midi_file(0, 0xe728, &[track]))), [(1.0, 1)]);
        let drop_frame = read(&midi_file(0, 0xe364, &[track]));
        assert!((drop_frame[0].0 - 10.0 * 1.001 / 30.0).abs() < 1e-9, "{drop_frame:?}");
    }

    #[test]
    fn a_base_note_makes_intervals_of_one_sound() {
        let rules = NoteRules { channel: None, base: Some(60) };
        let triggers =
            read_midi_notes(&midi_file(0, 96, &[b"\0\x90\x3c\x7f\0\x48\x7f\0\x35\x7f"]), rules).unwrap();
        let ratios: Vec<f32> = triggers.iter().map(|(_, t)| t.ratio).collect();
        assert!(ratios[..2] == [1.0, 2.0] && (ratios[2] - 0.667_42).abs() < 1e-4, "{ratios:?}");
        assert!(triggers.iter().all(|(_, t)| t.index == 0));
        let e = read_midi_notes(&midi_file(0, 96, &[b"\0\x90\x78\x7f"]), rules).unwrap_err();
        assert_eq!(e, "track 1, tick 0: note 120 is more than four octaves from `base`, 60");
    }

    #[test]
    fn files_that_cannot_be_read_are_refused_with_a_reason() {
        let good = midi_file(1, 96, &[b"\0\x90\x3c\x7f", b"\0\x90\x3c\x7f"]);
        let no_status = midi_file(0, 96, &[b"\0\x3c\x7f"]);
        let cut_event = midi_file(0, 96, &[b"\x60\xff\x51\x03\x0f"]);
        let last = midi_file(0, 1, &[b"\xff\xff\xff\x7f\x90\x3c\x7f"]);
        for (file, part) in [
            (&b"MThd"[..], "header: invalid midi header; a complete MIDI file is needed"),
            (b"RIFF\0\0\0\0RMID", "not a standard MIDI file"),
            (&good[..good.len() - 3], "track 2: invalid chunk; a complete MIDI file is needed"),
            (&good[..good.len() - 16], "ends after 1 track(s); its header announces 2"),
            (&no_status, "track 1, tick 0: malformed event"),
            (&cut_event, "track 1, tick 96: malformed event"),
            (&midi_file(2, 96, &[]), "format 2"),
            (&midi_file(0, 0, &[b""]), "0 ticks in a quarter note"),
            (&midi_file(0, 0xe700, &[b""]), "0 ticks in a quarter note or frame"),
            (&midi_file(0, 0x8000, &[b""]), "24, 25, 29 or 30 are needed"),
            (&midi_file(0, 0x9b01, &[b""]), "header: "),
            (&last, "the last note is at"),
        ] {
            let e = read_midi_notes(file, NoteRules::default()).unwrap_err();
            assert!(e.contains(part), "{part}: {e}");
        }
    }

    #[test]
    fn damaged_files_give_triggers_or_a_reason() {
        let good =
            midi_file(1, 96, &[b"\0\xff\x51\x03\x0f\x42\x40", b"\0\x90\x3c\x7f\x60\x3c\0\x81\x40\x40\x40"]);
        let (mut read, mut refused) = (0, 0);
        for seed in 0..20_000 {
            let mut rng = Rng::new(seed);
            let mut bytes = good.clone();
            for _ in 0..1 + rng.below(4) {
                let at = rng.below(bytes.len());
                match rng.below(4) {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] = rng.below(256) as u8,
                    2 => bytes.extend_from_within(at..),
                    _ => bytes.insert(at, rng.below(256) as u8),
                }
            }
            let base = [None, Some(60)][rng.below(2)];
            match read_midi_notes(&bytes, NoteRules { channel: None, base }) {
                Ok(triggers) => {
                    read += 1;
                    assert!(triggers.is_sorted_by(|a, b| a.0 <= b.0));
                    assert!(triggers.iter().all(|(time, t)| *time >= 0.0 && t.is_valid()));
                }
                Err(e) => {
                    refused += 1;
                    assert!(!e.is_empty());
                }
            }
        }
        assert!(read > 100 && refused > 1000, "{read} read, {refused} refused");
    }
}
