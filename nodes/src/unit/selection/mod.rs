//! Selection of units: unit by unit ([`greedy`]) or for a whole target ([`global`]).
//!
//! A node checks the database (`candidates`), chooses per channel while its gate is open (`channel_gate`), counts the
//! choices (`counts`) and writes [`picks`].

mod candidates;
mod channel_gate;
mod counts;
pub mod global;
pub mod global_unit_selector;
pub mod greedy;
mod history;
pub mod kdtree;
pub mod online_unit_selector;
pub mod picks;
pub mod report;
pub mod selection_report;
pub mod selector;
pub mod unit_selector;

pub(crate) use candidates::{check_tags, comparable, no_unit, units};
pub use greedy::selector;
pub use picks::{Pick, PickFormat, Picks};
pub use report::{ChannelReport, SelectionReport};
pub use selector::{Choice, NotFinite, Selector, SelectorParams, Units};
