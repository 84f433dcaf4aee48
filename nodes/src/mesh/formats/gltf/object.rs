//! The motion of any node of an asset: a mesh, an empty, a camera or a joint.

use std::collections::BTreeSet;

use ::gltf::animation::Property;
use ::gltf::{Animation, Document, Node};

use super::container::Buffers;
use super::pose::Pose;
use super::{
    GltfSelection, MeshError, MeshLimits, ObjectMotion, Resolve, frame_times, key_times, name_of,
    read_document, selected_animation,
};

/// Reads the motion of a node in the space of the scene (Y up in glTF): the transforms of all nodes above it are applied, and its own.
///
/// `selection.object` names a node, or a mesh that one node has; `node 7` is a node without a name, by its index. `None` reads the only node
/// that the animation moves. The frames are the keys of the nodes above the object, or at `selection.fps` from the first key on. A skin
/// does not move the node of its mesh, but its joints are nodes too.
///
/// # Errors
/// [`MeshError::NoSuchObject`], [`MeshError::AmbiguousObject`] and [`MeshError::NoSuchAnimation`] list what the asset has;
/// [`MeshError::TransformNotFinite`] names the first frame with an element that is NaN or infinite. A compressed asset and an accessor
/// outside of its buffer are errors.
///
/// # Complexity
/// Linear in frames times nodes above the object; 104 bytes a frame.
pub fn object_motion(
    bytes: &[u8],
    selection: &GltfSelection,
    resolve: Resolve<'_>,
    limits: &MeshLimits,
) -> Result<ObjectMotion, MeshError> {
    let (document, bin) = read_document(bytes, limits)?;
    let animation = selected_animation(&document, selection.animation.as_deref())?;
    let node = choose(&document, animation.as_ref(), selection.object.as_deref())?;
    let mut buffers = Buffers::load(&document, bin, resolve, *limits)?;
    let mut pose = Pose::read(&document, &node, animation, None, &mut buffers)?;
    let keys = key_times(&pose, limits)?;
    let times = frame_times(&keys, selection.fps, limits)?;
    let motion = ObjectMotion::evaluate(name_of(&node), times, |time| {
        pose.evaluate(Some(time));
        Ok(pose.world())
    })?;
    Ok(motion.with_keys(keys))
}

/// The node of a name, or the only one that the animation moves.
fn choose<'a>(
    document: &'a Document,
    animation: Option<&Animation<'_>>,
    wanted: Option<&str>,
) -> Result<Node<'a>, MeshError> {
    let names = || document.nodes().map(|node| name_of(&node)).collect();
    let Some(wanted) = wanted else {
        let channels = animation.into_iter().flat_map(Animation::channels);
        let targets = channels.map(|channel| channel.target());
        let moving = targets.filter(|target| target.property() != Property::MorphTargetWeights);
        let moving: BTreeSet<usize> = moving.map(|target| target.node().index()).collect();
        let mut nodes: Vec<Node<'a>> = document.nodes().filter(|n| moving.contains(&n.index())).collect();
        return match nodes.len() {
            1 => Ok(nodes.remove(0)),
            0 => Err(MeshError::AmbiguousObject { animated: 0, available: names() }),
            animated => {
                Err(MeshError::AmbiguousObject { animated, available: nodes.iter().map(name_of).collect() })
            }
        };
    };
    let only = |is_match: &dyn Fn(&Node<'_>) -> bool| {
        let mut found = document.nodes().filter(is_match);
        found.next().filter(|_| found.next().is_none())
    };
    only(&|node| name_of(node) == wanted)
        .or_else(|| only(&|node| node.mesh().is_some_and(|mesh| mesh.name() == Some(wanted))))
        .or_else(|| only(&|node| format!("node {}", node.index()) == wanted))
        .ok_or_else(|| MeshError::NoSuchObject { wanted: wanted.to_owned(), available: names() })
}
