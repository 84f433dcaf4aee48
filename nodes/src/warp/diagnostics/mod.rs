//! Bad correspondences, found by leaving each out in turn.

pub mod correspondence_diagnostics;
pub mod diagnosis;
pub mod effect;
pub mod leave_one_out;

pub use effect::{Baseline, Effect};
pub use leave_one_out::{LeaveOut, Suspicion, suspicions, without};
