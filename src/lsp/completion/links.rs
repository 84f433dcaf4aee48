//! Links to outputs: those of the nodes of a graph, of the graphs that it extends, and of its sub-graphs.

use super::item::{Completion, Item};
use crate::lsp::context::port_line;
use crate::lsp::workspace::beside;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::ports::{Arity, PortSpec};
use lsp_types::CompletionItemKind;
use std::collections::BTreeSet;
use std::path::Path;

/// Maximum depth of sub-graphs whose nodes are offered.
const MAX_DEPTH: usize = 3;

impl Completion<'_> {
    /// Outputs that an input accepts; outputs of nodes before this one, and of the rate of its other inputs, come first.
    pub(super) fn links(&self, id: &str, port: &PortSpec, in_list: bool) -> Vec<Item> {
        if self.typed().starts_with('$') {
            return Vec::new();
        }
        let own = self.at.file.node_entry(id).map_or(self.at.offset, |entry| entry.span.start);
        let rate = self.other_rate(id, port.name);
        let mut items = Vec::new();
        self.outputs(self.at.path, "", 0, &mut |link, ty, output, start| {
            let is_own = link.split('.').next() == Some(id) && !port.delayed;
            if !output.kind.feeds(&port.kind) || is_own || !self.fits(link) {
                return;
            }
            let stream = self.context.stream(self.at.path, link).and_then(|(_, stream)| stream);
            let other = rate.as_ref().zip(stream.as_ref()).is_some_and(|(rate, stream)| stream.rate != *rate);
            let mut item = self.text(link, CompletionItemKind::VARIABLE, "");
            if port.arity == Arity::Many && !in_list && !self.in_text() {
                item.insert = format!("[{}]", item.insert);
            }
            item.detail = format!("{}, {}", ty.name, port_line(output, stream.as_ref()).replace('`', ""));
            item.doc = ty.summary().to_owned();
            item.order = match (other, start < own) {
                (false, true) => 0,
                (false, false) => 1,
                (true, _) => 2,
            };
            items.push(item);
        });
        items
    }

    /// Rate of the other streams that the node reads.
    fn other_rate(&self, id: &str, port: &str) -> Option<String> {
        let node = self.at.file.node(id)?;
        let ty = self.context.registry.get(&node.ty.value)?;
        let inputs = node.fields.iter().filter(|f| ty.inputs.iter().any(|p| p.name == f.name.value));
        let mut rates = inputs.flat_map(|field| {
            let mut found = Vec::new();
            field.value.walk(&mut |value| {
                let inside = value.span.start <= self.at.offset && self.at.offset <= value.span.end;
                let is_list = value.as_list().is_some();
                if !inside && !is_list && (field.name.value != port || ty.inputs.len() == 1) {
                    let stream = value.as_str().and_then(|link| self.context.stream(self.at.path, link));
                    found.extend(stream.and_then(|(_, stream)| stream).map(|stream| stream.rate));
                }
            });
            found
        });
        rates.next()
    }

    /// Calls `visit` with each output of the nodes of a file and its sub-graphs: the link, the type, the output, and the location of
    /// the node in the file of the request.
    pub(super) fn outputs(
        &self,
        path: &Path,
        prefix: &str,
        depth: usize,
        visit: &mut dyn FnMut(&str, &NodeType, &PortSpec, usize),
    ) {
        let layers = self.context.workspace.layers(path);
        // A node that a file extends or replaces is offered once.
        let mut seen = BTreeSet::new();
        let nodes = layers.iter().enumerate().flat_map(|(k, (_, file))| file.nodes().map(move |n| (k, n)));
        for (layer, node) in nodes {
            if !seen.insert(node.id) {
                continue;
            }
            let Some(ty) = self.context.registry.get(&node.ty.value) else { continue };
            let start = if depth == 0 && layer == 0 { node.entry.span.start } else { 0 };
            match ty.outputs {
                [only] => visit(&format!("{prefix}{}", node.id), ty, only, start),
                all => all.iter().for_each(|output| {
                    visit(&format!("{prefix}{}.{}", node.id, output.name), ty, output, start);
                }),
            }
        }
        let uses = layers.iter().flat_map(|(path, file)| file.uses().map(move |used| (path, used)));
        for (path, used) in uses.filter(|_| depth < MAX_DEPTH) {
            let Some(named) = used.path.as_str() else { continue };
            let items = if used.is_array { "*." } else { "" };
            self.outputs(&beside(path, named), &format!("{prefix}{}.{items}", used.name), depth + 1, visit);
        }
    }
}
