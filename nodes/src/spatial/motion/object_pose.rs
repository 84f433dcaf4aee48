//! The node `ObjectPose`.

use super::item::Poses;
use super::pose::{MAX_COORDINATE, Pose, unit};
use super::pose_track::PoseTrack;
use crate::contact::vector::{Vec3, cross, norm};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::{AssetPath, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::mesh::alembic::writer;
use crate::mesh::animation_file::{Assets, Format, Span, gltf_selection, output_rate, read_gltf, reject};
use crate::mesh::{MeshError, MeshLimits, ObjectMotion, UpAxis, alembic, gltf, rate_difference};
use crate::{params, ports};
use std::sync::Arc;

params! {
    /// Reads the poses of an object of a scene: of a mesh, an empty, a camera or a joint in glTF or GLB, of a transform in Alembic (Ogawa).
    ///
    /// The pose is that of the object in the scene: the transforms of all objects above it apply, and its own. With `up: Y`, (x, y, z) of the
    /// file becomes (x, -z, y) in the scene, as for the meshes of a `MeshSequence` and the joints of a `BvhPose`, and the z axis of the object
    /// is its front, its y axis its top, as in glTF. A camera looks against its z axis, so it sees what is behind its pose.
    ///
    /// A pose has no scale. Its front is that of the object, and its top that of the object without what lies along the front, if there is
    /// shear. The left and right sides of a mirrored object are exchanged. While its scale is 0 an object keeps its last orientation.
    ///
    /// The frames are the samples of the transforms in Alembic, and the keys in glTF; with `rate`, the animation of a glTF is evaluated at the
    /// rate. Between frames positions are interpolated linearly and orientations by slerp. The stream ends at the last frame. An object
    /// without animation has one pose and never ends: a body that others move about.
    ///
    /// # Source
    /// glTF 2.0 (Khronos, ISO/IEC 12113); Golub and Van Loan, "Matrix Computations" (4th edition, 2013), 5.2.7: Gram-Schmidt
    /// orthogonalisation.
    pub struct ObjectPoseParams {
        /// The file.
        path: AssetPath;
        /// Name of the object: an Alembic path or the end of one, a glTF node or mesh. None selects the only object that is animated itself.
        object: Option<Text> = None;
        /// Name of the animation of a glTF; None for the first.
        animation: Option<Text> = None;
        /// Poses per second. None takes the standard rate of the times in the file, and 60 for an object without animation.
        rate: Option<Rate> = None;
        /// Length of one unit of the file, for example 0.01 for centimetres.
        metres_per_unit: f64 = 1.0, unit "m", range 0.000001..=1000000.0;
        /// The axis that points upward in the file; it becomes Z. None takes the convention of the format: Y.
        up: Option<UpAxis> = None;
        /// Time in the file at which the stream starts; None for its first frame. Before the first frame and after the last the object
        /// does not move.
        start: Option<f64> = None, unit "s", range -86400.0..=86400.0;
        /// Length of the stream; None ends at the last frame.
        duration: Option<f64> = None, unit "s", range 0.0..=86400.0;
    }
}
ports! {
    pub struct ObjectPosePorts / ObjectPoseIo {
        in {}
        out {
            /// The poses.
            pose: Stream<Poses>,
        }
    }
}

/// Sine of the least angle between front and top that defines an orientation.
const MIN_SINE: f64 = 1e-6;

/// Front and top of an object in the axes of the file; `None` if its scale is 0 or its axes are parallel.
fn front_and_top(motion: &ObjectMotion, frame: usize, up: UpAxis) -> Option<[Vec3; 2]> {
    let [front, top] = up.front_and_top();
    let (front, top) = (unit(motion.direction(frame, front)?)?, unit(motion.direction(frame, top)?)?);
    (norm(cross(front, top)) > MIN_SINE).then_some([front, top])
}

/// Poses of an object, one for each frame. `unit` is the length of a unit of the file in m.
///
/// # Errors
/// The first frame that is farther than [`MAX_COORDINATE`] from the origin.
fn poses(motion: &ObjectMotion, up: UpAxis, unit: f64) -> Result<Vec<Pose>, usize> {
    let frames = 0..motion.times().len();
    let first = frames.clone().find_map(|frame| front_and_top(motion, frame, up));
    let mut axes = first.unwrap_or(up.front_and_top());
    let mut pose = |frame: usize| {
        axes = front_and_top(motion, frame, up).unwrap_or(axes);
        let pose = Pose::of_file(motion.position(frame, [0.0; 3])?, axes, up, unit)?;
        pose.is_near().then_some(pose)
    };
    frames.map(|frame| pose(frame).ok_or(frame)).collect()
}

/// The poses of one object from the start of the stream on, and the rate and the number of items of the stream.
#[derive(Debug)]
struct ObjectTrack {
    poses: PoseTrack,
    rate: Rate,
    /// Description of the difference between the times of the file and the rate.
    difference: Option<String>,
    /// `None` if the stream never ends.
    items: Option<i64>,
}

impl ObjectTrack {
    fn read(p: &ObjectPoseParams, assets: &mut dyn Assets) -> Result<Self, Reject> {
        let path = p.path.0.as_str();
        let of_file = |e: Reject| Reject { message: format!("{path:?}: {}", e.message), ..e };
        let (motion, up) = read_motion(p, assets)?;
        let motion = motion.map_err(|e| of_file(reject("path", &e)))?;
        let (up, times) = (p.up.unwrap_or(up), motion.times());
        let poses = poses(&motion, up, p.metres_per_unit).map_err(|frame| {
            let message = format!(
                "{path:?}: {:?} is farther than {MAX_COORDINATE:e} m from the origin in frame {frame}",
                motion.object()
            );
            let rejection = Reject::new("F067", message).at("metres_per_unit");
            rejection.help("give the length of a unit of the file in m")
        })?;
        let rate = output_rate(times, p.rate, "rate").map_err(of_file)?;
        let items = Span { start: p.start, duration: p.duration }.items(times, rate).map_err(of_file)?;
        let start = p.start.unwrap_or(times[0]);
        let difference = rate_difference(motion.file_times(), rate, "rate");
        let poses = PoseTrack::at_times(times.iter().map(|t| t - start).zip(poses));
        Ok(Self { poses, rate, difference, items })
    }
}

/// The motion of the object in the file, and the axis that points upward by the convention of its format.
fn read_motion(
    p: &ObjectPoseParams,
    assets: &mut dyn Assets,
) -> Result<(Result<ObjectMotion, MeshError>, UpAxis), Reject> {
    let (path, limits) = (p.path.0.as_str(), MeshLimits::default());
    let mut file = assets.open("path", path)?;
    let format = Format::detect(&mut *file, path)?;
    let motion = match format {
        Format::Alembic => {
            alembic::object_motion(file, p.object.as_ref().map(|name| name.0.as_str()), &limits)
        }
        Format::Gltf => {
            let selection = gltf_selection(p.object.as_ref(), p.animation.as_ref(), p.rate);
            read_gltf(path, assets, |bytes, resolve| {
                gltf::object_motion(bytes, &selection, resolve, &limits)
            })?
        }
        Format::Pc2 | Format::Mdd | Format::Obj | Format::ObjSequence => {
            let message = format!("{path:?} is a mesh, which has no transforms of objects");
            return Err(Reject::new("F070", message)
                .at("path")
                .help("use Alembic (.abc) or glTF (.glb), or a `MeshSequence` and `VertexPose`"));
        }
    };
    Ok((motion, format.up_axis()))
}

/// The node over [`ObjectMotion`].
#[derive(Debug)]
pub struct ObjectPose {
    track: Arc<ObjectTrack>,
}

impl Node for ObjectPose {
    type Params = ObjectPoseParams;
    type Ports = ObjectPosePorts;
    const NAME: &'static str = "ObjectPose";
    const CLASS: Class = Class::Audio;

    fn shape(p: &ObjectPoseParams, s: &mut Shape<'_, '_, ObjectPosePorts>) -> Result<(), Reject> {
        let track = ObjectTrack::read(p, s)?;
        track.difference.iter().for_each(|note| s.note(note));
        s.ends(track.items.map(|items| track.rate.tick(items)));
        s.output(ObjectPosePorts::pose, track.rate, ());
        s.prepare(track);
        Ok(())
    }

    fn build(p: &ObjectPoseParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let track = match cx.prepared::<ObjectTrack>() {
            Some(cached) => cached,
            None => Arc::new(ObjectTrack::read(p, &mut { cx })?),
        };
        Ok(Self { track })
    }

    fn run(&mut self, mut io: ObjectPoseIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.pose.first(), io.pose.rate());
        self.track.poses.fill(first, rate, io.pose.items());
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (ObjectPoseParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let path = ["arm.abc", "arm.gltf"][usize::from(cfg!(feature = "gltf")) * rng.below(2)];
        let frames = 1 + rng.below(20);
        if path == "arm.abc" {
            files.insert(path, trial_archive(frames, rng));
        } else {
            let (json, keys) = trial_gltf(frames, rng);
            files.insert(path, json);
            files.insert("keys.bin", keys);
        }
        let p = ObjectPoseParams {
            path: path.into(),
            object: [None, Some("arm".into()), Some("hand".into())][rng.below(3)].clone(),
            animation: None,
            rate: [None, Some(Rate::hz(60)), Some(Rate::hz(1000))][rng.below(3)],
            metres_per_unit: [0.01, 1.0][rng.below(2)],
            up: [None, Some(UpAxis::Y), Some(UpAxis::Z)][rng.below(3)],
            start: None,
            duration: [None, Some(0.1)][rng.below(2)],
        };
        (p, files)
    }
}

/// An archive with a hand that has a constant offset from an arm, which moves and rotates at 24 Hz.
fn trial_archive(frames: usize, rng: &mut Rng) -> Vec<u8> {
    let mut values = || {
        let mut position: Vec<f64> = (0..3).map(|_| rng.between(-2.0, 2.0)).collect();
        position.push(rng.between(-180.0, 180.0));
        position
    };
    let moving = (0..frames).map(|_| values()).collect();
    let hand = writer::object(vec![writer::xform(&[0x10], vec![vec![0.0, 0.5, 0.1]], 1)], vec![]);
    let arm = writer::object(vec![writer::xform(&[0x10, 0x50], moving, 1)], vec![("hand", hand)]);
    writer::archive(writer::object(vec![], vec![("arm", arm)]), &[0.0], 1.0 / 24.0)
}

/// The same motion about one axis as a glTF, and its buffer: the times, translations and rotations of the keys.
fn trial_gltf(frames: usize, rng: &mut Rng) -> (String, Vec<u8>) {
    let mut keys: Vec<f32> = (0..frames).map(|k| k as f32 / 24.0).collect();
    keys.extend((0..3 * frames).map(|_| rng.between(-2.0, 2.0) as f32));
    for _ in 0..frames {
        let half = rng.between(-1.5, 1.5);
        keys.extend([0.0, libm::sin(half) as f32, 0.0, libm::cos(half) as f32]);
    }
    let (first, second, end) = (4 * frames, 16 * frames, 32 * frames);
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"uri": "keys.bin", "byteLength": {end}}}],
            "bufferViews": [{{"buffer": 0, "byteLength": {first}}},
                {{"buffer": 0, "byteOffset": {first}, "byteLength": {}}}, {{"buffer": 0, "byteOffset": {second}, "byteLength": {second}}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "type": "SCALAR", "count": {frames}}},
                {{"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": {frames}}},
                {{"bufferView": 2, "componentType": 5126, "type": "VEC4", "count": {frames}}}],
            "nodes": [{{"name": "arm", "children": [1]}}, {{"name": "hand", "translation": [0, 0.5, 0.1]}}],
            "animations": [{{"samplers": [{{"input": 0, "output": 1}}, {{"input": 0, "output": 2}}],
                "channels": [{{"sampler": 0, "target": {{"node": 0, "path": "translation"}}}},
                    {{"sampler": 1, "target": {{"node": 0, "path": "rotation"}}}}]}}]}}"#,
        second - first
    );
    (json, keys.into_iter().flat_map(f32::to_le_bytes).collect())
}

#[cfg(test)]
mod tests;
