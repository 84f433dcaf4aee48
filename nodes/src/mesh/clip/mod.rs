//! Animated meshes as readers return them: a clip with topology and frame times, and random access to its frames.

mod frame_rate;
mod limits;
mod sampler;
mod up_axis;

use super::{Materials, MeshError, Topology};
pub use frame_rate::{nominal_rate, rate_difference};
pub use limits::{MeshLimits, ReadOptions};
pub use sampler::FrameSampler;
pub use up_axis::UpAxis;

/// Topology, frame times and materials of an animated mesh.
///
/// # Shapes
/// `times` holds the time of each frame in seconds, strictly increasing, and is never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshClip {
    topology: Topology,
    times: Vec<f64>,
    /// Times of the keys of the file, if the frames are others.
    keys: Option<Vec<f64>>,
    dropped_faces: usize,
    other_meshes: Vec<String>,
    materials: Materials,
}

impl MeshClip {
    /// A clip of a topology with a frame at each time.
    ///
    /// # Errors
    /// [`MeshError::Empty`] without vertices, triangles or frames, [`MeshError::Times`] if the times do not increase.
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
        Ok(Self {
            topology,
            times,
            keys: None,
            dropped_faces,
            other_meshes: Vec::new(),
            materials: Materials::default(),
        })
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

    /// Times in the file, s: of the keys of an animation that is evaluated at another rate, or else of the frames.
    #[must_use]
    pub fn file_times(&self) -> &[f64] {
        self.keys.as_deref().unwrap_or(&self.times)
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

    /// Number of faces left out because they have fewer than three different vertices.
    #[must_use]
    pub fn dropped_faces(&self) -> usize {
        self.dropped_faces
    }

    /// Names of the other meshes of the file, if this one was chosen for its number of vertices and not by name.
    #[must_use]
    pub fn other_meshes(&self) -> &[String] {
        &self.other_meshes
    }

    /// Materials of the triangles, if the file has them.
    #[must_use]
    pub fn materials(&self) -> &Materials {
        &self.materials
    }

    pub(super) fn with_materials(self, materials: Materials) -> Self {
        Self { materials, ..self }
    }

    #[cfg(feature = "gltf")]
    pub(super) fn with_keys(self, keys: Vec<f64>) -> Self {
        Self { keys: Some(keys), ..self }
    }

    pub(super) fn with_other_meshes(self, other_meshes: Vec<String>) -> Self {
        Self { other_meshes, ..self }
    }

    /// Seconds from the first frame to the last.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }
}

/// Index of the mesh with the most vertices; `None` without meshes or on a tie.
pub(super) fn largest_mesh(vertex_counts: &[u64]) -> Option<usize> {
    let max = vertex_counts.iter().max()?;
    let mut largest = (0..vertex_counts.len()).filter(|&k| vertex_counts[k] == *max);
    largest.next().filter(|_| largest.next().is_none())
}

/// Checks that times are finite and increase.
///
/// # Errors
/// [`MeshError::Times`] names the first wrong frame.
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
    /// After an error the contents of `out` are unspecified.
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError>;
}

impl<R: FrameReader + ?Sized> FrameReader for Box<R> {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        (**self).read_frame(index, out)
    }
}

/// An opened animation.
pub struct MeshStream {
    /// Topology and frame times.
    pub clip: MeshClip,
    /// Random access to the frames.
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
    /// Converts rest pose and frames from one upward axis to another.
    #[must_use]
    pub fn with_up_axis(mut self, from: UpAxis, to: UpAxis) -> Self {
        if from != to {
            from.convert(to, &mut self.clip.topology.rest);
            self.frames = Box::new(Reoriented { inner: self.frames, from, to });
        }
        self
    }
}

struct Reoriented {
    inner: Box<dyn FrameReader>,
    from: UpAxis,
    to: UpAxis,
}

impl FrameReader for Reoriented {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        self.inner.read_frame(index, out)?;
        self.from.convert(self.to, out);
        Ok(())
    }
}

/// Checks the arguments of `read_frame`.
///
/// # Errors
/// [`MeshError::NoSuchFrame`] and [`MeshError::OutputLength`].
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

/// Largest magnitude of a coordinate of a vertex, m: squares of distances do not overflow in single precision.
pub const MAX_COORDINATE: f32 = 1e9;

/// Scales one position to metres.
///
/// # Errors
/// [`MeshError::NotFinite`] for a coordinate that is not finite or larger than [`MAX_COORDINATE`].
#[inline]
pub(crate) fn to_metres(p: [f64; 3], scale: f64, frame: usize, vertex: usize) -> Result<[f32; 3], MeshError> {
    let q = p.map(|x| (x * scale) as f32);
    if q.iter().all(|x| x.abs() <= MAX_COORDINATE) {
        Ok(q)
    } else {
        Err(MeshError::NotFinite { frame, vertex, position: p })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_that_are_too_large_or_not_finite_are_rejected() {
        assert!(
            to_metres([1e9, -1e9, 0.0], 1.0, 0, 0).is_ok() && to_metres([1e12, 0.0, 0.0], 1e-3, 0, 0).is_ok()
        );
        for far in [1.1e9, 1e37, 1e60, f64::NAN, f64::NEG_INFINITY] {
            let e = to_metres([0.0, far, 0.0], 1.0, 3, 4).unwrap_err();
            assert!(matches!(e, MeshError::NotFinite { frame: 3, vertex: 4, .. }), "{far}: {e}");
        }
    }

    #[test]
    fn times_that_do_not_increase_are_rejected() {
        assert!(matches!(check_times(&[0.0, 1.0, 1.0]), Err(MeshError::Times { frame: 2, .. })));
        assert!(matches!(check_times(&[f64::NAN]), Err(MeshError::Times { frame: 0, .. })));
        assert!(check_times(&[-1.0, 0.0, 0.5]).is_ok());
    }
}
