//! Alembic animations: PolyMesh points and faces under animated Xforms, and the Xforms themselves, in the Ogawa container.
//!
//! Files are read by seeking: opening reads the tables, a frame reads only its own bytes.

mod archive;
mod object;
mod ogawa;
#[cfg(test)]
pub(super) mod tests;
pub(crate) mod writer;
mod xform;

use super::affine::Affine;
use super::clip::{check_request, check_times, largest_mesh, to_metres};
use super::{
    FrameReader, MeshClip, MeshError, MeshLimits, MeshStream, ObjectMotion, ReadOptions, ReadSeek, Topology,
    Triangulator,
};
use archive::{Archive, Property, Samples};
pub use object::object_motion;
use ogawa::malformed;
use xform::Xform;

/// A mesh in an archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AlembicMesh {
    /// Full path, for example `/sheet/sheetShape`.
    pub path: String,
    /// Number of stored vertices in the first frame.
    pub vertices: u64,
    /// Number of polygons in the first frame.
    pub faces: u64,
    /// Number of samples of its points.
    pub samples: usize,
}

/// Lists the meshes of an archive in the order of the file.
///
/// # Errors
/// A file that is not an Ogawa archive, or a malformed one.
pub fn list(file: Box<dyn ReadSeek>, limits: &MeshLimits) -> Result<Vec<AlembicMesh>, MeshError> {
    let mut archive = Archive::open(file, *limits)?;
    let mut out = Vec::new();
    for (object, properties) in meshes(&mut archive)? {
        let (vertices, faces) =
            (size(&mut archive, &properties.points)?, size(&mut archive, &properties.counts)?);
        let path = archive.objects[object].path.clone();
        out.push(AlembicMesh { path, vertices, faces, samples: properties.points.samples });
    }
    Ok(out)
}

/// Number of entries in the first sample of an array.
fn size(archive: &mut Archive, property: &Property) -> Result<u64, MeshError> {
    let samples = archive.samples(property)?;
    if property.samples == 0 { Ok(0) } else { archive.count(&samples, 0) }
}

/// Properties of a PolyMesh.
struct MeshProperties {
    points: Property,
    indices: Property,
    counts: Property,
}

fn meshes(archive: &mut Archive) -> Result<Vec<(usize, MeshProperties)>, MeshError> {
    let mut out = Vec::new();
    for object in 0..archive.objects.len() {
        let Some(geometry) = archive.properties(object)?.into_iter().find(|p| p.name == ".geom") else {
            continue;
        };
        let properties = archive.sub_properties(&geometry)?;
        let find = |name: &str| properties.iter().find(|p| p.name == name).cloned();
        // Curves and particles have points too; only meshes have faces.
        if let (Some(points), Some(indices), Some(counts)) =
            (find("P"), find(".faceIndices"), find(".faceCounts"))
        {
            out.push((object, MeshProperties { points, indices, counts }));
        }
    }
    Ok(out)
}

