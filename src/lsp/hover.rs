//! Hover texts of a word: documentation, values, rates and formats.

use super::context::{At, Context, doc, port_line};
use super::file::{NodeText, TextFile};
use super::names::{Target, field_of, follow, name_at, type_of};
use crate::docs::{param_words, port_words};
use crate::graph::omitted;
use crate::lang::{Span, Value, ValueKind};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::ParamKind;
use std::fmt::Write as _;
use std::path::Path;

/// The description of the element at an offset, as Markdown, and its span.
#[must_use]
pub fn hover(context: &Context<'_>, at: At<'_>) -> Option<(Span, String)> {
    if !at.file.is_graph() {
        return None;
    }
    if let Some(name) = name_at(context.workspace, context.registry, (at.path, at.file), at.offset) {
        let mut text = target(context, at, &name.target)?;
        // The link up to here is the id of a node of a sub-graph.
        let start = at.file.text[..name.span.start].rfind('"').map_or(name.span.start, |quote| quote + 1);
        if let Some(level) = context.inner_level(at.path, &at.file.text[start..name.span.end]) {
            let _ = write!(text, "\n\n{level}");
        }
        return Some((name.span, text));
    }
    let node = at.file.node_at(at.offset)?;
    let holds = |span: &Span| span.start <= at.offset && at.offset <= span.end;
    let ty = type_of(context.registry, &node);
    if holds(&node.ty.span) {
        return Some((node.ty.span(), type_page(ty?)));
    }
    let field = node.fields.iter().find(|field| holds(&field.span))?;
    let ty = ty?;
    if let Some(choice) = choice(ty, &field.name.value, &field.value, at.offset) {
        return Some(choice);
    }
    Some((field.name.span(), field_page(ty, &field.name.value)?))
}

/// The documentation of a choice.
fn choice(ty: &NodeType, field: &str, value: &Value, offset: usize) -> Option<(Span, String)> {
    let spec = field_of(ty, field).1?;
    let ParamKind::Choice(choices) = spec.kind.innermost() else { return None };
    let mut found = None;
    value.walk(&mut |value| {
        if let ValueKind::Name(name) = &value.value
            && name.span.start <= offset
            && offset <= name.span.end
        {
            found = choices.iter().find(|(choice, _)| *choice == name.value);
        }
    });
    let (name, text) = found?;
    Some((value.span(), format!("`{name}`: {}", doc(text))))
}

/// A field of a node: its type, and its documentation.
fn field_page(ty: &NodeType, name: &str) -> Option<String> {
    let (port, spec) = field_of(ty, name);
    let mut lines = Vec::new();
    lines.extend(port.map(|port| format!("**{name}**: {}", port_words(port))));
    lines.extend(spec.as_ref().map(|spec| format!("**{name}**: {}", param_words(spec))));
    let text = spec.map(|spec| spec.doc).or(port.map(|port| port.doc))?;
    lines.push(doc(text));
    Some(lines.join("\n\n"))
}

/// A node type: its documentation, ports and parameters.
#[must_use]
pub fn type_page(ty: &NodeType) -> String {
    let mut out =
        format!("**{}** ({}, runs as {})\n\n{}\n", ty.name, ty.family, ty.class.word(), doc(ty.doc));
    for (title, ports) in [("Inputs", ty.inputs), ("Outputs", ty.outputs)] {
        if !ports.is_empty() {
            let _ = write!(out, "\n{title}:\n\n");
        }
        for port in ports {
            let _ = writeln!(out, "- `{}`: {}", port.name, port_words(port));
        }
    }
    let specs = (ty.params)();
    if !specs.is_empty() {
        out.push_str("\nParameters:\n\n");
    }
    for spec in &specs {
        let _ = writeln!(out, "- `{}`: {}", spec.name, param_words(spec));
    }
    out
}

