//! Links: from their text to the output that they name.

use super::Link;
use super::checked_node::{CheckedNode, RawLink};
use super::fixes::{self, Converter};
use super::loader::Loader;
use super::raw_node::RawNode;
use super::suggest::help;
use super::values::Given;
use crate::diag::{Diagnostic, Fix, SourceLocation};
use crate::lang::edit::quote;
use crate::lang::{Value, ValueKind};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::ports::{Arity, PortKind, PortSpec};
use foley_nodes::registry::Registry;
use std::collections::HashMap;
use std::sync::Arc;

/// Node types whose outputs an input takes.
pub(super) fn feeders(spec: &PortSpec, registry: &Registry) -> String {
    let gives = |ty: &&Arc<NodeType>| ty.outputs.iter().any(|o| o.kind.feeds(&spec.kind));
    let names: Vec<&str> = registry.types().iter().filter(gives).map(|ty| ty.name).take(12).collect();
    if names.is_empty() { "no node type gives it".into() } else { names.join(", ") }
}

/// With the help that a name without quotes wants them.
fn in_quotes(found: Diagnostic, value: &Value) -> Diagnostic {
    match (&value.value, found.location.clone()) {
        (ValueKind::Name(name), Some(location)) => {
            let fix = fixes::write(&quote(&name.value), &location);
            found.help(format!("\"{}\", in quotes", name.value)).fixes([fix])
        }
        _ => found,
    }
}

pub(super) fn links_of(given: &Given, spec: &PortSpec, node: &RawNode, loader: &mut Loader) -> Vec<RawLink> {
    let bare = loader.argument(given).is_some();
    let mut wrong = |value: &Value, what: &str| {
        let location = SourceLocation { file: given.location.file, span: value.span() };
        let message = format!("input `{}` takes {what}, found {}", spec.name, value.describe());
        loader.found.push(in_quotes(Diagnostic::error("F018", message, location).node(&node.id), value));
    };
    let raw = |value: &Value, text: &str| RawLink {
        text: text.to_owned(),
        scope: given.scope.prefix.clone(),
        location: SourceLocation { file: given.location.file, span: value.span() },
    };
    match (&given.value.value, spec.arity) {
        (ValueKind::Str(text), Arity::Many) => {
            all_items(text, &given.scope.prefix, loader).iter().map(|text| raw(&given.value, text)).collect()
        }
        (ValueKind::Str(text), _) => vec![raw(&given.value, text)],
        (ValueKind::Option(None), Arity::Optional) | (ValueKind::Error, _) => Vec::new(),
        // A text that needs quotes in a file may be bare on the command line.
        (ValueKind::Name(name), _) if bare => {
            vec![raw(&given.value, &name.value)]
        }
        (ValueKind::List(items), Arity::Many) => {
            let mut links = Vec::new();
            for item in items {
                match loader.resolve(given.inside(item)) {
                    Some(Given { value: Value { value: ValueKind::Str(text), .. }, scope, .. }) => {
                        let location = SourceLocation { file: given.location.file, span: item.span() };
                        for text in all_items(&text, &scope.prefix, loader) {
                            let (scope, location) = (scope.prefix.clone(), location.clone());
                            links.push(RawLink { text, scope, location });
                        }
                    }
                    Some(other) if !other.value.is_error() => {
                        let location = other.location.clone();
                        let message =
                            format!("a link is text such as \"node.port\", found {}", other.value.describe());
                        let found = Diagnostic::error("F018", message, location).node(&node.id);
                        loader.found.push(in_quotes(found, &other.value));
                    }
                    _ => {}
                }
            }
            links
        }
        (ValueKind::List(items), _) if items.len() != 1 => {
            let message = format!("input `{}` takes one link, found a list of {}", spec.name, items.len());
            let found = Diagnostic::error("F024", message, given.location.clone()).node(&node.id);
            let audio = matches!(spec.kind, PortKind::Stream(item) if item.name == "audio");
            let mix = || fixes::mix(&given.location, &node.location, &loader.sources, &loader.registry);
            let fix = if audio && !items.is_empty() { mix() } else { None };
            loader.found.push(found.help("put Mix in between to join several").fixes(fix));
            Vec::new()
        }
        (_, Arity::Many) => {
            wrong(&given.value, "a list of links such as [\"a\", \"b.port\"]");
            Vec::new()
        }
        _ => {
            wrong(&given.value, "a link such as \"node\" or \"node.port\"");
            Vec::new()
        }
    }
}

/// The links of a text with `*` in place of the number of an item: one for each item of the array.
fn all_items(text: &str, scope: &str, loader: &Loader) -> Vec<String> {
    let mut all = vec![text.to_owned()];
    while let Some(open) = all.iter().position(|text| text.contains(".*")) {
        let text = all[open].clone();
        let at = text.find(".*").unwrap_or_default() + 1;
        let Some(&count) = loader.arrays.get(&format!("{scope}{}", &text[..at])) else { return all };
        let items = (0..count).map(|k| format!("{}{k}{}", &text[..at], &text[at + 1..]));
        all.splice(open..=open, items);
    }
    all
}

