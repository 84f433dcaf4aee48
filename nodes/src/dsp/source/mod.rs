//! Sources of audio and of triggers, as functions of the sample index.

pub mod impulses;
pub mod metronome;
pub mod midi_notes;
pub mod noise;
pub mod noise_generator;
pub mod oscillator;
pub mod output;
pub mod sweep;
pub mod tone;
pub mod trigger;
pub mod trigger_file;
pub mod trigger_table;
