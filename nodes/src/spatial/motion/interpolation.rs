//! Poses of a stream at any time, and those that parameters give.

use super::item::Poses;
use super::pose::Pose;
use crate::core::fault::Reject;
use crate::core::ports::In;
use crate::core::time::{Rate, Tick};

/// Frames that [`pose_at`] needs before and after the times that it is asked for.
pub(crate) const LOOK_BEHIND: usize = 2;
pub(crate) const LOOK_AHEAD: usize = 2;

/// Frames of another stream within one period of a stream.
pub(crate) fn frames_per_item(stream: Rate, other: Rate) -> usize {
    other.first_at(stream.span(1)) as usize
}

/// Whether every item of a stream comes at the time of a frame of another one, so that nothing lies between frames.
pub(crate) fn items_on_frames(stream: Rate, other: Rate) -> bool {
    let product = |a: Rate, b: Rate| i128::from(a.num()) * i128::from(b.den());
    product(other, stream) % product(stream, other) == 0
}

/// The pose at a time of the window, between frames on a smooth way.
pub(crate) fn pose_at(poses: &In<'_, Poses>, tick: Tick) -> Pose {
    let rate = poses.rate();
    let at = rate.first_at(tick + 1) - 1;
    let (from, to) = (rate.tick(at), rate.tick(at + 1));
    let t = (tick - from) as f64 / (to - from).max(1) as f64;
    let past = poses.behind() as i64;
    let last = poses.around().len() as i64 - past - 1;
    let frame = |k: i64| {
        let k = (at + k - poses.first()).clamp(-past, last.max(-past));
        poses.item(k as isize).first().copied().unwrap_or_default()
    };
    // On a frame its neighbours count for nothing, and need not be there.
    if tick == from { frame(0) } else { Pose::interpolate([-1, 0, 1, 2].map(frame), t) }
}

/// The pose of a listener from parameters.
pub(crate) fn listener_pose(position: [f64; 3], look: [f64; 3], up: [f64; 3]) -> Result<Pose, Reject> {
    Pose::looking(position, look, up).ok_or_else(|| {
        let message = format!(
            "the listener looks along {look:?} with {up:?} above, which leaves open how the head is turned"
        );
        Reject::new("F067", message)
            .at("look")
            .help("give two vectors that are not parallel, such as [1, 0, 0] and [0, 0, 1]")
    })
}
