//! The times of clips relative to those of speeds.

use crate::choices;
use crate::contact::{Pressures, Speeds};
use crate::core::fault::Reject;
use crate::core::node::same_rate;
use crate::core::params::Param;
use crate::core::shape::Incoming;
use crate::core::time::Rate;
use crate::friction::model::MAX_CLIP_SAMPLES;

choices! {
    /// Time within a clip at which its motion is sampled.
    pub enum MotionAt {
        /// At the middle: no delay on average, but the start of a slide sounds half a clip early.
        Centre,
        /// At the start, for live use: no look-ahead, and nothing sounds early; everything sounds half a clip later.
        Start,
    }
}

impl MotionAt {
    /// Returns the look-behind and look-ahead in speeds.
    pub(super) fn lookaround(self) -> [usize; 2] {
        match self {
            Self::Centre => [1, 1],
            Self::Start => [2, 0],
        }
    }

    /// Returns the index of the speed of a clip. Each speed is the middle of one clip and the start of the next.
    pub(super) fn item(self, clip: u64) -> i64 {
        match self {
            Self::Centre => clip as i64,
            Self::Start => clip as i64 - 1,
        }
    }
}

/// Refuses pressures of other vertices or times than those of the speeds.
pub(super) fn check_pressure(
    speeds: &Incoming<Speeds>,
    pressure: &Incoming<Pressures>,
) -> Result<(), Reject> {
    same_rate("pressure", pressure.rate, "`speeds`", speeds.rate)?;
    let (found, wanted) = (pressure.format.len(), speeds.format.len());
    if found == wanted {
        return Ok(());
    }
    let message = format!("`pressure` has {found} vertices, `speeds` has {wanted}");
    Err(Reject::new("F067", message)
        .at("pressure")
        .help("link the pressures of the contacts that give the speeds"))
}

/// Returns the number of samples from one speed to the next.
pub(super) fn hop(audio: Rate, speeds: Rate) -> Result<usize, Reject> {
    let exact = audio.num() as f64 * speeds.den() as f64 / (audio.den() as f64 * speeds.num() as f64);
    let max = MAX_CLIP_SAMPLES as f64 / 2.0;
    let nearest = exact.round().clamp(1.0, max) as u64;
    let fitting = audio.divided_by(nearest);
    if fitting == Some(speeds) {
        return Ok(nearest as usize);
    }
    let found = format!("{exact:.3} samples at {audio} from one speed to the next at {speeds}");
    let reject =
        Reject::new("F074", format!("{found}; a whole number is needed, of at most {max}")).at("speeds");
    Err(match fitting {
        Some(rate) => reject.help(format!("set `rate: {}` on the node that gives the speeds", rate.write())),
        None => reject,
    })
}