/// Follows a link to the output that it names. `reader` is the location of the node with the input.
///
/// `None` where the other node, or its whole sub-graph, has errors of its own.
pub(super) fn link(
    raw: &RawLink,
    (input, reader): (&PortSpec, &SourceLocation),
    nodes: &[RawNode],
    checked: &[Option<CheckedNode>],
    by_id: &HashMap<&str, usize>,
    loader: &Loader,
) -> Result<Option<Link>, Diagnostic> {
    let error = |code, message: String| Diagnostic::error(code, message, raw.location.clone());
    let full = format!("{}{}", raw.scope, raw.text);
    let (node, port) = match by_id.get(full.as_str()) {
        Some(&node) => (node, None),
        None => match full.rsplit_once('.').and_then(|(id, port)| Some((*by_id.get(id)?, port))) {
            Some((node, port)) => (node, Some(port.to_owned())),
            None if loader.lost.iter().any(|prefix| full.starts_with(prefix)) => return Ok(None),
            None => return Err(unknown_node(raw, nodes, by_id)),
        },
    };
    let Some(checked_node) = &checked[node] else { return Ok(None) };
    let ty = &checked_node.ty;
    let ports = ty.outputs;
    let at = match port {
        Some(port) => match ports.iter().position(|p| p.name == port) {
            Some(at) => at,
            None => {
                let message = format!("`{}` ({}) has no output `{port}`", nodes[node].id, ty.name);
                let names = || ports.iter().map(|p| p.name);
                let id = raw.text.strip_suffix(&port).unwrap_or_default();
                let written = |port: &str| quote(&format!("{id}{port}"));
                let fix = fixes::rename(&port, names(), &raw.location, written);
                return Err(error("F021", message).help(help(&port, "outputs", names())).fixes(fix));
            }
        },
        None => match ports.len() {
            1 => 0,
            0 => return Err(error("F021", format!("`{}` ({}) has no outputs", nodes[node].id, ty.name))),
            _ => {
                let fitting: Vec<usize> =
                    (0..ports.len()).filter(|&k| ports[k].kind.feeds(&input.kind)).collect();
                let all: Vec<usize> = (0..ports.len()).collect();
                let which = if fitting.is_empty() { &all } else { &fitting };
                let names: Vec<String> =
                    which.iter().map(|&k| format!("\"{}.{}\"", raw.text, ports[k].name)).collect();
                let fixes: Vec<Fix> = names.iter().map(|name| fixes::write(name, &raw.location)).collect();
                let message = format!("`{}` ({}) has {} outputs", nodes[node].id, ty.name, ports.len());
                let found = error("F022", message).help(format!("name one: {}", names.join(" or ")));
                return Err(found.fixes(fixes));
            }
        },
    };
    let output = &ports[at];
    if !output.kind.feeds(&input.kind) {
        let message = format!(
            "input `{}` takes {}, `{}.{}` gives {}",
            input.name,
            kind_words(&input.kind),
            nodes[node].id,
            output.name,
            kind_words(&output.kind)
        );
        let between = Converter::find(&output.kind, &input.kind, &loader.registry);
        let found = error("F023", message)
            .label(nodes[node].location.clone(), format!("gives {}", kind_words(&output.kind)));
        return Err(match between {
            Some(converter) => {
                let is_taken = |id: &str| by_id.contains_key(format!("{}{id}", raw.scope).as_str());
                let insert = || converter.insert((&raw.text, &raw.location), reader, "", is_taken);
                let fix = if converter.is_complete { insert() } else { None };
                found.help(format!("put {} in between", converter.name)).fixes(fix)
            }
            None => found.help(format!(
                "nodes that give {}: {}",
                input.kind.name(),
                feeders(input, &loader.registry)
            )),
        });
    }
    Ok(Some(Link { node, port: at, location: raw.location.clone() }))
}

/// A link to a node that does not exist.
fn unknown_node(raw: &RawLink, nodes: &[RawNode], by_id: &HashMap<&str, usize>) -> Diagnostic {
    let error = Diagnostic::error("F020", format!("there is no node `{}`", raw.text), raw.location.clone());
    if raw.text.contains('*') {
        return error.help("`*` means all items of an array of sub-graphs, in an input that takes a list");
    }
    let id = raw.text.split('.').next().unwrap_or_default();
    let first = |(k, n): &(usize, &RawNode)| by_id.get(n.id.as_str()) == Some(k);
    let nodes = nodes.iter().enumerate().filter(first);
    let names: Vec<&str> = nodes.filter_map(|(_, n)| n.id.strip_prefix(raw.scope.as_str())).collect();
    let found = if names.contains(&id) { raw.text.as_str() } else { id };
    let rest = raw.text.strip_prefix(found).unwrap_or_default();
    let written = |id: &str| quote(&format!("{id}{rest}"));
    let fix = fixes::rename(found, names.iter().copied(), &raw.location, written);
    error.help(help(found, "nodes", names)).fixes(fix)
}

fn kind_words(kind: &PortKind) -> String {
    match kind {
        PortKind::Stream(t) => format!("a stream of {}", t.name),
        PortKind::Events(t) => format!("{} events", t.name),
        PortKind::Value(t) => format!("a {} value", t.name),
        PortKind::Fold(t) => format!("a {} made of a whole stream", t.name),
    }
}
