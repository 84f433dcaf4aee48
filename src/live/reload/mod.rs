//! Hot reload: the reload actions of an edit, the transition graph, and the state transfer.

pub mod diff;
pub mod prepared;
pub mod state_transfer;
pub mod transition;
