//! Classification of contacts: impacts, and static, sliding and rolling contact.

mod classifier;
pub mod contact_classifier;
pub mod contact_report;
mod history;
mod impacts;
mod rules;
mod tracked_contact;

pub use classifier::Classifier;
pub use rules::{ImpactObjects, PowerLaw, Rules};
