//! What comes in while a graph plays: OSC over UDP, JSON lines on standard input, and frames of meshes over TCP.

mod hub;
mod json;
mod listening;
mod meshes;
mod osc;

pub use hub::{Hub, Moment, Set};
pub use json::{read_line, take_lines};
pub use listening::Listening;
pub use meshes::{MAGIC, VERSION, listen_to_meshes, take_frames};
pub use osc::{listen, read_packet};
