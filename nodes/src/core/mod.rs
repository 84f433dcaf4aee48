//! The node contract: time, ports, parameters, shapes, randomness and faults.
//!
//! A node describes itself once; running, checking, documenting and testing it all follow from that description.
//! Four layers, each of which imports only those before it: data types and time; ports, parameters and shapes; the
//! contract of nodes ([`node`]); what runs them ([`stage`], [`standalone`]).

pub mod computation;
mod data;
pub mod node;
pub mod params;
pub mod ports;
mod run;
pub mod shape;

pub(crate) use data::pool;
pub use data::{buffer, content, fault, feed, files, input, item, random, silence, state, time, unmatched};
pub use run::{stage, standalone};
