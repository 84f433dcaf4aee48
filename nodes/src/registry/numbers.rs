//! Soundtracks from recordings, by score or by motion.

use super::Registry;
use crate::soundtrack::matching::fragment_path::FragmentPathNode;
use crate::soundtrack::matching::gesture_spotter::GestureSpotter;
use crate::soundtrack::matching::match_score::MatchScore;
use crate::soundtrack::matching::motion_query::MotionQuery;
use crate::soundtrack::matching::path_frames::PathFrames;
use crate::soundtrack::matching::path_score::PathScore;
use crate::soundtrack::matching::sound_spot::SoundSpot;
use crate::soundtrack::motion::contact_curve::ContactCurve;
use crate::soundtrack::motion::curve_file::CurveFile;
use crate::soundtrack::motion::curve_out::CurveOut;
use crate::soundtrack::motion::motion_curve::MotionCurveNode;
use crate::soundtrack::motion::pose_curve::PoseCurve;
use crate::soundtrack::score::edl_to_score::EdlToScore;
use crate::soundtrack::score::frame_score::FrameScore;
use crate::soundtrack::score::quiet_score::QuietScore;
use crate::soundtrack::score::score_file::ScoreFile;
use crate::soundtrack::score::score_out::ScoreOut;
use crate::soundtrack::synthesis::soundtrack_report::SoundtrackReport;
use crate::soundtrack::synthesis::texture_synthesis::TextureSynthesis;
use crate::soundtrack::synthesis::tree_step::TreeStep;
use crate::soundtrack::wavelet::texture_model::TextureModelNode;
use crate::soundtrack::wavelet::texture_model_file::TextureModelFile;
use crate::soundtrack::wavelet::wavelet_tree::WaveletTreeNode;

/// Adds the family of soundtracks.
pub(super) fn add(types: Registry) -> Registry {
    types
        .family("soundtrack")
        .with_func::<WaveletTreeNode>()
        .with_func::<TextureModelNode>()
        .with_func::<TextureModelFile>()
        .with_func::<ScoreFile>()
        .with_func::<EdlToScore>()
        .with_func::<FrameScore>()
        .with::<ScoreOut>()
        .with_func::<QuietScore>()
        .with::<TextureSynthesis>()
        .with::<SoundtrackReport>()
        .with_func::<TreeStep>()
        .with::<CurveFile>()
        .with::<CurveOut>()
        .with::<PoseCurve>()
        .with::<ContactCurve>()
        .with::<MotionCurveNode>()
        .with_func::<MotionQuery>()
        .with::<GestureSpotter>()
        .with_func::<MatchScore>()
        .with_func::<SoundSpot>()
        .with_func::<FragmentPathNode>()
        .with_func::<PathFrames>()
        .with_func::<PathScore>()
}
