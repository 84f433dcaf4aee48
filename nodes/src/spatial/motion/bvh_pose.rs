//! The node `BvhPose`.

use super::bvh::Bvh;
use super::item::Poses;
use super::pose::{MAX_COORDINATE, Pose};
use super::pose_track::PoseTrack;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::{AssetPath, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::mesh::{UpAxis, rate_difference};
use crate::{params, ports};
use std::sync::Arc;

params! {
    /// Reads the poses of a joint of a moving skeleton from a motion capture file in the format BVH.
    ///
    /// Positions and orientations follow by forward kinematics, with the rotations in the order of the channels, in degrees. The position
    /// channels of a joint add to its offset. With `up: Y`, (x, y, z) of the file becomes (x, -z, y) in the scene, as for the meshes of a
    /// `MeshSequence`, and the z axis of a joint is its front, its y axis its top.
    ///
    /// Between frames positions are interpolated linearly and orientations by slerp. The stream ends at the last frame.
    ///
    /// # Source
    /// Meredith and Maddock, "Motion Capture File Formats Explained" (University of Sheffield, CS-01-11, 2001).
    pub struct BvhPoseParams {
        /// The file.
        path: AssetPath;
        /// Name of the joint, also in another case or without its namespace (`Hips` for `mixamorig:Hips`), or `<joint>/end` for the end of a
        /// last bone. Empty for the root.
        joint: Text = "".into();
        /// The axis that points upward in the file; it becomes Z.
        up: UpAxis = UpAxis::Y;
        /// Length of one unit of the file, for example 0.01 for centimetres.
        scale: f64 = 1.0, unit "m", range 0.000001..=1000000.0;
        /// Poses per second; None for the frame rate of the file, or the standard rate within 0.05 % of it.
        rate: Option<Rate> = None;
    }
}
ports! {
    pub struct BvhPosePorts / BvhPoseIo {
        in {}
        out {
            /// The poses.
            pose: Stream<Poses>,
        }
    }
}

/// Maximum number of joints that a message lists.
const MAX_LISTED: usize = 40;

/// The poses of one joint, and the frame rate of the file.
#[derive(Debug)]
struct JointMotion {
    poses: PoseTrack,
    rate: Rate,
}

impl JointMotion {
    fn read(p: &BvhPoseParams, bytes: &[u8]) -> Result<Self, Reject> {
        let wrong = |message: String| Reject::new("F067", format!("{:?}, {message}", p.path.0));
        let bvh = Bvh::read(bytes).map_err(|e| wrong(e.to_string()).at("path"))?;
        let joint = match p.joint.0.trim() {
            "" => 0,
            name => bvh.joint(name).ok_or_else(|| {
                let names: Vec<&str> = bvh.joints().iter().map(|joint| joint.name.as_str()).collect();
                let more = if names.len() > MAX_LISTED { ", ..." } else { "" };
                let listed = names.iter().take(MAX_LISTED).copied().collect::<Vec<_>>().join(", ");
                wrong(format!("there is no single joint {name:?}; joints are {listed}{more}")).at("joint")
            })?,
        };
        let rate = bvh.rate().ok_or_else(|| {
            let time = bvh.frame_time();
            wrong(format!("`Frame Time` is {time} s, which is not the inverse of a rate")).at("path")
        })?;
        let pose = |frame: usize| {
            let pose = bvh.pose(joint, frame, p.scale, p.up);
            pose.filter(Pose::is_near).ok_or_else(|| {
                let message = format!(
                    "the joint is farther than {MAX_COORDINATE:e} m from the origin in frame {frame}"
                );
                wrong(message).at("scale").help("give the length of a unit of the file in m")
            })
        };
        let poses = (0..bvh.frames()).map(pose).collect::<Result<Vec<Pose>, _>>()?;
        Ok(Self { poses: PoseTrack::at_rate(poses, rate), rate })
    }
}

/// The node over [`Bvh::pose`].
#[derive(Debug)]
pub struct BvhPose {
    motion: Arc<JointMotion>,
}

impl Node for BvhPose {
    type Params = BvhPoseParams;
    type Ports = BvhPosePorts;
    const NAME: &'static str = "BvhPose";
    const CLASS: Class = Class::Audio;

    fn shape(p: &BvhPoseParams, s: &mut Shape<'_, '_, BvhPosePorts>) -> Result<(), Reject> {
        let motion = JointMotion::read(p, &s.bytes("path", &p.path.0)?)?;
        let rate = p.rate.unwrap_or(motion.rate);
        rate_difference(&motion.poses.times(), rate, "rate").into_iter().for_each(|note| s.note(note));
        s.ends(Some(rate.tick(motion.poses.frames(rate))));
        s.output(BvhPosePorts::pose, rate, ());
        s.prepare(motion);
        Ok(())
    }

    fn build(p: &BvhPoseParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let motion = match cx.prepared::<JointMotion>() {
            Some(cached) => cached,
            None => Arc::new(JointMotion::read(p, &cx.bytes("path", &p.path.0)?)?),
        };
        Ok(Self { motion })
    }

    fn run(&mut self, mut io: BvhPoseIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.pose.first(), io.pose.rate());
        self.motion.poses.fill(first, rate, io.pose.items());
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (BvhPoseParams, MemoryFiles) {
        let (frames, time) = (1 + rng.below(20), rng.between(0.005, 0.05));
        let mut text = format!(
            "HIERARCHY\nROOT Hips\n{{\n\tOFFSET 0 0 0\n\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n\
             \tJOINT Head\n\t{{\n\t\tOFFSET 0 0.6 0.1\n\t\tCHANNELS 3 Zrotation Xrotation Yrotation\n\
             \t\tEnd Site\n\t\t{{\n\t\t\tOFFSET 0 0.2 0\n\t\t}}\n\t}}\n}}\nMOTION\nFrames: {frames}\nFrame Time: {time}\n"
        );
        for _ in 0..frames {
            let position = (0..3).map(|_| rng.between(-2.0, 2.0)).collect::<Vec<_>>();
            let angles = (0..6).map(|_| rng.between(-180.0, 180.0));
            let row: Vec<String> = position.into_iter().chain(angles).map(|x| x.to_string()).collect();
            text += &(row.join(" ") + "\n");
        }
        let mut files = MemoryFiles::default();
        files.insert("walk.bvh", text);
        let p = BvhPoseParams {
            path: "walk.bvh".into(),
            joint: ["", "head", "Head/end"][rng.below(3)].into(),
            up: [UpAxis::Y, UpAxis::Z][rng.below(2)],
            scale: [0.01, 1.0][rng.below(2)],
            rate: [None, Some(Rate::hz(60)), Some(Rate::hz(1000))][rng.below(3)],
        };
        (p, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::{Datum, Params};
    use crate::core::standalone::Standalone;

    const WALK: &str = "HIERARCHY ROOT Hips { OFFSET 0 0 0 CHANNELS 4 Xposition Yposition Zposition Yrotation\n\
        JOINT ns:Head { OFFSET 0 60 0 CHANNELS 0 } }\n\
        MOTION Frames: 3 Frame Time: 0.1\n0 100 0 0\n0 100 50 0\n20 100 50 90\n";

    fn standalone(p: impl Fn(BvhPoseParams) -> BvhPoseParams, text: &str) -> Standalone {
        let path = Datum::Text("walk.bvh".into());
        let defaults = BvhPoseParams::read(&|field| (field == "path").then(|| path.clone())).unwrap();
        let mut standalone = Standalone::new::<BvhPose>(p(BvhPoseParams { scale: 0.01, ..defaults }));
        standalone.files.insert("walk.bvh", text);
        standalone
    }

    fn poses(p: impl Fn(BvhPoseParams) -> BvhPoseParams) -> Vec<Pose> {
        standalone(p, WALK).run().unwrap().stream(BvhPosePorts::pose)
    }

    #[test]
    fn the_default_is_one_pose_of_the_root_for_each_frame() {
        let found: Vec<[f32; 3]> = poses(|p| p).iter().map(|pose| pose.position).collect();
        assert_eq!(found, [[0.0, 0.0, 1.0], [0.0, -0.5, 1.0], [0.2, -0.5, 1.0]]);
    }

    #[test]
    fn poses_between_frames_are_linear_and_the_stream_ends_at_the_last_frame() {
        let found = poses(|p| BvhPoseParams { rate: Some(Rate::hz(20)), joint: "head".into(), ..p });
        assert_eq!(found.len(), 5);
        let want = [[0.0, 0.0], [0.0, -0.25], [0.0, -0.5], [0.1, -0.5], [0.2, -0.5]];
        for (pose, [x, y]) in found.iter().zip(want) {
            let [a, b, c] = pose.position;
            assert!((a - x).abs() < 1e-6 && (b - y).abs() < 1e-6 && (c - 1.6).abs() < 1e-6, "{pose:?}");
        }
        // Half of a turn by 90 degrees to the left.
        let front = found[3].to_scene([1.0, 0.0, 0.0]);
        let half = 45_f64.to_radians();
        assert!((front[0] - 0.1 - half.sin()).abs() < 1e-6 && (front[1] + 0.5 + half.cos()).abs() < 1e-6);
        assert_eq!(poses(|p| BvhPoseParams { rate: Some(Rate::hz(4)), ..p }).len(), 1);
    }

    #[test]
    fn windows_of_any_length_give_the_same_poses() {
        let p = |p| BvhPoseParams { rate: Some(Rate::hz(1000)), ..p };
        let whole = poses(p);
        for seconds in [0.001, 0.0137, 0.3] {
            let run = standalone(p, WALK).window(crate::core::time::ticks(seconds)).run().unwrap();
            assert_eq!(run.stream(BvhPosePorts::pose), whole, "{seconds}");
        }
    }

    #[test]
    fn errors_name_the_parameter_and_what_would_be_right() {
        let reject =
            |p: fn(BvhPoseParams) -> BvhPoseParams, text: &str| standalone(p, text).shape().unwrap_err();
        let e = reject(|p| BvhPoseParams { joint: "Tail".into(), ..p }, WALK);
        assert!(e.code == "F067" && e.field.as_deref() == Some("joint"), "{e}");
        assert!(e.message.ends_with("no single joint \"Tail\"; joints are Hips, ns:Head"), "{e}");
        let e = reject(|p| BvhPoseParams { scale: 1e6, ..p }, WALK);
        assert!(e.field.as_deref() == Some("scale") && e.message.contains("in frame 0"), "{e}");
        let e = reject(|p| p, &WALK.replace("50 90", "50"));
        assert!(e.field.as_deref() == Some("path") && e.message.contains("line 6: 3 value(s)"), "{e}");
    }
}
