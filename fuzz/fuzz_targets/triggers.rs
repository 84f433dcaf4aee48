//! Triggers from CSV and from MIDI files: rejected with a reason, or valid.
#![no_main]

use foley_nodes::dsp::{NoteRules, read_midi_notes, read_trigger_table};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let all = [
        read_trigger_table(bytes),
        read_midi_notes(bytes, NoteRules::default()),
        read_midi_notes(bytes, NoteRules { channel: Some(1), base: Some(60) }),
    ];
    for triggers in all {
        match triggers {
            Ok(triggers) => {
                assert!(triggers.iter().all(|(time, trigger)| *time >= 0.0 && trigger.is_valid()));
            }
            Err(message) => assert!(!message.is_empty()),
        }
    }
});
