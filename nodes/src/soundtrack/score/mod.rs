//! Scores: the sounds of recordings that are wanted, or not, at times of the output.

mod conflicts;
pub mod constraints;
pub mod curve;
mod directive;
pub mod edit_list;
pub mod edl_to_score;
pub mod frame_score;
pub mod model;
pub mod node_set;
mod padding;
pub mod quiet;
pub mod quiet_score;
pub mod score_file;
pub mod score_out;
mod source_set;
pub mod text;
pub mod weight_stream;

pub use constraints::{Constraint, Constraints, Overlap};
pub use curve::WeightCurve;
pub(super) use directive::SOFT;
pub use edit_list::{Edit, EditList, EditRules, edits_to_score, read_edits};
pub use model::{MAX_TARGETS, Outside, ScoreSource, ScoreTarget, SoundScore};
pub use node_set::NodeSet;
pub use quiet::{quiet_passages, share_within};
pub use source_set::SourceSet;
pub use text::{read_score, write_score};
pub use weight_stream::WeightStream;
