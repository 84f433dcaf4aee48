//! Poses as items of streams.

use super::pose::Pose;
use crate::core::item::Item;
use crate::core::random::Rng;

/// Position and orientation of a body: one [`Pose`] per frame.
#[derive(Debug)]
pub struct Poses;

impl Item for Poses {
    type Elem = Pose;
    type Format = ();
    const NAME: &'static str = "pose";
    const COLUMNS: &'static [&'static str] = &["x", "y", "z", "qw", "qx", "qy", "qz"];

    fn width((): &()) -> usize {
        1
    }

    fn describe((): &()) -> String {
        "one body".into()
    }

    fn trial_format(_: &mut Rng) {}

    fn trial((): &(), _: usize, rng: &mut Rng) -> Pose {
        let mut vector = || [0; 3].map(|_| rng.between(-2.0, 2.0));
        Pose::looking(vector(), vector(), vector()).unwrap_or_default()
    }

    fn finite(pose: &Pose) -> bool {
        pose.position.iter().chain(&pose.rotation).all(|x| x.is_finite())
    }

    fn poison() -> Pose {
        Pose { position: [f32::NAN; 3], rotation: [f32::NAN; 4] }
    }

    fn numbers(pose: &Pose, out: &mut Vec<f32>) {
        out.extend(pose.position.iter().chain(&pose.rotation));
    }
}
