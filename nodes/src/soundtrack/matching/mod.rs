//! Similarity of motions: queries for one motion, and paths of fragments from one animation to another.

mod deepening;
mod dtw;
pub mod fragment_path;
pub mod fragments;
pub mod gesture_spotter;
pub mod match_score;
pub mod matches;
pub mod motion_query;
pub mod overlap;
pub mod path;
pub mod path_frames;
pub mod path_score;
pub mod pattern;
pub mod query;
pub mod query_params;
pub mod search;
pub mod segmentation;
mod som;
pub mod sound_spot;
pub mod spotting;
pub mod windows;

pub use dtw::{distance, envelope};
pub use fragments::{FragmentRules, candidates};
pub use matches::{MotionMatch, MotionMatches, match_weight};
pub use overlap::{greatest_sum, most_similar};
pub use path::{FragmentPath, PathRules, best_path};
pub use path_score::{PathScoreRules, path_to_score};
pub use pattern::{Normalisation, QueryError, QueryRules};
pub use search::{best_matches, find_matches};
pub use segmentation::{SegmentRules, SegmentVariant, cuts, smoothed};
pub use spotting::{SpotError, SpotMode, spots};