fn target(context: &Context<'_>, at: At<'_>, target: &Target) -> Option<String> {
    match target {
        Target::Node(path, id) => {
            // A graph that extends the node's graph may have replaced it.
            let linked = follow(context.workspace, at.path, id).filter(|_| of_own_layers(context, at, path));
            let path = linked.map_or_else(|| path.clone(), |linked| linked.path);
            let file = context.workspace.file(&path)?;
            node_page(context, at, &path, &file, id)
        }
        Target::Port(path, id, port) => {
            let file = context.workspace.file(path)?;
            let node = file.node(id)?;
            let ty = type_of(context.registry, &node)?;
            let place = ty.outputs.iter().position(|spec| spec.name == port)?;
            let stream = context.facts(path, id).and_then(|facts| facts.outputs.get(place)?.clone());
            let line = port_line(&ty.outputs[place], stream.as_ref());
            Some(format!("{line} ({} `{id}`)\n\n{}", ty.name, doc(ty.outputs[place].doc)))
        }
        Target::Param(path, name) => {
            let file = context.workspace.file(path)?;
            let value = file.param(name)?.value.span();
            Some(format!("Parameter `{name}` of the graph: `{}`", file.text.get(value)?))
        }
        Target::Use(path, name) => {
            let file = context.workspace.file(path)?;
            let named = file.use_of(name)?.path.as_str()?;
            let inner = context.workspace.file(&super::workspace::beside(path, named));
            let Some(inner) = inner else {
                return Some(format!("Sub-graph `{named}`, which cannot be read"));
            };
            let title = inner.document.value.as_ref().and_then(|graph| graph.field("title")?.as_str());
            let title = title.map(|title| format!(": {title}")).unwrap_or_default();
            let mut out = format!("Sub-graph `{named}`{title}, {} node(s)\n", inner.nodes().count());
            for entry in inner.entries("params") {
                let value = inner.text.get(entry.value.span.clone()).unwrap_or_default();
                let _ = write!(out, "\n- `{}`: `{value}`", entry.key.as_str().unwrap_or_default());
            }
            Some(out)
        }
        Target::File(path) => {
            let name = path.file_name()?.to_string_lossy();
            Some(match path.metadata() {
                Ok(meta) if meta.is_dir() => format!("Folder `{name}`"),
                Ok(meta) => format!("File `{name}`, {}", crate::plan::format_bytes(meta.len() as usize)),
                Err(_) => format!("There is no file `{}`", path.display()),
            })
        }
    }
}

/// Returns true if a file is that of a request, or one that it extends.
fn of_own_layers(context: &Context<'_>, at: At<'_>, path: &Path) -> bool {
    context.workspace.layers(at.path).iter().any(|(layer, _)| layer == path)
}

/// A node of a graph: its type, its outputs, and its latency and level where it plays.
fn node_page(context: &Context<'_>, at: At<'_>, path: &Path, file: &TextFile, id: &str) -> Option<String> {
    let node: NodeText<'_> = file.node(id)?;
    let Some(ty) = type_of(context.registry, &node) else {
        let name = &node.ty.value;
        return Some(match context.registry.omitted(name) {
            Some(feature) => format!("`{id}`: {}", omitted(name, feature).join("; ")),
            None => format!("`{id}`: {name}, which is not a node type"),
        });
    };
    let mut out = format!("**{id}**: {}\n\n{}\n", ty.name, ty.summary());
    let own = of_own_layers(context, at, path);
    let facts = context.facts(if own { at.path } else { path }, id);
    for (port, spec) in ty.outputs.iter().enumerate() {
        let stream = facts.and_then(|facts| facts.outputs.get(port)?.as_ref());
        let _ = write!(out, "\n- {}", port_line(spec, stream));
    }
    if let Some(facts) = facts {
        let end = facts.end.map(|end| format!("ends at {end:.3} s")).unwrap_or("has no end".to_owned());
        let latency = facts.latency.map(|latency| format!("; latency {:.1} ms", latency * 1e3));
        let _ = write!(out, "\n\n{end}{}", latency.unwrap_or_default());
    }
    // A meter has a name of its own.
    let name = node.fields.iter().find(|field| field.name.value == "name");
    let meter = name.and_then(|name| name.value.as_str()).unwrap_or(id);
    if let Some(level) = context.level(at.path, id, meter).filter(|_| own) {
        let _ = write!(out, "\n\n{level}");
    }
    Some(out)
}
