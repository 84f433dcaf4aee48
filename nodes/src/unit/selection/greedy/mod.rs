//! Selection unit by unit: each choice is the best window, given the picks before it.

mod unit_index;
pub mod window_search;

pub use window_search::selector;
