//! glTF and GLB animations: morph targets, skins and moving nodes, and the nodes themselves.
//!
//! Opening decodes all data of the mesh; a frame is computed from the keys.

mod channel;
mod container;
mod instance;
mod object;
mod pose;
#[cfg(test)]
pub(super) mod tests;

use std::collections::BTreeMap;

use super::clip::{check_request, largest_mesh, to_metres};
use super::{FrameReader, MeshClip, MeshError, MeshLimits, MeshStream, ObjectMotion, ReadOptions, Topology};
use container::{Buffers, FORMAT, split_glb};
use instance::Instance;
pub use object::object_motion;
use pose::Pose;

/// Object, animation and frame rate to read from an asset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfSelection {
    /// Name of a node or of its mesh; `None` for the mesh with the most vertices, or the only animated node.
    pub object: Option<String>,
    /// Name of the animation; `None` for the first one.
    pub animation: Option<String>,
    /// Frames per second; `None` for a frame at each key.
    pub fps: Option<f64>,
}

/// Function that returns the bytes of an external file by its address in the asset.
pub type Resolve<'a> = &'a mut dyn FnMut(&str) -> std::io::Result<Vec<u8>>;

/// Opens one mesh of a GLB or glTF file.
///
/// Positions are in the space of the scene (Y up in glTF), with the transforms of all nodes above the mesh. For a skinned
/// mesh the transforms of the joints apply instead of that of its node. The rest pose is the pose without animation.
///
/// # Errors
/// [`MeshError::NoSuchMesh`] and [`MeshError::AmbiguousMesh`] list the meshes. A primitive of points or lines, a
/// compressed asset and an accessor outside of its buffer are errors.
pub fn open(
    bytes: &[u8],
    selection: &GltfSelection,
    resolve: Resolve<'_>,
    options: &ReadOptions,
) -> Result<MeshStream, MeshError> {
    let options = *options.checked()?;
    let (document, bin) = read_document(bytes, &options.limits)?;
    let (node, other_meshes) = choose(&document, selection.object.as_deref())?;
    let mut buffers = Buffers::load(&document, bin, resolve, options.limits)?;
    let instance = Instance::read(&node, &mut buffers, &options.limits)?;
    let animation = selected_animation(&document, selection.animation.as_deref())?;
    let mut pose = Pose::read(&document, &node, animation, Some(&instance), &mut buffers)?;
    let keys = key_times(&pose, &options.limits)?;
    let times = frame_times(&keys, selection.fps, &options.limits)?;
    let vertices = instance.points.len();
    let mut triangles = instance.triangles.clone();
    if triangles.is_empty() || vertices == 0 {
        let mesh = name_of(&node);
        return Err(MeshError::Empty { mesh, vertices, faces: triangles.len(), frames: times.len() });
    }
    pose.evaluate(None);
    if pose.mirrors() {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let mut rest = vec![[0.0; 3]; vertices];
    let mut local = vec![[0.0; 3]; vertices];
    write_frame(&instance, &pose, &mut local, options.metres_per_unit, 0, &mut rest)?;
    let clip = MeshClip::new(Topology { rest, triangles }, times.clone(), instance.dropped)?;
    let clip = clip.with_other_meshes(other_meshes).with_keys(keys);
    let frames = Frames { instance, pose, times, local, scale: options.metres_per_unit };
    Ok(MeshStream { clip, frames: Box::new(frames) })
}

/// The validated JSON of an asset, and the binary chunk of a GLB.
fn read_document<'a>(
    bytes: &'a [u8],
    limits: &MeshLimits,
) -> Result<(::gltf::Document, Option<&'a [u8]>), MeshError> {
    limits.bytes(bytes.len() as u64)?;
    let (json, bin) = split_glb(bytes)?;
    let document = container::document(json)?;
    if let Some(extension) = document.extensions_required().find(|e| !keeps_positions(e)) {
        let what = format!("the extension {extension}, which is not supported: export without compression");
        return Err(MeshError::Unsupported { format: FORMAT, what });
    }
    Ok((document, bin))
}

/// The animation of a name or the first one; `None` if an asset without animations is read without a name.
fn selected_animation<'a>(
    document: &'a ::gltf::Document,
    wanted: Option<&str>,
) -> Result<Option<::gltf::Animation<'a>>, MeshError> {
    let Some(wanted) = wanted else { return Ok(document.animations().next()) };
    let found = document.animations().find(|a| a.name() == Some(wanted));
    found.map(Some).ok_or_else(|| {
        let names = document.animations().filter_map(|a| a.name().map(str::to_owned));
        MeshError::NoSuchAnimation { wanted: wanted.to_owned(), available: names.collect() }
    })
}

