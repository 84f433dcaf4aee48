//! The times of clips against those of speeds.

use crate::choices;
use crate::core::fault::Reject;
use crate::core::params::Param;
use crate::core::time::Rate;
use crate::friction::model::MAX_CLIP_SAMPLES;

choices! {
    /// When in a clip the motion is taken that it sounds of.
    pub enum MotionAt {
        /// At its middle: in time on average, though the start of a slide is heard half a clip early.
        Centre,
        /// At its start: nothing is heard early and nothing waited for, for live use; all is heard half a clip later.
        Start,
    }
}

impl MotionAt {
    /// Speeds before and after those of a window that its clips are made of.
    pub(super) fn reach(self) -> [usize; 2] {
        match self {
            Self::Centre => [1, 1],
            Self::Start => [2, 0],
        }
    }

    /// The speed that a clip is made of; each is the middle of one clip and the start of the next.
    pub(super) fn item(self, clip: u64) -> i64 {
        match self {
            Self::Centre => clip as i64,
            Self::Start => clip as i64 - 1,
        }
    }
}

/// Samples from one speed to the next.
pub(super) fn hop(audio: Rate, speeds: Rate) -> Result<usize, Reject> {
    let exact = audio.num() as f64 * speeds.den() as f64 / (audio.den() as f64 * speeds.num() as f64);
    let most = MAX_CLIP_SAMPLES as f64 / 2.0;
    let nearest = exact.round().clamp(1.0, most) as u64;
    let fitting = audio.divided_by(nearest);
    if fitting == Some(speeds) {
        return Ok(nearest as usize);
    }
    let found = format!("{exact:.3} samples at {audio} from one speed to the next at {speeds}");
    let reject =
        Reject::new("F074", format!("{found}; a whole number is needed, of at most {most}")).at("speeds");
    Err(match fitting {
        Some(rate) => reject.help(format!("set `rate: {}` on the node that gives the speeds", rate.write())),
        None => reject,
    })
}
