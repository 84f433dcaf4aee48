//! Scores: the sounds of recordings that are wanted, or not, at times of the output.

pub mod constraints;
pub mod curve;
pub mod edit_list;
pub mod edl_to_score;
pub mod model;
pub mod score_file;
pub mod text;

pub use constraints::{Constraint, Constraints, NodeSet, SourceSet, WeightStream};
pub use curve::WeightCurve;
pub use model::{MAX_TARGETS, Outside, ScoreSource, ScoreTarget, SoundScore};
pub use text::{read_score, write_score};
