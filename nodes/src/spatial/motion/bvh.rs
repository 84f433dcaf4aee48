//! Motion capture files in the format BVH: a skeleton, and the values of its channels in frames.
//!
//! # Source
//! Meredith and Maddock, "Motion Capture File Formats Explained" (University of Sheffield, CS-01-11, 2001).

mod reader;

use super::pose::Pose;
use crate::core::time::Rate;
use crate::mesh::UpAxis;
use thiserror::Error;

/// Frame rates that a frame time stands for if its rounding allows.
const STANDARD_RATES: [u64; 11] = [24, 25, 30, 48, 50, 60, 100, 120, 200, 240, 300];
/// The standard rates that have a variant at 1000/1001 of their value.
const FILM_RATES: [u64; 6] = [24, 30, 48, 60, 120, 240];
/// Largest deviation of a frame rate from a standard rate, relative.
const RATE_TOLERANCE: f64 = 5e-4;

/// The reason why a BVH file cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {message}")]
pub struct BvhError {
    /// Line of the file, from 1.
    pub line: u64,
    /// The value found, and what is needed.
    pub message: String,
}

/// A degree of freedom of a joint, with its axis: 0 for x, 1 for y, 2 for z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvhChannel {
    /// A translation along the axis, in units of the file.
    Position(usize),
    /// A rotation about the axis, in degrees.
    Rotation(usize),
}

impl BvhChannel {
    /// Names of all channels.
    const ALL: [(&'static str, Self); 6] = [
        ("Xposition", Self::Position(0)),
        ("Yposition", Self::Position(1)),
        ("Zposition", Self::Position(2)),
        ("Xrotation", Self::Rotation(0)),
        ("Yrotation", Self::Rotation(1)),
        ("Zrotation", Self::Rotation(2)),
    ];
}

/// A joint of a skeleton, or the end of its last bone.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhJoint {
    /// Its name; for the end of a bone (`End Site`) that of its joint, followed by `/end`.
    pub name: String,
    /// The joint above it in the hierarchy, which has a smaller index; `None` for the root.
    pub parent: Option<usize>,
    /// Its position in the axes of its parent, in units of the file.
    pub offset: [f64; 3],
    /// Its channels, in the order of the file.
    pub channels: Vec<BvhChannel>,
    /// Index of its first channel in a frame.
    first: usize,
}

/// A skeleton and its motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    joints: Vec<BvhJoint>,
    frames: usize,
    frame_time: f64,
    /// The channels of all joints, frame by frame.
    values: Vec<f32>,
}

impl Bvh {
    /// Reads a file.
    ///
    /// Blanks, tabs and line ends of any kind separate words, but each frame is a line of its own. Keywords and names of channels may
    /// have any case. Joint names extend to the end of their line or to the brace, and may contain blanks. An `End Site` becomes the
    /// joint `<parent>/end`, a second one of the same joint `<parent>/end2`.
    ///
    /// # Errors
    /// More than one root, a joint without `OFFSET` or `CHANNELS`, no channel at all, a number that is missing, not finite or beyond
    /// 1e9, a frame time that is not between 10 us and 100 s, no frame, and rows or values that are missing or too many. At most 4096
    /// joints, 64 channels each, 2^22 frames and 2^26 values are read. The error states the line and what would be right.
    ///
    /// # Complexity
    /// Linear in the length of the file; 4 bytes a value.
    ///
    /// # Example
    /// ```
    /// use foley_nodes::{mesh::UpAxis, spatial::motion::bvh::Bvh};
    ///
    /// let bvh = Bvh::read(
    ///     b"HIERARCHY
    ///     ROOT Hips { OFFSET 0 0 0 CHANNELS 4 Xposition Yposition Zposition Yrotation
    ///         JOINT Head { OFFSET 0 0.5 0.1 CHANNELS 0 }
    ///     }
    ///     MOTION Frames: 1 Frame Time: 0.04
    ///     0 1 3 90",
    /// )?;
    /// let pose = bvh.pose(1, 0, 1.0, UpAxis::Y);
    /// assert_eq!(pose.map(|pose| pose.position), Some([0.1, -3.0, 1.5]));
    /// # Ok::<(), foley_nodes::spatial::motion::bvh::BvhError>(())
    /// ```
    pub fn read(bytes: &[u8]) -> Result<Self, BvhError> {
        reader::read(bytes)
    }

    /// The joints, each after its parent; the first is the root.
    #[must_use]
    pub fn joints(&self) -> &[BvhJoint] {
        &self.joints
    }

    /// The number of frames, at least 1.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// The time between frames as it is written in the file, in s.
    #[must_use]
    pub fn frame_time(&self) -> f64 {
        self.frame_time
    }

