//! Common parts of the nodes that read animations from files: access to files, formats, rates and spans of time.

use std::io::{Read, SeekFrom};
use std::sync::Arc;

use super::{MeshError, OpenFrame, UpAxis, gltf, nominal_rate};
use crate::core::fault::Reject;
use crate::core::files::{Files, MemoryFiles, ReadSeek};
use crate::core::params::Text;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;

/// Access to files that `shape` and `build` have in common.
pub(crate) trait Assets {
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

/// Format of a file with an animation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Format {
    Alembic,
    Pc2,
    Mdd,
    Obj,
    ObjSequence,
    Gltf,
}

impl Format {
    /// Format of a file by its first bytes, otherwise by the extension of its name.
    pub(crate) fn detect(file: &mut dyn ReadSeek, path: &str) -> Result<Self, Reject> {
        let mut head = Vec::new();
        let read = file.take(64).read_to_end(&mut head).and_then(|_| file.seek(SeekFrom::Start(0)));
        read.map_err(|e| Reject::new("F061", format!("cannot read {path:?}: {e}")).at("path"))?;
        let extension =
            path.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase()).unwrap_or_default();
        let json = head.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
        Ok(match (&head[..], extension.as_str()) {
            ([b'O', b'g', b'a', b'w', b'a', ..], _) | (_, "abc") => Self::Alembic,
            (bytes, _) if bytes.starts_with(b"POINTCACHE2") => Self::Pc2,
            (bytes, _) if bytes.starts_with(b"glTF") || json => Self::Gltf,
            (_, "pc2") => Self::Pc2,
            (_, "mdd") => Self::Mdd,
            (_, "obj") => Self::Obj,
            (_, "gltf" | "glb") => Self::Gltf,
            _ => {
                let message = format!("{path:?} is not an animation in a known format");
                return Err(Reject::new("F070", message).at("path").help(
                    "use Alembic (.abc), PC2, MDD, OBJ, a sequence such as \"frame_####.obj\", or glTF (.glb)",
                ));
            }
        })
    }

    /// The axis that points upward by the convention of the format.
    pub(crate) fn up_axis(self) -> UpAxis {
        if matches!(self, Self::Alembic | Self::Gltf) { UpAxis::Y } else { UpAxis::Z }
    }
}

/// The message of an error of a reader; `field` names the file.
pub(crate) fn reject(field: &str, error: &MeshError) -> Reject {
    let rejection = Reject::new("F070", error.to_string());
    match error {
        MeshError::AmbiguousMesh { available }
        | MeshError::NoSuchMesh { available, .. }
        | MeshError::AmbiguousObject { available, .. }
        | MeshError::NoSuchObject { available, .. } => {
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

/// The object and animation of a glTF that the parameters select.
pub(crate) fn gltf_selection(
    object: Option<&Text>,
    animation: Option<&Text>,
    rate: Option<Rate>,
) -> gltf::GltfSelection {
    let owned = |name: Option<&Text>| name.map(|name| name.0.clone());
    gltf::GltfSelection { object: owned(object), animation: owned(animation), fps: rate.map(Rate::as_f64) }
}

/// Calls `read` with the bytes of a glTF and a function that reads the files in its folder.
pub(crate) fn read_gltf<T>(
    path: &str,
    assets: &mut dyn Assets,
    read: impl FnOnce(&[u8], gltf::Resolve<'_>) -> T,
) -> Result<T, Reject> {
    let folder = path.rsplit_once('/').map(|(folder, _)| format!("{folder}/")).unwrap_or_default();
    let bytes = assets.bytes("path", path)?;
    let mut resolve = |address: &str| {
        let bytes = assets.bytes("path", &format!("{folder}{address}"));
        bytes.map_err(|e| std::io::Error::other(e.message))
    };
    Ok(read(&bytes, &mut resolve))
}

/// The rate of the output: the one of the parameter `field`, or else the standard rate of the times of the file.
pub(crate) fn output_rate(times: &[f64], given: Option<Rate>, field: &str) -> Result<Rate, Reject> {
    if times.len() == 1 {
        return Ok(given.unwrap_or(Rate::hz(60)));
    }
    let standard = || nominal_rate(times).and_then(|(num, den)| Rate::new(num, den));
    given.or_else(standard).ok_or_else(|| {
        let span = times[times.len() - 1] - times[0];
        let message = format!("the {} frames of {span} s have no standard frame rate", times.len());
        Reject::new("F071", message)
            .at(field)
            .help(format!("set `{field}` to the rate of the output, for example `{field}: 60`"))
    })
}

/// The part of an animation that a stream reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    /// Time in the file at which the stream starts, s; `None` for the first frame.
    pub(crate) start: Option<f64>,
    /// Length of the stream, s; `None` ends at the last frame.
    pub(crate) duration: Option<f64>,
}

impl Span {
    /// Number of items of a stream at a rate; `None` if it never ends: an animation of one frame without a duration.
    pub(crate) fn items(self, times: &[f64], rate: Rate) -> Result<Option<i64>, Reject> {
        let (first, last) = (times[0], times[times.len() - 1]);
        let hz = rate.as_f64();
        if let (Some(start), None) =
            (self.start.filter(|start| *start > last && times.len() > 1), self.duration)
        {
            let message = format!("the animation is from {first} s to {last} s, `start` is {start} s");
            return Err(Reject::new("F051", message)
                .at("start")
                .help("set an earlier `start`, or set a `duration` for which the last frame is held"));
        }
        // The tolerance includes a last frame that rounding of its time puts just outside.
        let items_to_last_frame = || ((last - self.start.unwrap_or(first)) * hz + 1e-3).floor() + 1.0;
        let items_of_duration = self.duration.map(|duration| (duration * hz - 1e-6).ceil());
        let items = items_of_duration
            .or((times.len() > 1).then(items_to_last_frame))
            .map(|items| items.max(0.0) as i64);
        Ok(items)
    }
}
