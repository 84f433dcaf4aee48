//! One mesh of a scene with its targets and joints, and the nodes that move it.

use std::collections::BTreeMap;

use ::gltf::animation::Property;
use ::gltf::mesh::Mode;

use super::super::matrix::Affine;
use super::super::{MeshError, MeshLimits};
use super::container::{Buffers, FORMAT, malformed};
use super::track::Track;

/// A joint and its share of a vertex.
pub(super) type Joint = (u32, f32);

/// Vertices, triangles, morph targets and joints of all primitives of a mesh.
pub(super) struct Instance {
    pub(super) points: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) dropped: usize,
    /// Per morph target the vertices that it moves.
    targets: Vec<Vec<(u32, [f32; 3])>>,
    joints: Vec<Joint>,
    /// Joints of vertex v are `joints[starts[v]..starts[v + 1]]`; empty without a skin.
    starts: Vec<usize>,
}

impl Instance {
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
                // A vertex without weights follows the first joint, as viewers have it.
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

    /// Vertices with the morph targets added.
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

    /// Joints of a vertex; none without a skin.
    pub(super) fn joints_of(&self, vertex: usize) -> &[Joint] {
        match (self.starts.get(vertex), self.starts.get(vertex + 1)) {
            (Some(&a), Some(&b)) => &self.joints[a..b],
            _ => &[],
        }
    }
}

/// A node that moves the mesh.
struct Mover {
    parent: Option<usize>,
    still: ([f64; 3], [f64; 4], [f64; 3]),
    /// The matrix of a node that is given by one: it cannot be animated.
    matrix: Option<Affine>,
    translation: Option<Track>,
    rotation: Option<Track>,
    scale: Option<Track>,
}

/// The nodes that move a mesh, and their state at one time.
pub(super) struct Pose {
    /// Parents stand before their children.
    movers: Vec<Mover>,
    world: Vec<Affine>,
    node: usize,
    /// Mover and inverse bind matrix of each joint.
    skin: Vec<(usize, Affine)>,
    joints: Vec<Affine>,
    still_weights: Vec<f64>,
    weight_track: Option<Track>,
    weights: Vec<f64>,
}