/// Opens one mesh of an archive: the one at `path`, or the one with the most vertices. The end of a path suffices if it is the only one.
///
/// Positions are in the space of the archive (usually Y up): all transforms above the mesh are applied. The frames are
/// the samples of the points; if the points are constant, those of the lowest animated transform.
///
/// # Errors
/// [`MeshError::NoSuchMesh`] and [`MeshError::AmbiguousMesh`] list the meshes of the file;
/// [`MeshError::TopologyChanged`] names the first frame with other faces.
pub fn open(
    file: Box<dyn ReadSeek>,
    path: Option<&str>,
    options: &ReadOptions,
) -> Result<MeshStream, MeshError> {
    let options = *options.checked()?;
    let mut archive = Archive::open(file, options.limits)?;
    let (object, properties, other_meshes) = choose(&mut archive, path)?;
    let mesh = archive.objects[object].path.clone();
    for (property, what) in
        [(&properties.counts, "the corners of faces"), (&properties.indices, "the vertices of faces")]
    {
        if let Some(frame) = property.first_change() {
            return Err(MeshError::TopologyChanged { frame, what: format!("{what} of `{mesh}`") });
        }
    }
    let mut chain = transforms(&mut archive, object)?;
    let times = frame_times(&archive, &properties.points, &chain)?;
    let points = archive.samples(&properties.points)?;
    if !points.is_float() || points.property.extent != 3 {
        return Err(malformed(format!("the points of `{mesh}` are not three floats per vertex")));
    }
    if points.property.samples == 0 || properties.counts.samples == 0 || properties.indices.samples == 0 {
        return Err(MeshError::Empty { mesh, vertices: 0, faces: 0, frames: points.property.samples });
    }
    let vertices = archive.count(&points, 0)?;
    options.limits.vertices(vertices)?;
    let vertices = vertices as usize;
    let mut positions: Vec<[f64; 3]> = Vec::with_capacity(vertices);
    let mut scratch = Vec::new();
    read_points(&mut archive, &points, 0, &mut scratch, |p| {
        positions.push(p);
        Ok(())
    })?;
    let mut world = world_at(&mut archive, &mut chain, times[0])?;
    let faces =
        read_faces(&mut archive, &properties, &positions, world.determinant() < 0.0, &options.limits)?;
    let faces = faces.finish();
    if positions.is_empty() || faces.triangles.is_empty() {
        return Err(MeshError::Empty { mesh, vertices, faces: faces.triangles.len(), frames: times.len() });
    }
    let mut rest = Vec::with_capacity(vertices);
    for (v, &p) in positions.iter().enumerate() {
        rest.push(to_metres(world.apply(p), options.metres_per_unit, 0, v)?);
    }
    if !chain.iter().any(|x| x.animated().is_some()) {
        // All transforms above the mesh are constant: one matrix for all frames.
        chain.clear();
    } else {
        world = Affine::IDENTITY;
    }
    let clip = MeshClip::new(Topology { rest, triangles: faces.triangles }, times.clone(), faces.dropped)?;
    let clip = clip.with_other_meshes(other_meshes);
    let frames =
        Frames { archive, points, chain, world, times, vertices, scale: options.metres_per_unit, scratch };
    Ok(MeshStream { clip, frames: Box::new(frames) })
}

/// The mesh at `path` or the largest one, and the paths of the other meshes if none was named.
fn choose(
    archive: &mut Archive,
    path: Option<&str>,
) -> Result<(usize, MeshProperties, Vec<String>), MeshError> {
    let mut found = meshes(archive)?;
    let mut objects: Vec<usize> = found.iter().map(|(object, _)| *object).collect();
    let index = match path {
        Some(path) => archive.position(&objects, path),
        None => {
            let counts: Result<Vec<_>, _> = found.iter().map(|(_, m)| size(archive, &m.points)).collect();
            let largest = largest_mesh(&counts?);
            if largest.is_none() && !found.is_empty() {
                return Err(MeshError::AmbiguousMesh { available: archive.paths(&objects) });
            }
            largest
        }
    };
    match index {
        Some(index) => {
            let (object, properties) = found.remove(index);
            objects.remove(index);
            let other_meshes = if path.is_none() { archive.paths(&objects) } else { Vec::new() };
            Ok((object, properties, other_meshes))
        }
        None => Err(MeshError::NoSuchMesh {
            wanted: path.unwrap_or("(any)").to_owned(),
            available: archive.paths(&objects),
        }),
    }
}

/// The transforms of an object and of its ancestors, the lowest first.
fn transforms(archive: &mut Archive, object: usize) -> Result<Vec<Xform>, MeshError> {
    let mut chain = Vec::new();
    let mut current = Some(object);
    while let Some(object) = current {
        let properties = archive.properties(object)?;
        if let Some(compound) = properties.iter().find(|p| p.name == ".xform") {
            let path = archive.objects[object].path.clone();
            chain.push(Xform::open(archive, compound, &path)?);
        }
        current = archive.objects[object].parent;
    }
    Ok(chain)
}

fn frame_times(archive: &Archive, points: &Property, chain: &[Xform]) -> Result<Vec<f64>, MeshError> {
    let animated = if points.samples > 1 { None } else { chain.iter().find_map(Xform::animated) };
    let property = animated.unwrap_or(points);
    let times: Vec<f64> =
        (0..property.samples.max(1)).map(|k| archive.time(property, k)).collect::<Result<_, _>>()?;
    check_times(&times)?;
    Ok(times)
}

