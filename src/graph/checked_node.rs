//! A node whose own fields are checked, and whose links are texts.

use crate::diag::SourceLocation;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::ports::Arity;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A link as written: its text and location.
pub(super) struct RawLink {
    pub text: String,
    pub scope: String,
    pub location: SourceLocation,
}

/// A node whose own fields are checked.
pub(super) struct CheckedNode {
    pub ty: Arc<NodeType>,
    pub params: Option<Box<dyn AnyParams>>,
    pub links: Vec<Vec<RawLink>>,
    /// Inputs that need a link and have none.
    pub unlinked: Vec<usize>,
    /// The files that it writes, with the fields that name them.
    pub outputs: Vec<(&'static str, String)>,
    pub fields: BTreeMap<String, SourceLocation>,
    /// Locations of the fields that refer to a parameter of the graph; `fields` has those of the values.
    pub uses: BTreeMap<String, SourceLocation>,
}

impl CheckedNode {
    /// Sets the links of an input. A link to all items of an array has its location for each of them.
    pub fn set_links(&mut self, port: usize, links: Vec<RawLink>) {
        let spec = &self.ty.inputs[port];
        if spec.arity == Arity::Many {
            for (k, link) in links.iter().enumerate() {
                self.fields.insert(format!("{}[{k}]", spec.name), link.location.clone());
            }
        }
        self.links[port] = links;
    }
}