impl Pose {
    pub(super) fn read(
        document: &::gltf::Document,
        node: &::gltf::Node<'_>,
        animation: Option<&str>,
        instance: &Instance,
        buffers: &mut Buffers<'_>,
    ) -> Result<Self, MeshError> {
        let (movers, place) = movers(document, node)?;
        let skin = match node.skin() {
            Some(skin) => {
                let count = skin.joints().count();
                let matrices = match skin.inverse_bind_matrices() {
                    Some(accessor) => Some(buffers.floats(&accessor, 16)?),
                    None => None,
                };
                if matrices.as_ref().is_some_and(|m| m.len() < 16 * count) {
                    return Err(malformed(format!(
                        "a skin of {count} joints has fewer inverse bind matrices"
                    )));
                }
                let inverse = |k: usize| match &matrices {
                    Some(m) => affine(&m[16 * k..16 * k + 16]),
                    None => Affine::IDENTITY,
                };
                let at = |j: ::gltf::Node<'_>| {
                    place[j.index()].ok_or_else(|| malformed("a joint is not in the scene"))
                };
                skin.joints()
                    .enumerate()
                    .map(|(k, j)| Ok((at(j)?, inverse(k))))
                    .collect::<Result<Vec<_>, MeshError>>()?
            }
            None => Vec::new(),
        };
        let targets = instance.targets.len();
        let given = node.weights().or_else(|| node.mesh().and_then(|m| m.weights())).unwrap_or(&[]);
        let mut still_weights: Vec<f64> = given.iter().take(targets).map(|&w| f64::from(w)).collect();
        still_weights.resize(targets, 0.0);
        let own = place[node.index()].ok_or_else(|| malformed("the nodes above the mesh form a circle"))?;
        let mut pose = Self {
            world: vec![Affine::IDENTITY; movers.len()],
            joints: vec![Affine::IDENTITY; skin.len()],
            weights: still_weights.clone(),
            movers,
            node: own,
            skin,
            still_weights,
            weight_track: None,
        };
        pose.read_tracks(document, node.index(), animation, &place, buffers)?;
        Ok(pose)
    }

    fn read_tracks(
        &mut self,
        document: &::gltf::Document,
        node: usize,
        animation: Option<&str>,
        place: &[Option<usize>],
        buffers: &mut Buffers<'_>,
    ) -> Result<(), MeshError> {
        let chosen = match animation {
            Some(wanted) => {
                Some(document.animations().find(|a| a.name() == Some(wanted)).ok_or_else(|| {
                    let names = document.animations().filter_map(|a| a.name().map(str::to_owned));
                    MeshError::NoSuchAnimation { wanted: wanted.to_owned(), available: names.collect() }
                })?)
            }
            None => document.animations().next(),
        };
        let Some(chosen) = chosen else { return Ok(()) };
        for channel in chosen.channels() {
            let (target, sampler) = (channel.target(), channel.sampler());
            let (property, at) = (target.property(), target.node().index());
            let width = match property {
                Property::Translation | Property::Scale => 3,
                Property::Rotation => 4,
                Property::MorphTargetWeights => self.still_weights.len(),
            };
            if width == 0 || (property == Property::MorphTargetWeights && at != node) {
                continue;
            }
            let Some(mover) = place[at] else { continue };
            let times = buffers.floats(&sampler.input(), 1)?;
            let flat = if property == Property::MorphTargetWeights { 1 } else { width };
            let values = buffers.floats(&sampler.output(), flat)?;
            let interpolation = sampler.interpolation();
            if times.is_empty() || Track::needed(times.len(), width, interpolation) != Some(values.len()) {
                return Err(malformed(format!(
                    "a channel of node {at} has {} keys of {width} numbers ({interpolation:?}) and {} values",
                    times.len(),
                    values.len()
                )));
            }
            let increasing = times.windows(2).all(|w| w[0] < w[1]) && times.iter().all(|t| t.is_finite());
            if !increasing {
                return Err(malformed(format!("the key times of a channel of node {at} do not increase")));
            }
            let quaternion = property == Property::Rotation;
            let track = Some(Track { times, values, width, interpolation, quaternion });
            match property {
                Property::Translation => self.movers[mover].translation = track,
                Property::Rotation => self.movers[mover].rotation = track,
                Property::Scale => self.movers[mover].scale = track,
                Property::MorphTargetWeights => self.weight_track = track,
            }
        }
        Ok(())
    }

    /// Times of all keys, unsorted; at most about four times `limit` of them are gathered.
    pub(super) fn key_times(&self, limit: usize) -> Vec<f64> {
        let mut lists: Vec<&std::sync::Arc<Vec<f32>>> = Vec::new();
        let movers = self.movers.iter().flat_map(|m| [&m.translation, &m.rotation, &m.scale]);
        for track in movers.chain([&self.weight_track]).flatten() {
            // Channels of one animation mostly share their times.
            if !lists.iter().rev().take(64).any(|l| std::sync::Arc::ptr_eq(l, &track.times)) {
                lists.push(&track.times);
            }
        }
        let mut out: Vec<f64> = Vec::new();
        for list in lists {
            out.extend(list.iter().map(|&t| f64::from(t)));
            if out.len() > limit.saturating_mul(4) {
                out.sort_unstable_by(f64::total_cmp);
                out.dedup();
            }
            if out.len() > limit.saturating_mul(4) {
                break;
            }
        }
        out
    }

    /// Moves all nodes to a time, or to where they stand without animation.
    pub(super) fn at(&mut self, time: Option<f64>) {
        for k in 0..self.movers.len() {
            let mover = &self.movers[k];
            let local = mover.local(time);
            self.world[k] = match mover.parent {
                Some(parent) => self.world[parent].then_inner(&local),
                None => local,
            };
        }
        for (joint, (mover, inverse)) in self.joints.iter_mut().zip(&self.skin) {
            *joint = self.world[*mover].then_inner(inverse);
        }
        self.weights.copy_from_slice(&self.still_weights);
        if let (Some(time), Some(track)) = (time, &self.weight_track) {
            track.at(time, &mut self.weights);
        }
    }

    pub(super) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Whether the node turns windings round.
    pub(super) fn mirrors(&self) -> bool {
        self.skin.is_empty() && self.world[self.node].determinant() < 0.0
    }

    /// Where a vertex of the mesh is in the scene.
    pub(super) fn place(&self, joints: &[Joint], p: [f64; 3]) -> [f64; 3] {
        if joints.is_empty() {
            return self.world[self.node].apply(p);
        }
        let mut out = [0.0; 3];
        for &(joint, weight) in joints {
            let q = self.joints[joint as usize].apply(p);
            (0..3).for_each(|k| out[k] += f64::from(weight) * q[k]);
        }
        out
    }
}

