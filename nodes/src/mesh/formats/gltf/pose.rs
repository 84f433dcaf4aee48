//! The nodes that move an object, evaluated at a time.

use std::sync::Arc;

use ::gltf::animation::Property;

use super::super::MeshError;
use super::super::affine::Affine;
use super::channel::Channel;
use super::container::{Buffers, malformed};
use super::instance::{Instance, JointWeight};

/// A node above the object or above one of the joints of its mesh.
struct PoseNode {
    parent: Option<usize>,
    /// Translation, rotation and scale without animation.
    bind: ([f64; 3], [f64; 4], [f64; 3]),
    /// The matrix of a node that has one: such a node cannot be animated.
    matrix: Option<Affine>,
    translation: Option<Channel>,
    rotation: Option<Channel>,
    scale: Option<Channel>,
}

/// The nodes that move an object, and their transforms at one time.
pub(super) struct Pose {
    /// Parents stand before their children.
    nodes: Vec<PoseNode>,
    world: Vec<Affine>,
    /// Index of the node of the object in `nodes`.
    object: usize,
    /// Index in `nodes` and inverse bind matrix of each joint.
    skin: Vec<(usize, Affine)>,
    joints: Vec<Affine>,
    /// Morph weights without animation.
    bind_weights: Vec<f64>,
    weight_channel: Option<Channel>,
    weights: Vec<f64>,
}

