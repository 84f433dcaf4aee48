//! Messages that arrive while a graph plays: OSC over UDP, JSON lines on standard input, and frames of meshes over TCP.

mod hub;
mod json;
mod listener;
mod log_clock;
mod meshes;
mod meters;
mod osc;
mod refusals;

pub use hub::{Hub, MAX_AHEAD, MAX_SETS, Moment, Set};
pub use json::{read_line, read_lines};
pub use listener::Listener;
pub use meshes::{MAGIC, VERSION, listen_to_meshes, read_frames};
pub use meters::{MeterReadings, Meters};
pub use osc::{listen_to_osc, read_packet};
pub use refusals::{Refusal, Refusals};
