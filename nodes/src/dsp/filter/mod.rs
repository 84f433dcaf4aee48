//! Recursive filters: second-order sections, and Butterworth filters as cascades of them.

pub mod biquad;
pub mod butterworth;
pub mod high_pass;
pub mod low_pass;
pub mod node;
pub mod section;
pub mod zero_phase;
