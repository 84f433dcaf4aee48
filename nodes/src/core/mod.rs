//! What a node is: time, ports, parameters, shapes, randomness and faults.
//!
//! A node describes itself once; running, checking, documenting and testing it all follow from that description.

pub mod buffer;
pub mod content;
pub mod fault;
pub mod files;
pub mod input;
pub mod item;
pub mod node;
pub mod params;
pub mod ports;
pub mod random;
pub mod shape;
pub mod stage;
pub mod standalone;
pub mod state;
pub mod time;
