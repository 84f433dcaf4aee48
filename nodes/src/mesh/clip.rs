//! What every reader of animated meshes gives: a clip that tells, and frames that can be fetched.

use super::{Materials, MeshError, Topology};

/// How much a file from a stranger may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshLimits {
    /// Vertices of one mesh.
    pub max_vertices: usize,
    /// Triangles of one mesh, and polygons before they are split.
    pub max_faces: usize,
    /// Frames of one clip.
    pub max_frames: usize,
    /// Bytes that a reader may hold at a time (buffers of glTF, one OBJ file, tables of Alembic).
    pub max_bytes: u64,
}

impl Default for MeshLimits {
    fn default() -> Self {
        Self { max_vertices: 4_000_000, max_faces: 8_000_000, max_frames: 1_000_000, max_bytes: 2 << 30 }
    }
}

impl MeshLimits {
    pub(super) fn vertices(&self, found: u64) -> Result<(), MeshError> {
        limit("vertices", "max_vertices", found, self.max_vertices as u64)
    }

    pub(super) fn faces(&self, found: u64) -> Result<(), MeshError> {
        limit("faces", "max_faces", found, self.max_faces as u64)
    }

    pub(super) fn frames(&self, found: u64) -> Result<(), MeshError> {
        limit("frames", "max_frames", found, self.max_frames as u64)
    }

    pub(super) fn bytes(&self, found: u64) -> Result<(), MeshError> {
        limit("bytes to hold", "max_bytes", found, self.max_bytes)
    }
}

fn limit(what: &'static str, field: &'static str, found: u64, limit: u64) -> Result<(), MeshError> {
    if found > limit { Err(MeshError::Limit { what, field, found, limit }) } else { Ok(()) }
}

/// How positions of a file become metres, and what the file may ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Length of one unit of the file in metres, as 0.01 for centimetres.
    pub metres_per_unit: f64,
    /// Limits on what the file may ask for.
    pub limits: MeshLimits,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { metres_per_unit: 1.0, limits: MeshLimits::default() }
    }
}

impl ReadOptions {
    pub(super) fn checked(&self) -> Result<&Self, MeshError> {
        if self.metres_per_unit.is_finite() && self.metres_per_unit > 0.0 {
            return Ok(self);
        }
        Err(MeshError::Parameter {
            name: "metres_per_unit",
            value: self.metres_per_unit,
            expected: "finite and positive",
        })
    }
}

/// What is known of an animated mesh before its frames are read.
///
/// # Shapes
/// `times` holds the time of each frame in seconds, strictly increasing, and is never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshClip {
    topology: Topology,
    times: Vec<f64>,
    dropped_faces: usize,
    others: Vec<String>,
    materials: Materials,
}

impl MeshClip {
    /// A clip of a topology that has a frame at each time.
    ///
    /// # Errors
    /// [`MeshError::Empty`] without vertices, triangles or frames, [`MeshError::Times`] where times do not increase.
    pub fn new(topology: Topology, times: Vec<f64>, dropped_faces: usize) -> Result<Self, MeshError> {
        if topology.rest.is_empty() || topology.triangles.is_empty() || times.is_empty() {
            return Err(MeshError::Empty {
                mesh: "clip".to_owned(),
                vertices: topology.rest.len(),
                faces: topology.triangles.len(),
                frames: times.len(),
            });
        }
        check_times(&times)?;
        Ok(Self { topology, times, dropped_faces, others: Vec::new(), materials: Materials::default() })
    }

    /// The triangles and the rest pose.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// Time of each frame in seconds.
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Number of vertices in each frame.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.topology.vertex_count()
    }

    /// Number of frames.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.times.len()
    }

    /// Faces left out because they name fewer than three different vertices.
    #[must_use]
    pub fn dropped_faces(&self) -> usize {
        self.dropped_faces
    }

    /// Names of the other meshes of the file, where this one was taken for having the most vertices and not by name.
    #[must_use]
    pub fn others(&self) -> &[String] {
        &self.others
    }

    /// What the triangles are made of, where the file says so.
    #[must_use]
    pub fn materials(&self) -> &Materials {
        &self.materials
    }

    pub(super) fn with_materials(self, materials: Materials) -> Self {
        Self { materials, ..self }
    }

    pub(super) fn with_others(self, others: Vec<String>) -> Self {
        Self { others, ..self }
    }

    /// Seconds from the first frame to the last.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }
}

/// Which mesh of a file is meant when none is named: the only one, or the one of most vertices if there is one such.
pub(super) fn most_vertices(counts: &[u64]) -> Option<usize> {
    let most = counts.iter().max()?;
    let mut of_most = (0..counts.len()).filter(|&k| counts[k] == *most);
    of_most.next().filter(|_| of_most.next().is_none())
}

