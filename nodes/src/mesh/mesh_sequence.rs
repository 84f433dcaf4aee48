//! The node `MeshSequence`: animated meshes from files as a source of motion.

use std::io::{Read, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use super::{
    FrameReader, FrameSampler, Materials, Mesh, MeshError, MeshFormat, MeshStream, ObjMesh, OpenFrame,
    ReadOptions, Topology, UpAxis, alembic, gltf, nominal_rate, open_mdd, open_obj_sequence, open_pc2,
};
use crate::core::fault::{Fault, Reject};
use crate::core::files::{Files, MemoryFiles, ReadSeek};
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
        /// Name of the mesh in the file: an Alembic path, a glTF node or mesh, an OBJ object or group. None selects the
        /// mesh with the most vertices, and all faces of an OBJ.
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

/// Access to files that `shape` and `build` have in common.
trait Assets {
    fn open(&mut self, field: &str, path: &str) -> Result<Box<dyn ReadSeek>, Reject>;
    fn sequence(&mut self, path: &str) -> Result<Vec<String>, Reject>;
    /// Opens the files of a sequence by frame; in `shape` only the first one.
    fn frames(&mut self, paths: Vec<String>) -> Result<OpenFrame, Reject>;

    fn bytes(&mut self, field: &str, path: &str) -> Result<Vec<u8>, Reject> {
        let mut all = Vec::new();
        match self.open(field, path)?.read_to_end(&mut all) {
            Ok(_) => Ok(all),
            Err(e) => Err(Reject::new("F061", format!("cannot read {path:?}: {e}")).at(field)),
        }
    }
}

impl<P> Assets for Shape<'_, '_, P> {
    fn open(&mut self, field: &str, path: &str) -> Result<Box<dyn ReadSeek>, Reject> {
        Shape::open(self, field, path)
    }

    fn sequence(&mut self, path: &str) -> Result<Vec<String>, Reject> {
        Ok(Shape::sequence(self, "path", path)?.into_iter().map(|(_, file)| file).collect())
    }

    fn frames(&mut self, paths: Vec<String>) -> Result<OpenFrame, Reject> {
        // Only the first frame is read before the run.
        let first = Assets::bytes(self, "path", paths.first().map_or("", String::as_str))?;
        Ok(Box::new(move |_| Ok(first.clone())))
    }
}

impl Assets for &Build<'_> {
    fn open(&mut self, field: &str, path: &str) -> Result<Box<dyn ReadSeek>, Reject> {
        self.files.open(path).map_err(|e| Reject::new(e.code, e.message).at(field))
    }

    fn sequence(&mut self, path: &str) -> Result<Vec<String>, Reject> {
        let found = self.files.sequence(path);
        let found = found.map_err(|e| Reject::new(e.code, e.message).at("path"))?;
        Ok(found.into_iter().map(|(_, file)| file).collect())
    }

    fn frames(&mut self, paths: Vec<String>) -> Result<OpenFrame, Reject> {
        let (files, paths): (Arc<dyn Files>, _) = match self.files.shared() {
            Some(files) => (files, paths),
            None => {
                let mut memory = MemoryFiles::default();
                for path in &paths {
                    memory.insert(path, Assets::bytes(self, "path", path)?);
                }
                (Arc::new(memory), paths)
            }
        };
        Ok(Box::new(move |frame| {
            let path = paths.get(frame).ok_or(std::io::ErrorKind::NotFound)?;
            files.bytes(path).map_err(|e| std::io::Error::other(e.message))
        }))
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    Alembic,
    Pc2,
    Mdd,
    Obj,
    ObjSequence,
    Gltf,
}

fn reject(field: &str, error: &MeshError) -> Reject {
    let rejection = Reject::new("F070", error.to_string());
    match error {
        MeshError::AmbiguousMesh { available } | MeshError::NoSuchMesh { available, .. } => {
            let example = available.last().map_or("name", String::as_str);
            rejection.at("object").help(format!("set `object`, for example `object: {example:?}`"))
        }
        MeshError::NoSuchAnimation { available, .. } => {
            let first = available.first().map(|name| format!("set `animation: {name:?}`, or "));
            rejection
                .at("animation")
                .help(format!("{}leave it out to use the first one", first.unwrap_or_default()))
        }
        _ => rejection.at(field),
    }
}

/// Format of a file by its first bytes, otherwise by the extension of its name.
fn detect_format(file: &mut dyn ReadSeek, path: &str) -> Result<Format, Reject> {
    let mut head = Vec::new();
    let read = file.take(64).read_to_end(&mut head).and_then(|_| file.seek(SeekFrom::Start(0)));
    read.map_err(|e| Reject::new("F061", format!("cannot read {path:?}: {e}")).at("path"))?;
    let extension =
        path.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase()).unwrap_or_default();
    let json = head.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
    Ok(match (&head[..], extension.as_str()) {
        ([b'O', b'g', b'a', b'w', b'a', ..], _) | (_, "abc") => Format::Alembic,
        (bytes, _) if bytes.starts_with(b"POINTCACHE2") => Format::Pc2,
        (bytes, _) if bytes.starts_with(b"glTF") || json => Format::Gltf,
        (_, "pc2") => Format::Pc2,
        (_, "mdd") => Format::Mdd,
        (_, "obj") => Format::Obj,
        (_, "gltf" | "glb") => Format::Gltf,
        _ => {
            let message = format!("{path:?} is not an animation in a known format");
            return Err(Reject::new("F070", message).at("path").help(
                "use Alembic (.abc), PC2, MDD, OBJ, a sequence such as \"frame_####.obj\", or glTF (.glb)",
            ));
        }
    })
}

