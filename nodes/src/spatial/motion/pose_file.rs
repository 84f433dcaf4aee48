//! The node `PoseFile`.

use super::item::Poses;
use super::pose_track::{PoseTrack, read_poses};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::AssetPath;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::mesh::rate_difference;
use crate::{params, ports};

params! {
    /// Reads the poses of a body from a CSV file with a header.
    ///
    /// Columns are `time_s` (increasing), `x`, `y`, `z` (m) and, if the body turns, `qw`, `qx`, `qy`, `qz`: the quaternion from the local
    /// axes of the body (x front, y left, z up) to those of the scene. A column `comment` is ignored. Between rows positions are
    /// interpolated linearly and orientations by slerp. Before the first row the pose is that of the first row; after the last row the
    /// stream ends.
    pub struct PoseFileParams {
        /// The file.
        path: AssetPath;
        /// Poses per second.
        rate: Rate = Rate::hz(60);
    }
}
ports! {
    pub struct PoseFilePorts / PoseFileIo {
        in {}
        out {
            /// The poses.
            pose: Stream<Poses>,
        }
    }
}

/// The node `PoseFile`.
#[derive(Debug)]
pub struct PoseFile {
    poses: PoseTrack,
}

fn read(p: &PoseFileParams, bytes: &[u8]) -> Result<PoseTrack, Reject> {
    read_poses(bytes).map_err(|e| Reject::new("F067", format!("{:?}, {e}", p.path.0)).at("path"))
}

impl Node for PoseFile {
    type Params = PoseFileParams;
    type Ports = PoseFilePorts;
    const NAME: &'static str = "PoseFile";
    const CLASS: Class = Class::Audio;

    fn shape(p: &PoseFileParams, s: &mut Shape<'_, '_, PoseFilePorts>) -> Result<(), Reject> {
        let poses = read(p, &s.bytes("path", &p.path.0)?)?;
        rate_difference(&poses.times(), p.rate, "rate").into_iter().for_each(|note| s.note(note));
        s.ends(Some(p.rate.tick(poses.frames(p.rate))));
        s.output(PoseFilePorts::pose, p.rate, ());
        Ok(())
    }

    fn build(p: &PoseFileParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { poses: read(p, &cx.bytes("path", &p.path.0)?)? })
    }

    fn run(&mut self, mut io: PoseFileIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.pose.first(), io.pose.rate());
        self.poses.fill(first, rate, io.pose.items());
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (PoseFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let mut text = String::from("time_s,x,y,z,qw,qx,qy,qz\n");
        let mut time = 0.0;
        for _ in 0..1 + rng.below(20) {
            time += rng.between(0.001, 0.05);
            let numbers: Vec<String> = (0..6).map(|_| rng.between(-3.0, 3.0).to_string()).collect();
            text += &format!("{time},{},4\n", numbers.join(","));
        }
        files.insert("way.csv", text);
        let rate = Rate::hz([25, 60, 1000][rng.below(3)]);
        (PoseFileParams { path: "way.csv".into(), rate }, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    fn standalone(text: &str) -> Standalone {
        let mut standalone =
            Standalone::new::<PoseFile>(PoseFileParams { path: "way.csv".into(), rate: Rate::hz(10) });
        standalone.files.insert("way.csv", text);
        standalone
    }

    #[test]
    fn poses_are_at_their_times() {
        let poses =
            standalone("time_s,x,y,z\n0,0,0,0\n0.5,5,0,0\n").run().unwrap().stream(PoseFilePorts::pose);
        let x: Vec<f32> = poses.iter().map(|pose| pose.position[0].round()).collect();
        assert_eq!(x, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn a_wrong_line_is_named_before_the_run() {
        let reject = standalone("time_s,x,y,z\n0,0,up,0\n").shape().unwrap_err();
        assert!(reject.code == "F067" && reject.message.contains("line 2"), "{reject}");
    }
}
