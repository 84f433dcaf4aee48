//! What comes in while a graph plays: OSC over UDP, and JSON lines on standard input.

mod hub;
mod json;
mod osc;

pub use hub::{Hub, Set};
pub use json::{read_line, take_lines};
pub use osc::{Listening, listen, read_packet};