fn read_faces(
    archive: &mut Archive,
    properties: &MeshProperties,
    points: &[[f64; 3]],
    mirrored: bool,
    limits: &MeshLimits,
) -> Result<Triangulator, MeshError> {
    let (counts, indices) = (archive.samples(&properties.counts)?, archive.samples(&properties.indices)?);
    let (faces, corners) = (archive.count(&counts, 0)?, archive.count(&indices, 0)?);
    limits.faces(faces)?;
    limits.faces(corners / 3)?;
    let mut scratch = Vec::new();
    let mut sizes = Vec::with_capacity(faces as usize);
    archive.read(&counts, 0, &mut scratch, |x| {
        sizes.push(x);
        Ok(())
    })?;
    let mut flat = Vec::with_capacity(corners as usize);
    archive.read(&indices, 0, &mut scratch, |x| {
        flat.push(x);
        Ok(())
    })?;
    let mut out = Triangulator::new();
    let mut polygon = Vec::new();
    let mut rest = &flat[..];
    for (face, &size) in sizes.iter().enumerate() {
        if size.is_nan() || size < 0.0 || size > rest.len() as f64 {
            return Err(malformed(format!(
                "face {face} has {size} corners, {} are left in `.faceIndices`",
                rest.len()
            )));
        }
        let (corners, tail) = rest.split_at(size as usize);
        rest = tail;
        polygon.clear();
        for &x in corners {
            if x < 0.0 || x >= points.len() as f64 {
                return Err(MeshError::FaceIndex { face, vertex: x as i64, vertices: points.len() });
            }
            polygon.push(x as u32);
        }
        // Alembic winds clockwise; a mirroring transform has already reversed the winding.
        if !mirrored {
            polygon.reverse();
        }
        out.push(points, &polygon)?;
        limits.faces(out.triangle_count() as u64)?;
    }
    if !rest.is_empty() {
        return Err(malformed(format!(
            "`.faceIndices` has {} corners more than `.faceCounts` uses",
            rest.len()
        )));
    }
    Ok(out)
}

fn read_points(
    archive: &mut Archive,
    points: &Samples,
    index: usize,
    scratch: &mut Vec<u8>,
    mut each: impl FnMut([f64; 3]) -> Result<(), MeshError>,
) -> Result<(), MeshError> {
    let (mut p, mut n) = ([0.0; 3], 0);
    archive.read(points, index, scratch, |x| {
        p[n] = x;
        n += 1;
        if n == 3 {
            n = 0;
            each(p)?;
        }
        Ok(())
    })
}

fn world_at(archive: &mut Archive, chain: &mut [Xform], time: f64) -> Result<Affine, MeshError> {
    let mut world = Affine::IDENTITY;
    for xform in chain {
        let (matrix, inherits) = xform.evaluate(archive, time)?;
        world = matrix.product(&world);
        if !inherits {
            break;
        }
    }
    Ok(world)
}

struct Frames {
    archive: Archive,
    points: Samples,
    /// Transforms above the mesh; empty if none is animated.
    chain: Vec<Xform>,
    /// Transform of all frames if none is animated.
    world: Affine,
    times: Vec<f64>,
    vertices: usize,
    scale: f64,
    scratch: Vec<u8>,
}

impl FrameReader for Frames {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        check_request(index, self.times.len(), out.len(), self.vertices)?;
        let world = if self.chain.is_empty() {
            self.world
        } else {
            world_at(&mut self.archive, &mut self.chain, self.times[index])?
        };
        let sample = index.min(self.points.property.samples - 1);
        let found = self.archive.count(&self.points, sample)?;
        if found != self.vertices as u64 {
            let what = format!("{found} vertices, frame 0 has {}", self.vertices);
            return Err(MeshError::TopologyChanged { frame: index, what });
        }
        let (scale, mut vertex) = (self.scale, 0);
        read_points(&mut self.archive, &self.points, sample, &mut self.scratch, |p| {
            out[vertex] = to_metres(world.apply(p), scale, index, vertex)?;
            vertex += 1;
            Ok(())
        })
    }
}
