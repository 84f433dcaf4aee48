//! The plain list of all node types.

use crate::core::node::NodeType;

/// Every node type, one line each, by family.
#[must_use]
pub fn all() -> Vec<NodeType> {
    vec![NodeType::of::<crate::dsp::Advance>("dsp")]
}
