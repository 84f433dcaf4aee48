//! Levels of detail: the choice of one for each contact, and the strengths with which all are equally loud.

pub mod level_matcher;
pub mod lod_select;
mod lod_selector;
mod matching;
pub mod pair_matcher;
mod standard_stroke;

pub use lod_selector::{LodRules, LodSelector};
pub use matching::{StrokeParams, TuningParams};
pub use standard_stroke::StandardStroke;
