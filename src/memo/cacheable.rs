//! The node types whose results can be cached.

use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{ParamKind, ParamSpec};
use foley_nodes::core::ports::PortKind;

/// Returns true if a node writes files, so that it always runs.
#[must_use]
pub fn writes_files(ty: &NodeType) -> bool {
    let output = |spec: &ParamSpec| *spec.kind.innermost() == ParamKind::Output;
    ty.outputs.is_empty() || (ty.params)().iter().any(output)
}

/// Returns true if the streams of a node can be cached: it has no other outputs and writes no files.
#[must_use]
pub fn has_cacheable_streams(ty: &NodeType) -> bool {
    let stream = |kind: &PortKind| matches!(kind, PortKind::Stream(_) | PortKind::Events(_));
    !writes_files(ty) && ty.outputs.iter().all(|o| stream(&o.kind))
}

/// Returns true if the values of a node can be cached: it is a value node or a fold, and writes no files.
#[must_use]
pub fn has_cacheable_values(ty: &NodeType) -> bool {
    let fold = ty.outputs.iter().any(|o| matches!(o.kind, PortKind::Fold(_)));
    !writes_files(ty) && (ty.eval.is_some() || fold)
}
