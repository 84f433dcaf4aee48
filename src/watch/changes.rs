//! The differences of two graphs, by the ids of their nodes.

use super::snapshot::{Contents, Key};
use crate::graph::{Graph, GraphNode};
use std::collections::{BTreeSet, HashMap};
use std::fmt;

/// The differences of two graphs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Parameters, as `node.param`.
    pub params: Vec<String>,
    /// Inputs with different links, as `node.input`.
    pub links: Vec<String>,
    /// Nodes that were added.
    pub added: Vec<String>,
    /// Nodes that were removed.
    pub removed: Vec<String>,
    /// Nodes with a different type.
    pub types: Vec<String>,
    /// Changed files, without the texts of the graph.
    pub files: Vec<String>,
    /// True if the seed is different.
    pub seed: bool,
}

impl Changes {
    /// Compares two graphs, and the contents of the files that they read.
    #[must_use]
    pub fn between(old: (&Graph, &Contents), new: (&Graph, &Contents)) -> Self {
        let mut changes = Self { seed: old.0.seed != new.0.seed, ..Self::default() };
        let by_id = |g: &Graph| -> HashMap<String, usize> {
            g.nodes.iter().enumerate().map(|(k, n)| (n.id.clone(), k)).collect()
        };
        let (before, after) = (by_id(old.0), by_id(new.0));
        for node in &new.0.nodes {
            match before.get(&node.id) {
                Some(&k) => changes.compare_nodes((old.0, &old.0.nodes[k]), (new.0, node)),
                None => changes.added.push(node.id.clone()),
            }
        }
        let removed = old.0.nodes.iter().filter(|n| !after.contains_key(&n.id));
        changes.removed = removed.map(|n| n.id.clone()).collect();
        let texts: BTreeSet<&str> =
            old.0.sources.iter().chain(new.0.sources.iter()).map(|s| s.name.as_str()).collect();
        let changed = |(key, content): &(&Key, _)| old.1.get(*key).is_some_and(|old| old != *content);
        let files = new.1.iter().filter(changed).map(|(key, _)| key.name());
        changes.files = files.filter(|name| !texts.contains(name.as_str())).collect();
        changes
    }

    fn compare_nodes(
        &mut self,
        (old, old_node): (&Graph, &GraphNode),
        (new, new_node): (&Graph, &GraphNode),
    ) {
        if old_node.ty.name != new_node.ty.name {
            self.types.push(new_node.id.clone());
            return;
        }
        for ((name, old), (_, new)) in old_node.params.write().iter().zip(new_node.params.write()) {
            if *old != new {
                self.params.push(format!("{}.{name}", new_node.id));
            }
        }
        let from = |graph: &Graph, node: &GraphNode, port: usize| -> Vec<(String, usize)> {
            node.links[port].iter().map(|l| (graph.nodes[l.node].id.clone(), l.port)).collect()
        };
        for (port, spec) in new_node.ty.inputs.iter().enumerate() {
            if from(old, old_node, port) != from(new, new_node, port) {
                self.links.push(format!("{}.{}", new_node.id, spec.name));
            }
        }
    }

    /// Returns true if at most comments and layout are different.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for Changes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds = [
            (&self.params, "parameter", "changed"),
            (&self.links, "link", "changed"),
            (&self.added, "node", "added"),
            (&self.removed, "node", "removed"),
            (&self.types, "node", "of another type"),
            (&self.files, "file", "changed"),
        ];
        let listed = kinds.iter().filter(|(names, ..)| !names.is_empty());
        let mut parts: Vec<String> = listed
            .map(|(names, what, how)| {
                let plural = if names.len() == 1 { "" } else { "s" };
                format!("{} {what}{plural} {how} ({})", names.len(), list(names))
            })
            .collect();
        if self.seed {
            parts.push("another seed".into());
        }
        if parts.is_empty() {
            parts.push("nothing in the graph changed".into());
        }
        f.write_str(&parts.join(", "))
    }
}

/// Joins the first four names of a list.
#[must_use]
pub fn list(names: &[String]) -> String {
    const MAX_NAMES: usize = 4;
    let shown = names.iter().take(MAX_NAMES).map(String::as_str).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(MAX_NAMES) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{LoadOptions, load_text};
    use std::path::Path;

    fn graph(nodes: &str) -> Graph {
        let text = format!("#![schema = \"foley:graph/1\"]\nGraph(nodes: {{{nodes}\n}})");
        let loaded = load_text("graph", &text, Path::new("graph.ron"), &LoadOptions::default());
        assert!(loaded.graph.is_some(), "{:?}", loaded.diagnostics);
        loaded.graph.unwrap()
    }

    fn between(old: &str, new: &str) -> String {
        let none = Contents::new();
        Changes::between((&graph(old), &none), (&graph(new), &none)).to_string()
    }

    const TWO: &str = r#""a": Tone(frequency: 440.0, rate: 48000), "b": Tone(frequency: 220.0, rate: 48000)"#;

    #[test]
    fn a_changed_parameter_is_named() {
        let before = format!("{TWO}, \"out\": WavOut(audio: \"a\", path: \"a.wav\")");
        let after = before.replace("440.0", "441.0");
        assert_eq!(between(&before, &after), "1 parameter changed (a.frequency)");
        assert_eq!(between(&before, &format!("{before} // a comment")), "nothing in the graph changed");
    }

    #[test]
    fn a_changed_link_and_an_added_node_are_distinguished() {
        let before = format!("{TWO}, \"out\": WavOut(audio: \"a\", path: \"a.wav\")");
        assert_eq!(
            between(&before, &before.replace("\"a\", path", "\"b\", path")),
            "1 link changed (out.audio)"
        );
        let more = format!("{before}, \"c\": Tone(frequency: 220.0, rate: 48000)");
        assert_eq!(between(&before, &more), "1 node added (c)");
        assert_eq!(between(&more, &before), "1 node removed (c)");
    }

    #[test]
    fn the_order_of_nodes_does_not_matter() {
        let end = "\"out\": WavOut(audio: \"a\", path: \"a.wav\")";
        assert_eq!(
            between(&format!("{TWO}, {end}"), &format!("{end}, {TWO}")),
            "nothing in the graph changed"
        );
    }

    #[test]
    fn long_lists_are_cut() {
        let names: Vec<String> = (0..6).map(|k| format!("n{k}")).collect();
        assert_eq!(list(&names), "n0, n1, n2, n3 and 2 more");
    }
}