    /// Returns the frame rate: the nearest standard rate within 0.05 %, since files round the frame time to a few digits, or else its
    /// inverse.
    ///
    /// Standard rates are 24, 25, 30, 48, 50, 60, 100, 120, 200, 240, 300 Hz and 1000/1001 of 24, 30, 48, 60, 120, 240 Hz.
    #[must_use]
    pub fn rate(&self) -> Option<Rate> {
        let hz = 1.0 / self.frame_time;
        let deviation = |rate: &Rate| (hz / rate.as_f64() - 1.0).abs();
        STANDARD_RATES
            .iter()
            .map(|rate| (*rate, 1))
            .chain(FILM_RATES.iter().map(|rate| (1000 * rate, 1001)))
            .filter_map(|(num, den)| Rate::new(num, den))
            .filter(|rate| deviation(rate) < RATE_TOLERANCE)
            .min_by(|a, b| deviation(a).total_cmp(&deviation(b)))
            .or_else(|| Rate::from_f64(hz))
    }

    /// Returns the index of the joint of a name: exactly, or else the only one with that name in another case, or else the only one
    /// with that name after a namespace, such as `Hips` for `mixamorig:Hips`.
    #[must_use]
    pub fn joint(&self, name: &str) -> Option<usize> {
        let only = |is_match: &dyn Fn(&str) -> bool| {
            let mut found = self.joints.iter().enumerate().filter(|(_, joint)| is_match(&joint.name));
            let (k, _) = found.next()?;
            found.next().is_none().then_some(k)
        };
        let exact = self.joints.iter().position(|joint| joint.name == name);
        exact.or_else(|| only(&|joint| joint.eq_ignore_ascii_case(name))).or_else(|| {
            only(&|joint| joint.rsplit_once(':').is_some_and(|(_, end)| end.eq_ignore_ascii_case(name)))
        })
    }

    /// The values of the channels of a joint in a frame.
    fn row(&self, joint: &BvhJoint, frame: usize) -> Option<&[f32]> {
        let frame = self.values.chunks((self.values.len() / self.frames.max(1)).max(1)).nth(frame)?;
        frame.get(joint.first..joint.first + joint.channels.len())
    }

    /// Returns the value of a channel of a joint, by its index in the joint: a length in units of the file, or an angle in degrees.
    #[must_use]
    pub fn channel(&self, joint: usize, channel: usize, frame: usize) -> Option<f64> {
        self.row(self.joints.get(joint)?, frame)?.get(channel).map(|x| f64::from(*x))
    }

    /// Returns the position and orientation of a joint in the scene, by forward kinematics. Returns `None` if there is no such joint or
    /// frame.
    ///
    /// A point of a joint has the coordinates `offset + positions + R point` in its parent, where `R` is the product of the rotations in
    /// the order of the channels. `scale` is the length of a unit of the file in m.
    ///
    /// With `up` Y, `(x, y, z)` of the file becomes `(x, -z, y)` in the scene, as [`UpAxis::convert`] has it, and the front of a joint is its z
    /// axis, its left the x axis and its top the y axis. With `up` Z coordinates do not change, and the front of a joint is its x axis.
    ///
    /// # Complexity
    /// Linear in the number of joints above the joint.
    #[must_use]
    pub fn pose(&self, joint: usize, frame: usize, scale: f64, up: UpAxis) -> Option<Pose> {
        let (mut position, mut axes) = ([0.0; 3], up.front_and_top());
        let mut next = Some(self.joints.get(joint)?);
        while let Some(joint) = next {
            let values = self.row(joint, frame)?;
            // The last rotation acts first on a column vector.
            for (channel, value) in joint.channels.iter().zip(values).rev() {
                if let BvhChannel::Rotation(axis) = channel {
                    let angle = f64::from(*value).to_radians();
                    let turn = (libm::sin(angle), libm::cos(angle));
                    position = turned(position, *axis, turn);
                    axes = axes.map(|v| turned(v, *axis, turn));
                }
            }
            for (k, coordinate) in position.iter_mut().enumerate() {
                let moves = joint.channels.iter().zip(values).filter(|(c, _)| **c == BvhChannel::Position(k));
                *coordinate += joint.offset[k] + moves.map(|(_, x)| f64::from(*x)).sum::<f64>();
            }
            next = joint.parent.and_then(|parent| self.joints.get(parent));
        }
        Pose::of_file(position, axes, up, scale)
    }
}

/// Rotates a vector about a coordinate axis, by an angle given as sine and cosine.
fn turned(v: [f64; 3], axis: usize, (sin, cos): (f64, f64)) -> [f64; 3] {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut out = v;
    out[a] = cos * v[a] - sin * v[b];
    out[b] = sin * v[a] + cos * v[b];
    out
}

#[cfg(test)]
mod tests;
