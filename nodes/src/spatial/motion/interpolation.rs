//! Poses of a stream at any time, and poses from parameters.

use super::item::Poses;
use super::pose::Pose;
use crate::core::fault::Reject;
use crate::core::ports::In;
use crate::core::time::{Rate, Tick};

/// Frames that [`pose_at`] needs before a time.
pub(crate) const LOOK_BEHIND: usize = 2;
/// Frames that [`pose_at`] needs after a time.
pub(crate) const LOOK_AHEAD: usize = 2;

/// Returns the number of frames of another stream within one period of a stream.
pub(crate) fn frames_per_item(stream: Rate, other: Rate) -> usize {
    other.first_at(stream.span(1)) as usize
}

/// Returns true if every item of a stream coincides with a frame of another stream.
pub(crate) fn items_on_frames(stream: Rate, other: Rate) -> bool {
    let product = |a: Rate, b: Rate| i128::from(a.num()) * i128::from(b.den());
    product(other, stream) % product(stream, other) == 0
}

/// Returns the pose at a time of the window, interpolated smoothly between frames.
pub(crate) fn pose_at(poses: &In<'_, Poses>, tick: Tick) -> Pose {
    let rate = poses.rate();
    let (index, [from, to]) = rate.around(tick);
    let t = (tick - from) as f64 / (to - from).max(1) as f64;
    let behind = poses.behind() as i64;
    let last = poses.around().len() as i64 - behind - 1;
    let frame = |k: i64| {
        let k = (index + k - poses.first()).clamp(-behind, last.max(-behind));
        poses.item(k as isize).first().copied().unwrap_or_default()
    };
    // At the time of a frame its neighbours are not needed and may be missing.
    if tick == from { frame(0) } else { Pose::interpolate([-1, 0, 1, 2].map(frame), t) }
}

/// Returns the pose of a listener from parameters, or the reason why they do not define one.
pub(crate) fn listener_pose(position: [f64; 3], look: [f64; 3], up: [f64; 3]) -> Result<Pose, Reject> {
    Pose::looking(position, look, up).ok_or_else(|| {
        let message = format!(
            "the listener looks along {look:?} with {up:?} above, which does not define the orientation of the head"
        );
        Reject::new("F067", message)
            .at("look")
            .help("give two vectors that are not parallel, such as [1, 0, 0] and [0, 0, 1]")
    })
}
