//! Execution: a stage of wired nodes, and one node standalone.

mod block_wires;
pub mod stage;
pub mod standalone;
mod standalone_run;
mod survey;
mod wiring;
mod written;
