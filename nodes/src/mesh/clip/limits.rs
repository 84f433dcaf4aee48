//! Limits on untrusted files, and the unit of their positions.

use crate::mesh::MeshError;

/// Maximum sizes that a reader accepts from an untrusted file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshLimits {
    /// Maximum vertices of one mesh.
    pub max_vertices: usize,
    /// Maximum triangles of one mesh, and polygons before triangulation.
    pub max_faces: usize,
    /// Maximum frames of one clip.
    pub max_frames: usize,
    /// Maximum bytes that a reader holds at a time (buffers of glTF, one OBJ file, tables of Alembic).
    pub max_bytes: u64,
}

impl Default for MeshLimits {
    fn default() -> Self {
        Self { max_vertices: 4_000_000, max_faces: 8_000_000, max_frames: 1_000_000, max_bytes: 2 << 30 }
    }
}

impl MeshLimits {
    pub(in crate::mesh) fn vertices(&self, found: u64) -> Result<(), MeshError> {
        limit("vertices", "max_vertices", found, self.max_vertices as u64)
    }

    pub(in crate::mesh) fn faces(&self, found: u64) -> Result<(), MeshError> {
        limit("faces", "max_faces", found, self.max_faces as u64)
    }

    pub(in crate::mesh) fn frames(&self, found: u64) -> Result<(), MeshError> {
        limit("frames", "max_frames", found, self.max_frames as u64)
    }

    pub(in crate::mesh) fn bytes(&self, found: u64) -> Result<(), MeshError> {
        limit("bytes in memory", "max_bytes", found, self.max_bytes)
    }
}

fn limit(what: &'static str, field: &'static str, found: u64, limit: u64) -> Result<(), MeshError> {
    if found > limit { Err(MeshError::Limit { what, field, found, limit }) } else { Ok(()) }
}

/// Unit of the positions of a file, and limits on its sizes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// Length of one unit of the file in metres, for example 0.01 for centimetres.
    pub metres_per_unit: f64,
    /// Limits on the sizes of the file.
    pub limits: MeshLimits,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { metres_per_unit: 1.0, limits: MeshLimits::default() }
    }
}

impl ReadOptions {
    /// Returns the options if the unit is finite and positive.
    ///
    /// # Errors
    /// [`MeshError::Parameter`].
    pub(in crate::mesh) fn checked(&self) -> Result<&Self, MeshError> {
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
