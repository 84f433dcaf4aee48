//! The node `MeshSequence`: animated meshes from files as a source of motion.

use std::path::Path;
use std::sync::Arc;

use super::animation_file::{Assets, Format, Span, gltf_selection, output_rate, read_gltf, reject};
use super::{
    FrameReader, FrameSampler, Materials, Mesh, MeshClip, MeshError, MeshFormat, MeshStream, ObjMesh,
    ReadOptions, Topology, UpAxis, alembic, gltf, open_mdd, open_obj_sequence, open_pc2, rate_difference,
};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{AssetPath, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{choices, params, ports};

choices! { @param UpAxis {
    /// Y points upward, the convention of Alembic and glTF.
    Y,
    /// Z points upward.
    Z,
} }

params! {
    /// An animated mesh from a file, frame by frame.
    ///
    /// Reads Alembic (Ogawa), PC2 and MDD point caches, Wavefront OBJ, numbered OBJ sequences, and glTF or GLB. The content
    /// of the file determines the format, then the extension of its name. Frames whose times do not lie on the rate of
    /// the output are interpolated linearly in time. A mesh with one frame is static and never ends: a body that others
    /// touch.
    ///
    /// The faces must be the same in all frames. Vertices are never merged. Z points upward in the output.
    ///
    /// # Source
    /// PC2: Autodesk's point cache of 3ds Max; MDD: LightWave's motion designer; glTF 2.0 (Khronos, ISO/IEC 12113).
    pub struct MeshSequenceParams {
        /// The animation: one file, or a pattern such as `frame_####.obj` whose `#` characters stand for the frame number.
        path: AssetPath;
        /// OBJ with the faces and the rest pose of a PC2 or MDD; the other formats contain them. None reads the OBJ of the
        /// same name in the same folder: `x.obj` for `x.pc2`.
        base: Option<AssetPath> = None;
        /// Name of the mesh in the file: an Alembic path or the end of one, a glTF node or mesh, an OBJ object or group. None
        /// selects the mesh with the most vertices, and all faces of an OBJ.
        object: Option<Text> = None;
        /// Name of the animation of a glTF; None for the first.
        animation: Option<Text> = None;
        /// Frames per second. A PC2 or OBJ sequence needs it, since such files have no times. None takes the standard rate
        /// of the times in the file, and 60 for a static mesh.
        fps: Option<Rate> = None;
        /// Length of one unit of the file, for example 0.01 for centimetres.
        metres_per_unit: f64 = 1.0, unit "m", range 0.000001..=1000000.0;
        /// Name of the material of faces without one in the file; an OBJ has a material per face (`usemtl`), also for a point
        /// cache.
        material: Text = "".into();
        /// The axis that points upward in the file; it becomes Z. None takes the convention of the format: Y in Alembic and
        /// glTF, Z in all others.
        up: Option<UpAxis> = None;
        /// Time in the file at which the stream starts; None for its first frame. Before the first frame and after the last the mesh
        /// does not move.
        start: Option<f64> = None, unit "s", range -86400.0..=86400.0;
        /// Length of the stream; None ends at the last frame.
        duration: Option<f64> = None, unit "s", range 0.0..=86400.0;
    }
}

ports! {
    pub struct MeshSequencePorts / MeshSequenceIo {
        in {}
        out {
            /// The moving mesh, in metres.
            mesh: Stream<Mesh>,
        }
    }
}

/// The node `MeshSequence`.
pub struct MeshSequence {
    frames: Box<dyn FrameReader>,
    sampler: FrameSampler,
    start: f64,
}

fn open(p: &MeshSequenceParams, assets: &mut dyn Assets) -> Result<(MeshStream, Format), Reject> {
    let options = ReadOptions { metres_per_unit: p.metres_per_unit, ..ReadOptions::default() };
    let (path, object) = (p.path.0.as_str(), p.object.as_ref().map(|name| name.0.as_str()));
    let file = if path.contains('#') { None } else { Some(assets.open("path", path)?) };
    let (format, file) = match file {
        None => (Format::ObjSequence, None),
        Some(mut file) => (Format::detect(&mut *file, path)?, Some(file)),
    };
    let file = file.unwrap_or_else(|| Box::new(std::io::empty()));
    let failed = |e: MeshError| reject("path", &e);
    let stream = match format {
        Format::Alembic => alembic::open(file, object, &options).map_err(failed)?,
        Format::Pc2 => {
            let base = base(p, "PC2", assets, &options)?;
            open_pc2(file, &base, required_rate(p, "a PC2 file")?.as_f64(), &options).map_err(failed)?
        }
        Format::Mdd => {
            let base = base(p, "MDD", assets, &options)?;
            open_mdd(file, &base, &options).map_err(failed)?
        }
        Format::Obj => {
            let frames = assets.frames(vec![path.to_owned()])?;
            open_obj_sequence(frames, vec![0.0], object, &options).map_err(|e| match e {
                MeshError::Frame { source, .. } => reject("path", &source),
                e => reject("path", &e),
            })?
        }
        Format::ObjSequence => {
            let paths = assets.sequence(path)?;
            let rate = required_rate(p, "an OBJ sequence")?.as_f64();
            let times = (0..paths.len()).map(|k| k as f64 / rate).collect();
            open_obj_sequence(assets.frames(paths)?, times, object, &options).map_err(failed)?
        }
        Format::Gltf => {
            let selection = gltf_selection(p.object.as_ref(), p.animation.as_ref(), p.fps);
            read_gltf(path, assets, |bytes, resolve| gltf::open(bytes, &selection, resolve, &options))?
                .map_err(failed)?
        }
    };
    Ok((stream.with_up_axis(up_axis(p, format), UpAxis::Z), format))
}

/// The upward axis of the file.
fn up_axis(p: &MeshSequenceParams, format: Format) -> UpAxis {
    p.up.unwrap_or(format.up_axis())
}

/// The OBJ with the faces and the rest pose of a point cache.
fn base(
    p: &MeshSequenceParams,
    format: &str,
    assets: &mut dyn Assets,
    options: &ReadOptions,
) -> Result<ObjMesh, Reject> {
    let bytes = match &p.base {
        Some(base) => assets.bytes("base", &base.0)?,
        None => {
            let default = Path::new(&p.path.0).with_extension("obj").to_string_lossy().into_owned();
            assets.bytes("base", &default).map_err(|e| {
                let path = &p.path.0;
                let message = format!(
                    "{path:?} is a {format} file, which has positions but no faces, and the OBJ of the same name cannot be read: {}",
                    e.message
                );
                Reject::new("F070", message)
                    .at("base")
                    .help("set `base` to the OBJ of the same mesh, with its vertices in the same order")
            })?
        }
    };
    let name = p.object.as_ref().map(|name| name.0.as_str());
    ObjMesh::parse(&bytes, name, &options.limits).map_err(|e| reject("base", &e))
}

/// The parameter `fps`, which a format without times requires.
fn required_rate(p: &MeshSequenceParams, what: &str) -> Result<Rate, Reject> {
    p.fps.ok_or_else(|| {
        let message = format!("{what} does not state its frame rate");
        Reject::new("F071", message).at("fps").help("set `fps`, for example `fps: 60`")
    })
}

/// Describes how the times of a file differ from the rate of the stream.
fn time_notes(format: Format, clip: &MeshClip, rate: Rate) -> Option<String> {
    match (format, clip.times()) {
        (Format::ObjSequence, _) => None,
        // Its header counts in frames, whose rate is `fps`.
        (Format::Pc2, [first, second, ..]) => {
            let (fps, step) = (rate.as_f64(), (second - first) * rate.as_f64());
            let (rounded, samples) = ((step * 1e3).round() / 1e3, (fps / step * 1e3).round() / 1e3);
            ((step - 1.0).abs() > 1e-3).then(|| {
                format!(
                    "the header of the PC2 has a sample every {rounded} frames: at `fps: {fps}` these are {samples} samples a second, \
                     and {} of them last {:.3} s; if {fps} is the rate of the samples themselves, set `fps: {}`",
                    clip.frame_count(),
                    clip.duration(),
                    (fps * step * 1e3).round() / 1e3
                )
            })
        }
        _ => rate_difference(clip.file_times(), rate, "fps"),
    }
}

/// Topology, materials and upward axis of a file, for a mesh whose motion has another source.
pub(crate) fn rest_mesh<P>(
    p: &MeshSequenceParams,
    s: &mut Shape<'_, '_, P>,
) -> Result<(Topology, Materials, UpAxis), Reject> {
    let (MeshStream { clip, .. }, format) = open(p, s)?;
    Ok((
        clip.topology().clone(),
        clip.materials().clone().with_default_name(&p.material.0),
        up_axis(p, format),
    ))
}

impl Node for MeshSequence {
    type Params = MeshSequenceParams;
    type Ports = MeshSequencePorts;
    const NAME: &'static str = "MeshSequence";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Io;
    const COST: f64 = 20.0;

    fn shape(p: &MeshSequenceParams, s: &mut Shape<'_, '_, MeshSequencePorts>) -> Result<(), Reject> {
        let (mut stream, format) = open(p, s)?;
        if p.base.is_some() && !matches!(format, Format::Pc2 | Format::Mdd) {
            s.note(format!("`base` has no effect: {:?} contains its own faces", p.path.0));
        }
        let clip = &stream.clip;
        if !clip.other_meshes().is_empty() {
            s.note(format!(
                "the file has several meshes; the one with the most vertices is read. Others: {}",
                clip.other_meshes().join(", ")
            ));
        }
        if clip.dropped_faces() > 0 {
            s.note(format!("{} faces with fewer than three vertices were left out", clip.dropped_faces()));
        }
        let times = clip.times();
        let rate = output_rate(times, p.fps, "fps")?;
        time_notes(format, clip, rate).into_iter().for_each(|note| s.note(note));
        let items = Span { start: p.start, duration: p.duration }.items(times, rate)?;
        let (is_static, mut topology) = (times.len() == 1, clip.topology().clone());
        if is_static {
            // Its only frame is its rest pose; the OBJ of a point cache can have another pose.
            stream.frames.read_frame(0, &mut topology.rest).map_err(|e| reject("path", &e))?;
        }
        let topology = Arc::new(topology);
        let materials = Arc::new(stream.clip.materials().clone().with_default_name(&p.material.0));
        s.output(MeshSequencePorts::mesh, rate, MeshFormat { topology, is_static, materials });
        s.ends(items.map(|items| rate.tick(items)));
        Ok(())
    }

    fn build(p: &MeshSequenceParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (stream, _) = open(p, &mut { cx })?;
        let start = p.start.unwrap_or(stream.clip.times()[0]);
        Ok(Self { sampler: FrameSampler::new(&stream.clip), frames: stream.frames, start })
    }

    fn run(&mut self, mut io: MeshSequenceIo<'_>) -> Result<(), Fault> {
        let (first, width, rate) = (io.mesh.first(), io.mesh.width(), io.mesh.rate());
        for (index, frame) in (first..).zip(io.mesh.items().chunks_exact_mut(width.max(1))) {
            let time = self.start + index as f64 * rate.den() as f64 / rate.num() as f64;
            self.sampler
                .sample(&mut *self.frames, time, frame)
                .map_err(|e| Fault::from(reject("path", &e)).when(rate.tick(index)))?;
        }
        Ok(())
    }

    fn finish(&mut self, _: MeshSequenceIo<'_>) -> Result<Summary, Fault> {
        Ok(Summary::new())
    }

    fn trial(rng: &mut Rng) -> (MeshSequenceParams, MemoryFiles) {
        let obj = |lift: usize| format!("v 0 0 {lift}\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 4 3\n");
        let mut files = MemoryFiles::default();
        let path = ["still.obj", "frame_####.obj"][rng.below(2)];
        files.insert("still.obj", obj(0));
        (1..5).for_each(|k| files.insert(format!("frame_{k:04}.obj"), obj(k)));
        let mut params = <MeshSequenceParams as crate::core::params::Params>::trial(rng);
        params =
            MeshSequenceParams { path: path.into(), base: None, object: None, animation: None, ..params };
        params.fps = Some(params.fps.unwrap_or(Rate::hz(30)));
        params.start = params.start.map(|start| (start / 1e5).abs());
        params.duration = params.duration.map(|duration| duration % 1.0);
        // Without a duration the start must precede the last frame.
        params.start = params.duration.and(params.start);
        (params, files)
    }
}

#[cfg(test)]
mod tests;