impl Pose {
    /// Reads the nodes above `node` and one animation; with a mesh also its skin and its morph weights.
    pub(super) fn read(
        document: &::gltf::Document,
        node: &::gltf::Node<'_>,
        animation: Option<::gltf::Animation<'_>>,
        mesh: Option<&Instance>,
        buffers: &mut Buffers<'_>,
    ) -> Result<Self, MeshError> {
        let skin = node.skin().filter(|_| mesh.is_some());
        let (nodes, index_of) = pose_nodes(document, node, skin.as_ref())?;
        let skin = match skin {
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
                let joint_index = |j: ::gltf::Node<'_>| {
                    index_of[j.index()].ok_or_else(|| malformed("a joint is not in the scene"))
                };
                let mut joints = Vec::with_capacity(count);
                for (k, joint) in skin.joints().enumerate() {
                    joints.push((joint_index(joint)?, inverse(k)));
                }
                joints
            }
            None => Vec::new(),
        };
        let targets = mesh.map_or(0, Instance::target_count);
        let default_weights = node.weights().or_else(|| node.mesh().and_then(|m| m.weights())).unwrap_or(&[]);
        let mut bind_weights: Vec<f64> =
            default_weights.iter().take(targets).map(|&w| f64::from(w)).collect();
        bind_weights.resize(targets, 0.0);
        let object =
            index_of[node.index()].ok_or_else(|| malformed("the nodes above the object form a cycle"))?;
        let mut pose = Self {
            world: vec![Affine::IDENTITY; nodes.len()],
            joints: vec![Affine::IDENTITY; skin.len()],
            weights: bind_weights.clone(),
            nodes,
            object,
            skin,
            bind_weights,
            weight_channel: None,
        };
        if let Some(animation) = animation {
            pose.read_channels(&animation, node.index(), &index_of, buffers)?;
        }
        Ok(pose)
    }

    fn read_channels(
        &mut self,
        animation: &::gltf::Animation<'_>,
        node: usize,
        index_of: &[Option<usize>],
        buffers: &mut Buffers<'_>,
    ) -> Result<(), MeshError> {
        for channel in animation.channels() {
            let (target, sampler) = (channel.target(), channel.sampler());
            let (property, target_node) = (target.property(), target.node().index());
            let width = match property {
                Property::Translation | Property::Scale => 3,
                Property::Rotation => 4,
                Property::MorphTargetWeights => self.bind_weights.len(),
            };
            if width == 0 || (property == Property::MorphTargetWeights && target_node != node) {
                continue;
            }
            let Some(index) = index_of[target_node] else { continue };
            let times = buffers.floats(&sampler.input(), 1)?;
            let flat = if property == Property::MorphTargetWeights { 1 } else { width };
            let values = buffers.floats(&sampler.output(), flat)?;
            let interpolation = sampler.interpolation();
            if times.is_empty()
                || Channel::value_count(times.len(), width, interpolation) != Some(values.len())
            {
                return Err(malformed(format!(
                    "a channel of node {target_node} has {} keys of {width} numbers ({interpolation:?}) and {} values",
                    times.len(),
                    values.len()
                )));
            }
            let increasing = times.windows(2).all(|w| w[0] < w[1]) && times.iter().all(|t| t.is_finite());
            if !increasing {
                return Err(malformed(format!(
                    "the key times of a channel of node {target_node} do not increase"
                )));
            }
            let quaternion = property == Property::Rotation;
            let channel = Some(Channel { times, values, width, interpolation, quaternion });
            match property {
                Property::Translation => self.nodes[index].translation = channel,
                Property::Rotation => self.nodes[index].rotation = channel,
                Property::Scale => self.nodes[index].scale = channel,
                Property::MorphTargetWeights => self.weight_channel = channel,
            }
        }
        Ok(())
    }

    /// Times of all keys, unsorted; collection stops at about four times `limit`.
    pub(super) fn key_times(&self, limit: usize) -> Vec<f64> {
        let mut lists: Vec<&Arc<Vec<f32>>> = Vec::new();
        let channels = self.nodes.iter().flat_map(|m| [&m.translation, &m.rotation, &m.scale]);
        for channel in channels.chain([&self.weight_channel]).flatten() {
            // Channels of one animation often share their times.
            if !lists.iter().rev().take(64).any(|l| Arc::ptr_eq(l, &channel.times)) {
                lists.push(&channel.times);
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

    /// Evaluates all nodes at a time, or without animation.
    pub(super) fn evaluate(&mut self, time: Option<f64>) {
        for k in 0..self.nodes.len() {
            let node = &self.nodes[k];
            let local = node.local(time);
            self.world[k] = match node.parent {
                Some(parent) => self.world[parent].product(&local),
                None => local,
            };
        }
        for (joint, (node, inverse)) in self.joints.iter_mut().zip(&self.skin) {
            *joint = self.world[*node].product(inverse);
        }
        self.weights.copy_from_slice(&self.bind_weights);
        if let (Some(time), Some(channel)) = (time, &self.weight_channel) {
            channel.evaluate(time, &mut self.weights);
        }
    }

    pub(super) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Transform of the node of the object to the scene.
    pub(super) fn world(&self) -> Affine {
        self.world[self.object]
    }

    /// Returns true if the transform of the mesh reverses windings.
    pub(super) fn mirrors(&self) -> bool {
        self.skin.is_empty() && self.world().determinant() < 0.0
    }

    /// Position of a vertex of the mesh in the scene.
    pub(super) fn transform(&self, joints: &[JointWeight], p: [f64; 3]) -> [f64; 3] {
        if joints.is_empty() {
            return self.world[self.object].apply(p);
        }
        let mut out = [0.0; 3];
        for &(joint, weight) in joints {
            let q = self.joints[joint as usize].apply(p);
            (0..3).for_each(|k| out[k] += f64::from(weight) * q[k]);
        }
        out
    }
}

impl PoseNode {
    /// Transform relative to the parent.
    fn local(&self, time: Option<f64>) -> Affine {
        if let Some(matrix) = self.matrix {
            return matrix;
        }
        let (mut t, mut r, mut s) = self.bind;
        if let Some(time) = time {
            if let Some(channel) = &self.translation {
                channel.evaluate(time, &mut t);
            }
            if let Some(channel) = &self.rotation {
                channel.evaluate(time, &mut r);
            }
            if let Some(channel) = &self.scale {
                channel.evaluate(time, &mut s);
            }
        }
        Affine::translation(t).product(&Affine::rotation(r)).product(&Affine::scale(s))
    }
}

/// A node and the joints of a skin with all their ancestors, parents first, and the index of each node of the document in
/// this list.
fn pose_nodes(
    document: &::gltf::Document,
    node: &::gltf::Node<'_>,
    skin: Option<&::gltf::Skin<'_>>,
) -> Result<(Vec<PoseNode>, Vec<Option<usize>>), MeshError> {
    let nodes: Vec<::gltf::Node<'_>> = document.nodes().collect();
    let mut parent: Vec<Option<usize>> = vec![None; nodes.len()];
    for n in &nodes {
        for child in n.children() {
            if parent[child.index()].replace(n.index()).is_some() {
                return Err(malformed(format!("node {} has two parents", child.index())));
            }
        }
    }
    let mut index_of: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut pose_nodes = Vec::new();
    let joints = skin.into_iter().flat_map(|s| s.joints().map(|j| j.index()));
    for start in std::iter::once(node.index()).chain(joints) {
        let mut path = Vec::new();
        let mut current = Some(start);
        while let Some(n) = current.filter(|&n| index_of[n].is_none()) {
            path.push(n);
            if path.len() > nodes.len() {
                return Err(malformed(format!("the nodes above node {start} form a cycle")));
            }
            current = parent[n];
        }
        for n in path.into_iter().rev() {
            index_of[n] = Some(pose_nodes.len());
            let parent_index = parent[n].and_then(|p| index_of[p]);
            pose_nodes.push(pose_node(&nodes[n], parent_index));
        }
    }
    Ok((pose_nodes, index_of))
}

fn pose_node(node: &::gltf::Node<'_>, parent: Option<usize>) -> PoseNode {
    let transform = node.transform();
    let matrix = match &transform {
        ::gltf::scene::Transform::Matrix { matrix } => Some(affine(matrix.as_flattened())),
        ::gltf::scene::Transform::Decomposed { .. } => None,
    };
    let bind = match transform {
        ::gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            (translation.map(f64::from), rotation.map(f64::from), scale.map(f64::from))
        }
        ::gltf::scene::Transform::Matrix { .. } => ([0.0; 3], [0.0, 0.0, 0.0, 1.0], [1.0; 3]),
    };
    PoseNode { parent, bind, matrix, translation: None, rotation: None, scale: None }
}

/// Affine part of a column-major 4 by 4 matrix.
fn affine(m: &[f32]) -> Affine {
    Affine(std::array::from_fn(|r| std::array::from_fn(|c| f64::from(m[4 * c + r]))))
}
