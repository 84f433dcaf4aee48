//! Reads the nodes of a graph, file by file: those of a file add to those of the files that it extends, and replace them.

use super::loader::{Layer, Loader};
use super::raw_node::{RawNode, valid_id};
use super::suggest::help;
use super::values::{Given, Origin, Scope};
use crate::diag::{Diagnostic, SourceLocation};
use crate::lang::{Value, ValueKind};
use std::collections::{BTreeMap, BTreeSet, HashMap};

impl Loader {
    pub(super) fn node_list(
        &mut self,
        layers: &[Layer],
        scope: &Scope,
        sets: &[(String, Given)],
        uses: &[String],
    ) {
        let start = self.nodes.len();
        for layer in layers {
            let before = self.nodes.len();
            if !self.layer_nodes(layer, scope, uses) {
                return;
            }
            self.merge_nodes(start, before);
        }
        for (target, value) in sets {
            let Some((id, param)) = target.split_once('.') else { continue };
            if uses.iter().any(|u| u == id) {
                continue;
            }
            match self.nodes[start..].iter_mut().find(|n| n.id == format!("{}{id}", scope.prefix)) {
                Some(node) => {
                    node.fields.retain(|(name, _, _)| name != param);
                    node.fields.push((param.to_owned(), value.location.clone(), value.clone()));
                }
                None => {
                    let names: Vec<String> = self.nodes[start..].iter().map(|n| n.id.clone()).collect();
                    let found = Diagnostic::error(
                        "F028",
                        format!("this graph has no node `{id}`"),
                        value.location.clone(),
                    );
                    self.found.push(found.help(help(id, "nodes", names.iter().map(String::as_str))));
                }
            }
        }
    }

    /// Adds the nodes of one file; returns false where there are too many.
    fn layer_nodes(&mut self, layer: &Layer, scope: &Scope, uses: &[String]) -> bool {
        let mut first: BTreeMap<String, SourceLocation> = BTreeMap::new();
        for entry in self.entries(layer.get("nodes"), layer.file, "nodes") {
            let Some(id) = entry.key.as_str() else { continue };
            let key = SourceLocation { file: layer.file, span: entry.key.span() };
            // A node whose id is wrong is checked like any other.
            if !valid_id(id) {
                self.bad_id(id, key.clone());
            } else if let Some(earlier) = first.get(id) {
                let found = Diagnostic::error("F006", format!("the id `{id}` exists twice"), key.clone());
                self.found.push(
                    found
                        .label(earlier.clone(), "first here")
                        .help("ids are the identity of nodes: give one of them another name"),
                );
            } else if uses.iter().any(|u| u == id) {
                self.error("F006", format!("`{id}` is the name of a sub-graph already"), key.clone());
            }
            first.entry(id.to_owned()).or_insert_with(|| key.clone());
            if self.nodes.len() >= self.limits.nodes {
                let found = Diagnostic::error("F009", format!("more than {} nodes", self.limits.nodes), key);
                self.stop(found.help("--max-nodes allows more"));
                return false;
            }
            self.node(id, key, &entry.value, layer, scope);
        }
        true
    }

    /// Merges the nodes from `new` on into those of the files that are extended, from `start` on: fields replace those of the
    /// same node, another type replaces the node, and `None` removes it.
    fn merge_nodes(&mut self, start: usize, new: usize) {
        if start == new {
            return;
        }
        let added = self.nodes.split_off(new);
        let place: HashMap<String, usize> =
            self.nodes[start..].iter().enumerate().map(|(k, n)| (n.id.clone(), start + k)).collect();
        let mut removed = BTreeSet::new();
        for node in added {
            match place.get(&node.id) {
                Some(&at) if node.removes => drop(removed.insert(at)),
                Some(&at) => self.nodes[at].extend(node),
                None => self.nodes.push(node),
            }
        }
        let mut at = 0;
        self.nodes.retain(|_| {
            at += 1;
            !removed.contains(&(at - 1))
        });
    }

    fn node(&mut self, id: &str, location: SourceLocation, value: &Value, layer: &Layer, scope: &Scope) {
        let file = layer.file;
        let at = |span: std::ops::Range<usize>| SourceLocation { file, span };
        let id = format!("{}{id}", scope.prefix);
        let (name, fields) = match value.as_struct() {
            Some((Some(name), fields)) => (name, fields),
            _ => {
                let removes = value.value == ValueKind::Option(None);
                let is_known = || self.nodes.iter().any(|node| node.id == id && node.location.file != file);
                if !(value.is_error() || removes && is_known()) {
                    let message =
                        format!("a node is NodeType(field: value, ...), found {}", value.describe());
                    self.found.push(Diagnostic::error("F010", message, at(value.span())).node(&id));
                }
                self.nodes.push(RawNode {
                    id,
                    type_name: String::new(),
                    type_location: at(value.span()),
                    location,
                    end: value.span().end,
                    fields: Vec::new(),
                    whole: false,
                    removes,
                });
                return;
            }
        };
        let mut whole = true;
        let mut seen: BTreeMap<&str, SourceLocation> = BTreeMap::new();
        let mut read = Vec::new();
        for field in fields {
            let field_name = field.name.value.as_str();
            let key = at(field.name.span());
            if let Some(first) = seen.get(field_name) {
                let found =
                    Diagnostic::error("F005", format!("`{field_name}` is given twice"), key).node(&id);
                self.found.push(found.label(first.clone(), "first here"));
                continue;
            }
            seen.insert(field_name, key.clone());
            whole &= !field.value.is_error();
            let given = Given {
                value: field.value.clone(),
                location: at(field.value.span()),
                folder: layer.folder.clone(),
                scope: scope.clone(),
                origin: Origin::Text,
            };
            read.push((field_name.to_owned(), key, given));
        }
        let (type_name, type_location) = (name.value.clone(), at(name.span()));
        let end = value.span().end;
        let removes = false;
        self.nodes.push(RawNode {
            id,
            type_name,
            type_location,
            location,
            end,
            fields: read,
            whole,
            removes,
        });
    }
}