fn open(p: &MeshSequenceParams, assets: &mut dyn Assets) -> Result<(MeshStream, Format), Reject> {
    let options = ReadOptions { metres_per_unit: p.metres_per_unit, ..ReadOptions::default() };
    let (path, object) = (p.path.0.as_str(), p.object.as_ref().map(|name| name.0.as_str()));
    let file = if path.contains('#') { None } else { Some(assets.open("path", path)?) };
    let (format, file) = match file {
        None => (Format::ObjSequence, None),
        Some(mut file) => (detect_format(&mut *file, path)?, Some(file)),
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
            let selection = gltf::GltfSelection {
                mesh: object.map(str::to_owned),
                animation: p.animation.as_ref().map(|name| name.0.clone()),
                fps: p.fps.map(Rate::as_f64),
            };
            let folder = path.rsplit_once('/').map(|(folder, _)| format!("{folder}/")).unwrap_or_default();
            let bytes = assets.bytes("path", path)?;
            let mut resolve = |address: &str| {
                let bytes = assets.bytes("path", &format!("{folder}{address}"));
                bytes.map_err(|e| std::io::Error::other(e.message))
            };
            gltf::open(&bytes, &selection, &mut resolve, &options).map_err(failed)?
        }
    };
    Ok((stream.with_up_axis(up_axis(p, format), UpAxis::Z), format))
}

/// The upward axis of the file.
fn up_axis(p: &MeshSequenceParams, format: Format) -> UpAxis {
    let convention = if matches!(format, Format::Alembic | Format::Gltf) { UpAxis::Y } else { UpAxis::Z };
    p.up.unwrap_or(convention)
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

/// The rate of the output.
fn rate(p: &MeshSequenceParams, times: &[f64]) -> Result<Rate, Reject> {
    if times.len() == 1 {
        return Ok(p.fps.unwrap_or(Rate::hz(60)));
    }
    let standard = || nominal_rate(times).and_then(|(num, den)| Rate::new(num, den));
    p.fps.or_else(standard).ok_or_else(|| {
        let span = times[times.len() - 1] - times[0];
        let message = format!("the {} frames of {span} s have no standard frame rate", times.len());
        Reject::new("F071", message)
            .at("fps")
            .help("set `fps` to the rate of the output, for example `fps: 60`")
    })
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
        let rate = rate(p, times)?;
        let (first, last) = (times[0], times[times.len() - 1]);
        let hz = rate.as_f64();
        if let (Some(start), None) = (p.start.filter(|start| *start > last && times.len() > 1), p.duration) {
            let message = format!("the animation is from {first} s to {last} s, `start` is {start} s");
            return Err(Reject::new("F051", message)
                .at("start")
                .help("set an earlier `start`, or set a `duration` for which the last frame is held"));
        }
        // The tolerance includes a last frame that rounding of its time puts just outside.
        let items_to_last_frame = || ((last - p.start.unwrap_or(first)) * hz + 1e-3).floor() + 1.0;
        let items_of_duration = p.duration.map(|duration| (duration * hz - 1e-6).ceil());
        let items = items_of_duration
            .or((times.len() > 1).then(items_to_last_frame))
            .map(|items| items.max(0.0) as i64);
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