/// Names of the meshes that [`open`] can choose from.
///
/// # Errors
/// A file that is not a glTF asset.
pub fn list(bytes: &[u8]) -> Result<Vec<String>, MeshError> {
    let (json, _) = split_glb(bytes)?;
    Ok(container::document(json)?.nodes().filter(|n| n.mesh().is_some()).map(|n| name_of(&n)).collect())
}

/// Returns true for extensions that do not change positions.
fn keeps_positions(extension: &str) -> bool {
    extension == "KHR_mesh_quantization"
        || ["KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_", "KHR_xmp"]
            .iter()
            .any(|prefix| extension.starts_with(prefix))
}

fn name_of(node: &::gltf::Node<'_>) -> String {
    let mesh = || node.mesh().and_then(|m| m.name().map(str::to_owned));
    node.name().map(str::to_owned).or_else(mesh).unwrap_or_else(|| format!("node {}", node.index()))
}

/// Number of vertices of the mesh of a node by its accessors; primitives can share them.
fn vertex_count(node: &::gltf::Node<'_>) -> u64 {
    let Some(mesh) = node.mesh() else { return 0 };
    let positions = mesh.primitives().filter_map(|p| p.get(&::gltf::Semantic::Positions));
    let counts: BTreeMap<usize, u64> = positions.map(|a| (a.index(), a.count() as u64)).collect();
    counts.values().fold(0, |sum, count| sum.saturating_add(*count))
}

/// The node with the wanted or the largest mesh, and the names of the other meshes if none was named.
fn choose<'a>(
    document: &'a ::gltf::Document,
    wanted: Option<&str>,
) -> Result<(::gltf::Node<'a>, Vec<String>), MeshError> {
    let nodes: Vec<::gltf::Node<'a>> = document.nodes().filter(|n| n.mesh().is_some()).collect();
    let available = || nodes.iter().map(name_of).collect();
    let found = match wanted {
        None => {
            if let Some(index) = largest_mesh(&nodes.iter().map(vertex_count).collect::<Vec<_>>()) {
                let other_meshes =
                    nodes.iter().filter(|n| n.index() != nodes[index].index()).map(name_of).collect();
                return Ok((nodes[index].clone(), other_meshes));
            }
            if !nodes.is_empty() {
                return Err(MeshError::AmbiguousMesh { available: available() });
            }
            None
        }
        Some(wanted) => {
            let by_mesh = |n: &&::gltf::Node<'_>| n.mesh().is_some_and(|m| m.name() == Some(wanted));
            nodes.iter().find(|n| name_of(n) == wanted).or_else(|| nodes.iter().find(by_mesh))
        }
    };
    let found = found.cloned().ok_or_else(|| MeshError::NoSuchMesh {
        wanted: wanted.unwrap_or("(any)").to_owned(),
        available: available(),
    })?;
    Ok((found, Vec::new()))
}

/// Times of the keys of an animation; without keys that of one frame.
fn key_times(pose: &Pose, limits: &MeshLimits) -> Result<Vec<f64>, MeshError> {
    let mut keys: Vec<f64> = pose.key_times(limits.max_frames);
    keys.sort_unstable_by(f64::total_cmp);
    keys.dedup();
    limits.frames(keys.len() as u64)?;
    Ok(if keys.is_empty() { vec![0.0] } else { keys })
}

/// Times at which an animation with these keys is evaluated: at the keys, or `fps` times a second from the first key on.
fn frame_times(keys: &[f64], fps: Option<f64>, limits: &MeshLimits) -> Result<Vec<f64>, MeshError> {
    let (first, last) = (keys[0], keys[keys.len() - 1]);
    let Some(fps) = fps.filter(|_| keys.len() > 1) else { return Ok(keys.to_vec()) };
    if !fps.is_finite() || fps <= 0.0 {
        return Err(MeshError::Parameter { name: "fps", value: fps, expected: "finite and positive" });
    }
    // Key times are f32: a last frame just after the last key counts.
    let count = ((last - first) * fps + 1e-3).floor();
    limits.frames(count as u64 + 1)?;
    Ok((0..=count as u64).map(|k| first + k as f64 / fps).collect())
}

struct Frames {
    instance: Instance,
    pose: Pose,
    times: Vec<f64>,
    local: Vec<[f64; 3]>,
    scale: f64,
}

impl FrameReader for Frames {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        check_request(index, self.times.len(), out.len(), self.local.len())?;
        self.pose.evaluate(Some(self.times[index]));
        write_frame(&self.instance, &self.pose, &mut self.local, self.scale, index, out)
    }
}

fn write_frame(
    instance: &Instance,
    pose: &Pose,
    local: &mut [[f64; 3]],
    scale: f64,
    frame: usize,
    out: &mut [[f32; 3]],
) -> Result<(), MeshError> {
    instance.morph(pose.weights(), local);
    for (v, (q, &p)) in out.iter_mut().zip(local.iter()).enumerate() {
        *q = to_metres(pose.transform(instance.joints_of(v), p), scale, frame, v)?;
    }
    Ok(())
}
