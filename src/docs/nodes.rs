//! The reference of all node types.

use super::{NOTE, plain, port_words};
use crate::lang;
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{ParamKind, ParamSpec};
use foley_nodes::core::ports::PortSpec;
use foley_nodes::registry::Registry;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

/// Example graphs by the node types in them; paths are relative to the root, with `/`.
pub type Examples = BTreeMap<String, BTreeSet<String>>;

/// Example graphs by node type.
pub fn examples(root: &Path) -> io::Result<Examples> {
    let mut all = Examples::new();
    let mut folders = vec!["graphs".to_owned()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = fs::read_dir(root.join(&folder)) else { continue };
        for entry in entries.flatten() {
            let Ok(name) = entry.file_name().into_string() else { continue };
            let path = format!("{folder}/{name}");
            if entry.path().is_dir() {
                folders.push(path);
            } else if name.ends_with(".ron") && !name.ends_with(".test.ron") {
                for ty in types_in(&fs::read_to_string(entry.path())?) {
                    all.entry(ty).or_default().insert(path.clone());
                }
            }
        }
    }
    Ok(all)
}

fn types_in(text: &str) -> Vec<String> {
    let document = lang::parse(text).document();
    let nodes = document.value.as_ref().and_then(|v| v.field("nodes")?.as_map());
    let name = |e: &lang::ast::Entry| e.value.as_struct()?.0.map(|name| name.value.clone());
    nodes.into_iter().flatten().filter_map(name).collect()
}

/// All node types in one page.
pub fn index(registry: &Registry) -> String {
    let mut out = format!(
        "{NOTE}# Nodes\n\n{} node types. `foley nodes NAME` prints the entry of one of them.\n",
        registry.types().len()
    );
    for family in registry.families() {
        let _ = writeln!(out, "\n## {family}\n\n| node | |\n|---|---|");
        for ty in registry.types().iter().filter(|t| t.family == family) {
            let link = format!("nodes/{family}.md#{}", super::anchor(ty.name));
            let _ = writeln!(out, "| [{}]({link}) | {} |", ty.name, cell(ty.summary()));
        }
    }
    out
}

/// The node types of one family.
pub fn family_page(family: &str, registry: &Registry, examples: &Examples) -> String {
    let mut out = format!("{NOTE}# {family}\n");
    for ty in registry.types().iter().filter(|t| t.family == family) {
        entry(&mut out, ty, examples);
    }
    out
}

fn entry(out: &mut String, ty: &NodeType, examples: &Examples) {
    // Headings of the doc stand below that of the node.
    let doc = format!("\n{}", plain(ty.doc)).replace("\n# ", "\n### ");
    let _ = writeln!(out, "\n## {}\n{doc}", ty.name);
    for (title, ports) in [("Input", ty.inputs), ("Output", ty.outputs)] {
        if !ports.is_empty() {
            let _ = writeln!(out, "\n| {title} | Carries | |\n|---|---|---|");
        }
        for port in ports {
            port_row(out, port);
        }
    }
    let specs = (ty.params)();
    if !specs.is_empty() {
        out.push_str("\n| Parameter | Takes | Default | |\n|---|---|---|---|\n");
    }
    for spec in &specs {
        param_row(out, spec, ty.inputs.iter().any(|p| p.name == spec.name));
    }
    let path = ty.source.path();
    let _ = write!(
        out,
        "\nVersion {}, runs as {}. Source: [{path}](../../../../{path}).",
        ty.version,
        ty.class.word()
    );
    if let Some(graphs) = examples.get(ty.name) {
        let links = graphs.iter().map(|path| format!("[{path}](../../../../{path})"));
        let _ = write!(out, " Used in {}.", links.collect::<Vec<_>>().join(", "));
    }
    out.push('\n');
}

fn port_row(out: &mut String, port: &PortSpec) {
    let _ = writeln!(out, "| `{}` | {} | {} |", port.name, cell(&port_words(port)), cell(&plain(port.doc)));
}

fn param_row(out: &mut String, spec: &ParamSpec, live: bool) {
    let mut takes = spec.kind.to_string();
    if let Some(unit) = spec.unit.filter(|u| !u.is_empty()) {
        let _ = write!(takes, " in {unit}");
    }
    if let Some(bounds) = spec.bounds {
        let _ = write!(takes, ", {bounds}");
    }
    let mut text = plain(spec.doc);
    if let ParamKind::Choice(choices) = spec.kind.innermost() {
        for (name, doc) in *choices {
            let _ = write!(text, " `{name}`: {}", plain(doc));
        }
    }
    if live {
        text.push_str(" Takes a link as well.");
    }
    let default = spec.default.as_ref().map_or_else(|| "required".into(), |d| format!("`{d}`"));
    let _ = writeln!(out, "| `{}` | {} | {} | {} |", spec.name, cell(&takes), cell(&default), cell(&text));
}

/// A text in one line that does not end its table cell.
fn cell(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_found_in_a_graph_text() {
        let text = "Graph(nodes: {\"a\": Gain(audio: \"b\"), \"b\": Noise, \"c\": 3})";
        assert_eq!(types_in(text), ["Gain", "Noise"]);
        assert!(types_in("][").is_empty());
    }

    #[test]
    fn cells_stay_in_their_table() {
        assert_eq!(cell("a |\n  b"), "a \\| b");
    }
}
