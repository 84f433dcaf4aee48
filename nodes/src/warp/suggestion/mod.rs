//! Proposals of correspondences, by optimal transport between the features of the target and of the database.

pub mod correspondence_suggester;
mod normal_quantile;
pub mod params;
pub mod sliced_wasserstein;
pub mod suggest;
mod transport;
mod windows;

pub use params::{Cause, Silence, SuggestParams};
pub use sliced_wasserstein::sliced_wasserstein;
pub use suggest::{Proposal, suggest};
