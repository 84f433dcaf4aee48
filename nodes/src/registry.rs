//! The plain list of all node types.

use crate::contact::detector_node::ContactDetector;
use crate::contact::speed_nodes::{SlidingSpeed, SpeedMapNode};
use crate::core::node::NodeType;
use crate::friction::builder_node::FrictionModelBuilder;
use crate::friction::ift_noise_node::IftNoiseNode;
use crate::friction::model_nodes::{FrictionModelFile, FrictionModelFromClips};
use crate::mesh::generate_node::MeshGenerator;
use crate::mesh::sequence_node::MeshSequence;

/// Every node type, one line each, by family.
#[must_use]
pub fn all() -> Vec<NodeType> {
    vec![
        NodeType::of::<MeshSequence>("mesh"),
        NodeType::of::<MeshGenerator>("mesh"),
        NodeType::of::<ContactDetector>("contact"),
        NodeType::of::<SlidingSpeed>("contact"),
        NodeType::each::<SpeedMapNode>("contact"),
        NodeType::of::<IftNoiseNode>("friction"),
        NodeType::of::<FrictionModelBuilder>("friction"),
        NodeType::func::<FrictionModelFromClips>("friction"),
        NodeType::func::<FrictionModelFile>("friction"),
    ]
}