pub(super) fn check_times(times: &[f64]) -> Result<(), MeshError> {
    let mut previous = f64::NEG_INFINITY;
    for (frame, &time) in times.iter().enumerate() {
        if !time.is_finite() || time <= previous {
            return Err(MeshError::Times { frame, time, previous });
        }
        previous = time;
    }
    Ok(())
}

/// Random access to the frames of a clip, one at a time.
pub trait FrameReader: Send {
    /// Reads the positions of one frame, in metres, into `out`.
    ///
    /// # Shapes
    /// `out` holds one position per vertex of the clip.
    ///
    /// # Errors
    /// A frame outside of the clip, an `out` of the wrong length, a truncated file, a NaN or infinite position.
    /// `out` holds anything after an error.
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError>;
}

impl<R: FrameReader + ?Sized> FrameReader for Box<R> {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        (**self).read_frame(index, out)
    }
}

/// An opened animation: what is known of it, and its frames.
pub struct MeshStream {
    /// Topology and frame times.
    pub clip: MeshClip,
    /// The frames.
    pub frames: Box<dyn FrameReader>,
}

impl std::fmt::Debug for MeshStream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MeshStream")
            .field("vertices", &self.clip.vertex_count())
            .field("frames", &self.clip.frame_count())
            .finish_non_exhaustive()
    }
}

impl MeshStream {
    /// Turns rest pose and frames from one upward axis to another.
    #[must_use]
    pub fn with_up_axis(mut self, from: UpAxis, to: UpAxis) -> Self {
        if from != to {
            from.convert(to, &mut self.clip.topology.rest);
            self.frames = Box::new(Turned { inner: self.frames, from, to });
        }
        self
    }
}

struct Turned {
    inner: Box<dyn FrameReader>,
    from: UpAxis,
    to: UpAxis,
}

impl FrameReader for Turned {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        self.inner.read_frame(index, out)?;
        self.from.convert(self.to, out);
        Ok(())
    }
}

/// The axis that points upward in a file. Alembic and glTF have Y by convention.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpAxis {
    /// Y points upward.
    Y,
    /// Z points upward.
    Z,
}

impl UpAxis {
    /// Turns positions by a quarter about x so that `to` points upward; windings stay.
    pub fn convert(self, to: UpAxis, positions: &mut [[f32; 3]]) {
        match (self, to) {
            (UpAxis::Y, UpAxis::Z) => positions.iter_mut().for_each(|p| *p = [p[0], -p[2], p[1]]),
            (UpAxis::Z, UpAxis::Y) => positions.iter_mut().for_each(|p| *p = [p[0], p[2], -p[1]]),
            _ => {}
        }
    }
}

/// Checks what every `read_frame` is asked.
pub(super) fn check_request(
    index: usize,
    frames: usize,
    out: usize,
    vertices: usize,
) -> Result<(), MeshError> {
    if index >= frames {
        return Err(MeshError::NoSuchFrame { frame: index, frames });
    }
    if out != vertices {
        return Err(MeshError::OutputLength { found: out, expected: vertices });
    }
    Ok(())
}

/// Farthest coordinate of a vertex, m: squares of distances stay far from infinity in single precision.
pub const FARTHEST: f32 = 1e9;

/// Scales one position to metres, refusing what is not finite or farther than [`FARTHEST`].
pub(crate) fn metres(p: [f64; 3], scale: f64, frame: usize, vertex: usize) -> Result<[f32; 3], MeshError> {
    let q = p.map(|x| (x * scale) as f32);
    if q.iter().all(|x| x.abs() <= FARTHEST) {
        Ok(q)
    } else {
        Err(MeshError::NotFinite { frame, vertex, position: p })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_the_up_axis_there_and_back_changes_nothing() {
        let p = [[1.0, 2.0, 3.0], [-4.0, 0.5, 6.0]];
        let mut q = p;
        UpAxis::Y.convert(UpAxis::Z, &mut q);
        assert_eq!(q[0], [1.0, -3.0, 2.0]);
        UpAxis::Z.convert(UpAxis::Y, &mut q);
        assert_eq!(q, p);
    }

    #[test]
    fn positions_that_no_scene_has_are_refused() {
        assert!(metres([1e9, -1e9, 0.0], 1.0, 0, 0).is_ok() && metres([1e12, 0.0, 0.0], 1e-3, 0, 0).is_ok());
        for far in [1.1e9, 1e37, 1e60, f64::NAN, f64::NEG_INFINITY] {
            let e = metres([0.0, far, 0.0], 1.0, 3, 4).unwrap_err();
            assert!(matches!(e, MeshError::NotFinite { frame: 3, vertex: 4, .. }), "{far}: {e}");
        }
    }

    #[test]
    fn times_that_stand_still_are_refused() {
        assert!(matches!(check_times(&[0.0, 1.0, 1.0]), Err(MeshError::Times { frame: 2, .. })));
        assert!(matches!(check_times(&[f64::NAN]), Err(MeshError::Times { frame: 0, .. })));
        assert!(check_times(&[-1.0, 0.0, 0.5]).is_ok());
    }
}