impl Mover {
    fn local(&self, time: Option<f64>) -> Affine {
        if let Some(matrix) = self.matrix {
            return matrix;
        }
        let (mut t, mut r, mut s) = self.still;
        if let Some(time) = time {
            if let Some(track) = &self.translation {
                track.at(time, &mut t);
            }
            if let Some(track) = &self.rotation {
                track.at(time, &mut r);
            }
            if let Some(track) = &self.scale {
                track.at(time, &mut s);
            }
        }
        Affine::translation(t).then_inner(&Affine::rotation(r)).then_inner(&Affine::scale(s))
    }
}

/// The nodes of the mesh and its joints with all their ancestors, parents first, and where each node stands in the list.
fn movers(
    document: &::gltf::Document,
    node: &::gltf::Node<'_>,
) -> Result<(Vec<Mover>, Vec<Option<usize>>), MeshError> {
    let nodes: Vec<::gltf::Node<'_>> = document.nodes().collect();
    let mut parent: Vec<Option<usize>> = vec![None; nodes.len()];
    for n in &nodes {
        for child in n.children() {
            if parent[child.index()].replace(n.index()).is_some() {
                return Err(malformed(format!("node {} has two parents", child.index())));
            }
        }
    }
    let mut place: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut movers = Vec::new();
    let joints = node.skin().into_iter().flat_map(|s| s.joints().map(|j| j.index()).collect::<Vec<_>>());
    for start in std::iter::once(node.index()).chain(joints) {
        let mut path = Vec::new();
        let mut at = Some(start);
        while let Some(n) = at.filter(|&n| place[n].is_none()) {
            path.push(n);
            if path.len() > nodes.len() {
                return Err(malformed(format!("the nodes above node {start} form a circle")));
            }
            at = parent[n];
        }
        for n in path.into_iter().rev() {
            place[n] = Some(movers.len());
            let above = parent[n].and_then(|p| place[p]);
            movers.push(mover(&nodes[n], above));
        }
    }
    Ok((movers, place))
}

fn mover(node: &::gltf::Node<'_>, parent: Option<usize>) -> Mover {
    let transform = node.transform();
    let matrix = match &transform {
        ::gltf::scene::Transform::Matrix { matrix } => Some(affine(matrix.as_flattened())),
        ::gltf::scene::Transform::Decomposed { .. } => None,
    };
    let still = match transform {
        ::gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            (translation.map(f64::from), rotation.map(f64::from), scale.map(f64::from))
        }
        ::gltf::scene::Transform::Matrix { .. } => ([0.0; 3], [0.0, 0.0, 0.0, 1.0], [1.0; 3]),
    };
    Mover { parent, still, matrix, translation: None, rotation: None, scale: None }
}

/// The affine part of 16 numbers, column by column.
fn affine(m: &[f32]) -> Affine {
    Affine(std::array::from_fn(|r| std::array::from_fn(|c| f64::from(m[4 * c + r]))))
}
