//! A digest of a mesh.

use crate::mesh::Topology;

/// Returns a digest of the triangles and the rest pose of a mesh.
pub(crate) fn mesh_digest(topology: &Topology) -> u32 {
    let mut hasher = blake3::Hasher::new();
    for p in &topology.rest {
        for x in p {
            hasher.update(&x.to_bits().to_le_bytes());
        }
    }
    for t in &topology.triangles {
        for v in t {
            hasher.update(&v.to_le_bytes());
        }
    }
    let hash = *hasher.finalize().as_bytes();
    u32::from_le_bytes([hash[0], hash[1], hash[2], hash[3]])
}
