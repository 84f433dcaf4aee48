//! Motions that are alike: queries for one motion, and paths of fragments from one animation to another.

mod dtw;
pub mod fragment_path;
pub mod fragments;
pub mod match_score;
pub mod matches;
pub mod motion_query;
pub mod path;
pub mod path_score;
pub mod query;
pub mod segmentation;
pub mod sound_spot;
pub mod spotting;

pub use dtw::{distance, envelope};
pub use fragments::{FragmentRules, candidates};
pub use matches::{MotionMatch, MotionMatches, match_weight};
pub use path::{FragmentPath, PathRules, best_path};
pub use query::{Normalisation, QueryError, QueryRules, best_matches, find_matches, without_overlap};
pub use segmentation::{SegmentRules, SegmentVariant, cuts, smoothed};
pub use spotting::{SpotError, spots};
