//! The plain list of all node types.

use crate::core::node::NodeType;
use crate::mesh::generate_node::MeshGenerator;
use crate::mesh::sequence_node::MeshSequence;

/// Every node type, one line each, by family.
#[must_use]
pub fn all() -> Vec<NodeType> {
    vec![NodeType::of::<MeshSequence>("mesh"), NodeType::of::<MeshGenerator>("mesh")]
}
