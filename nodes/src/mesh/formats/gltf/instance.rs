//! Geometry of one mesh: vertices, triangles, morph targets and joint weights.

use std::collections::BTreeMap;

use ::gltf::mesh::Mode;

use super::super::{MeshError, MeshLimits};
use super::container::{Buffers, FORMAT, malformed};

/// A joint and its weight for a vertex.
pub(super) type JointWeight = (u32, f32);

/// Vertices, triangles, morph targets and joints of all primitives of a mesh.
pub(super) struct Instance {
    pub(super) points: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Number of triangles with fewer than three different vertices.
    pub(super) dropped: usize,
    /// Per morph target: the vertices that it moves, with their displacements.
    targets: Vec<Vec<(u32, [f32; 3])>>,
    joints: Vec<JointWeight>,
    /// The joints of vertex v are `joints[starts[v]..starts[v + 1]]`; empty without a skin.
    starts: Vec<usize>,
}

impl Instance {
    /// Reads the primitives of the mesh of a node.
    pub(super) fn read(
        node: &::gltf::Node<'_>,
        buffers: &mut Buffers<'_>,
        limits: &MeshLimits,
    ) -> Result<Self, MeshError> {
        let mut out = Self {
            points: Vec::new(),
            triangles: Vec::new(),
            dropped: 0,
            targets: Vec::new(),
            joints: Vec::new(),
            starts: Vec::new(),
        };
        let joint_count = node.skin().map(|s| s.joints().count());
        let Some(mesh) = node.mesh() else { return Ok(out) };
        // Primitives of several materials may share their vertices.
        let mut shared: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        for primitive in mesh.primitives() {
            let Some(positions) = primitive.get(&::gltf::Semantic::Positions) else {
                return Err(malformed(format!("primitive {} has no POSITION", primitive.index())));
            };
            let mut key = vec![positions.index()];
            key.extend(primitive.morph_targets().map(|t| t.positions().map_or(usize::MAX, |a| a.index())));
            for set in 0.. {
                let (joints, weights) = (
                    primitive.get(&::gltf::Semantic::Joints(set)),
                    primitive.get(&::gltf::Semantic::Weights(set)),
                );
                let (Some(joints), Some(weights)) = (joints, weights) else { break };
                key.extend([joints.index(), weights.index()]);
            }
            let count = positions.count();
            let base = match shared.get(&key) {
                Some(&base) => base,
                None => {
                    let base = out.points.len();
                    limits.vertices((base as u64).saturating_add(count as u64))?;
                    let values = buffers.floats(&positions, 3)?;
                    out.points.extend(values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
                    out.read_targets(&primitive, base, count, buffers, limits)?;
                    if let Some(joint_count) = joint_count {
                        out.read_joints(&primitive, count, joint_count, buffers)?;
                    }
                    shared.insert(key, base);
                    base
                }
            };
            let indices = match primitive.indices() {
                Some(accessor) => {
                    limits.faces(accessor.count() as u64 / 3)?;
                    buffers.integers(&accessor, 1)?
                }
                None => (0..count as u32).collect(),
            };
            out.read_triangles(primitive.mode(), &indices, base, count)?;
            limits.faces(out.triangles.len() as u64)?;
        }
        Ok(out)
    }

    fn read_targets(
        &mut self,
        primitive: &::gltf::Primitive<'_>,
        base: usize,
        count: usize,
        buffers: &mut Buffers<'_>,
        limits: &MeshLimits,
    ) -> Result<(), MeshError> {
        for (k, target) in primitive.morph_targets().enumerate() {
            if k >= self.targets.len() {
                limits.frames(k as u64 + 1)?;
                self.targets.push(Vec::new());
            }
            let Some(accessor) = target.positions() else { continue };
            if accessor.count() != count {
                let what =
                    format!("morph target {k} has {} positions, its primitive {count}", accessor.count());
                return Err(malformed(what));
            }
            let deltas = buffers.floats(&accessor, 3)?;
            buffers.charge(deltas.len(), 2)?;
            let moved = deltas.chunks_exact(3).enumerate().filter(|(_, d)| d.iter().any(|x| *x != 0.0));
            self.targets[k].extend(moved.map(|(v, d)| ((base + v) as u32, [d[0], d[1], d[2]])));
        }
        Ok(())
    }

    fn read_joints(
        &mut self,
        primitive: &::gltf::Primitive<'_>,
        count: usize,
        joint_count: usize,
        buffers: &mut Buffers<'_>,
    ) -> Result<(), MeshError> {
        let mut sets = Vec::new();
        for set in 0.. {
            let joints = primitive.get(&::gltf::Semantic::Joints(set));
            let weights = primitive.get(&::gltf::Semantic::Weights(set));
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            let (joints, weights) = (buffers.integers(&joints, 4)?, buffers.floats(&weights, 4)?);
            if joints.len() != 4 * count || weights.len() != 4 * count {
                return Err(malformed(format!("joint set {set} is not as long as POSITION ({count})")));
            }
            sets.push((joints, weights));
        }
        if sets.is_empty() {
            return Err(malformed("a skinned mesh has no JOINTS_0 and WEIGHTS_0"));
        }
        if self.starts.is_empty() {
            self.starts.push(0);
        }
        for v in 0..count {
            let first = self.joints.len();
            for (joints, weights) in &sets {
                for k in 4 * v..4 * v + 4 {
                    if weights[k] == 0.0 {
                        continue;
                    }
                    if joints[k] as usize >= joint_count || !weights[k].is_finite() {
                        let what = format!(
                            "vertex {v} has joint {} with weight {}, the skin has {joint_count} joints",
                            joints[k], weights[k]
                        );
                        return Err(malformed(what));
                    }
                    self.joints.push((joints[k], weights[k]));
                }
            }
            let sum: f32 = self.joints[first..].iter().map(|j| j.1).sum();
            if sum > 0.0 {
                self.joints[first..].iter_mut().for_each(|j| j.1 /= sum);
            } else {
                // A vertex without weights follows the first joint, as in common viewers.
                self.joints.truncate(first);
                self.joints.push((0, 1.0));
            }
            self.starts.push(self.joints.len());
        }
        Ok(())
    }

    fn read_triangles(
        &mut self,
        mode: Mode,
        indices: &[u32],
        base: usize,
        count: usize,
    ) -> Result<(), MeshError> {
        let corners: Vec<[u32; 3]> = match mode {
            Mode::Triangles if !indices.len().is_multiple_of(3) => {
                return Err(malformed(format!(
                    "{} indices of triangles, a multiple of 3 is needed",
                    indices.len()
                )));
            }
            Mode::Triangles => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            Mode::TriangleStrip => indices
                .windows(3)
                .enumerate()
                .map(|(k, t)| if k % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
                .collect(),
            Mode::TriangleFan => {
                indices.get(1..).unwrap_or(&[]).windows(2).map(|t| [t[0], t[1], indices[0]]).collect()
            }
            other => {
                let what =
                    format!("a primitive of {other:?}: a mesh has Triangles, TriangleStrip or TriangleFan");
                return Err(MeshError::Unsupported { format: FORMAT, what });
            }
        };
        for (face, t) in corners.into_iter().enumerate() {
            if let Some(&v) = t.iter().find(|&&v| v as usize >= count) {
                return Err(MeshError::FaceIndex { face, vertex: i64::from(v), vertices: count });
            }
            if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                self.dropped += 1;
            } else {
                self.triangles.push(t.map(|v| v + base as u32));
            }
        }
        Ok(())
    }

    /// Writes the vertices with the weighted morph targets added.
    pub(super) fn morph(&self, weights: &[f64], out: &mut [[f64; 3]]) {
        out.iter_mut().zip(&self.points).for_each(|(o, p)| *o = p.map(f64::from));
        for (target, &w) in self.targets.iter().zip(weights) {
            if w != 0.0 {
                for &(v, d) in target {
                    (0..3).for_each(|k| out[v as usize][k] += w * f64::from(d[k]));
                }
            }
        }
    }

    /// Number of morph targets.
    pub(super) fn target_count(&self) -> usize {
        self.targets.len()
    }

    /// Joint weights of a vertex; empty without a skin.
    pub(super) fn joints_of(&self, vertex: usize) -> &[JointWeight] {
        match (self.starts.get(vertex), self.starts.get(vertex + 1)) {
            (Some(&a), Some(&b)) => &self.joints[a..b],
            _ => &[],
        }
    }
}
