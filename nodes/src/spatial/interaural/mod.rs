//! Interaural cues: differences of level and time between the ears, and how alike both signals are.
//!
//! [`cue_transfer`] measures them in one sound and gives them to another, by band and frame; [`interaural_cues`] is the node.

pub mod cue_transfer;
pub mod interaural_cues;
mod mel_bands;
