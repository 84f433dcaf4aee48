//! Moves nodes of a graph into a sub-graph of its own.

use super::file::{NodeText, TextFile};
use super::names::{Target, names};
use super::workspace::{Workspace, beside};
use crate::graph::{SCHEMA, free_id};
use crate::lang::Span;
use crate::lang::edit::{TextEdit, apply, insert_item, quote};
use crate::lang::fmt::format;
use foley_nodes::registry::Registry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A new file and the edits of the graph that uses it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Extraction {
    /// Path of the new file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// The edits of the graph.
    pub edits: Vec<TextEdit>,
    /// Number of nodes.
    pub nodes: usize,
}

/// Moves the nodes that a selection touches into a new file beside the graph, which uses it from then on.
///
/// Links from other nodes into the selection become links into the sub-graph; links out of it, and parameters that it reads,
/// become its parameters. Ids of the nodes change by the name of the sub-graph, and with them the seeds of their randomness.
#[must_use]
pub fn extract(
    workspace: &Workspace,
    registry: &Registry,
    (path, file): (&Path, &TextFile),
    selection: &Span,
) -> Option<Extraction> {
    if !file.parse.is_ok() {
        return None;
    }
    let touches = |span: &Span| span.start < selection.end && selection.start < span.end;
    let moved: Vec<NodeText<'_>> = file.nodes().filter(|node| touches(&node.entry.span)).collect();
    let (first, last) = (moved.first()?, moved.last()?);
    // All nodes of a graph are a graph already.
    if moved.len() == file.entries("nodes").len() {
        return None;
    }
    let ids: BTreeSet<&str> = moved.iter().map(|node| node.id).collect();
    // What changes a node of a graph that is extended has its meaning in this graph alone.
    let layers = workspace.layers(path);
    if layers.iter().skip(1).any(|(_, base)| ids.iter().any(|id| base.node_entry(id).is_some())) {
        return None;
    }
    let (name, target) = free_name(path, file)?;
    let block = block(file, &first.entry.span, &last.entry.span);
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    let mut params: BTreeMap<String, String> = BTreeMap::new();
    for found in names(workspace, registry, path, file).iter().filter(|found| !found.declares) {
        let at = found.span.start;
        let here = at >= block.start && at < block.end;
        match &found.target {
            // The first name of a link is that of a node or sub-graph of this graph, or of one that it extends.
            Target::Node(_, id) | Target::Use(_, id)
                if here && file.text[..at].ends_with('"') && !ids.contains(id.as_str()) =>
            {
                // The whole link becomes a parameter, with a name made of it.
                let start = file.text[..at].rfind('"')?;
                let end = at + file.text[at..].find('"')? + 1;
                let link = &file.text[start + 1..end - 1];
                let param = free_param(&link.replace(['.', '*'], "_"), link, file, &params);
                params.insert(param.clone(), link.to_owned());
                inside.push(TextEdit { span: start..end, new_text: quote(&format!("${param}")) });
            }
            Target::Param(_, param) if here => {
                params.insert(param.clone(), format!("${param}"));
            }
            Target::Node(of, id) if of == path && !here && ids.contains(id.as_str()) => {
                outside.push(TextEdit { span: at..at, new_text: format!("{name}.") });
            }
            _ => {}
        }
    }
    let shifted = inside.into_iter().map(|edit: TextEdit| TextEdit {
        span: edit.span.start - block.start..edit.span.end - block.start,
        ..edit
    });
    let body = apply(&file.text[block.clone()], &shifted.collect::<Vec<_>>()).ok()?;
    let required: String = params.keys().map(|name| format!("{}: Required,\n", quote(name))).collect();
    let required = if required.is_empty() { String::new() } else { format!("params: {{\n{required}}},\n") };
    let text = format!("#![schema = {}]\nGraph(\n{required}nodes: {{\n{body}\n}},\n)\n", quote(SCHEMA));
    let text = format(&text).ok()?;
    let given: Vec<String> =
        params.iter().map(|(name, value)| format!("{}: {}", quote(name), quote(value))).collect();
    let file_name = quote(target.file_name()?.to_str()?);
    let value = match given.is_empty() {
        true => file_name,
        false => format!("Sub(path: {file_name}, params: {{{}}})", given.join(", ")),
    };
    let mut edits = outside;
    edits.push(TextEdit { span: block, new_text: String::new() });
    edits.extend(use_entry(file, &format!("{}: {value}", quote(&name)))?);
    edits.sort_by_key(|edit| (edit.span.start, edit.span.end));
    Some(Extraction { path: target, text, edits, nodes: moved.len() })
}

/// The text of some entries: from the first line of comments above them to the comma after the last.
fn block(file: &TextFile, first: &Span, last: &Span) -> Span {
    let text = &file.text;
    let mut start = first.start;
    loop {
        let line = text[..start].rfind('\n').map_or(0, |at| at + 1);
        if !text[line..start].trim().is_empty() {
            break;
        }
        start = line;
        let above = text[..line.saturating_sub(1)].rfind('\n').map_or(0, |at| at + 1);
        if line == 0 || !text[above..line].trim_start().starts_with("//") {
            break;
        }
        // The end of the line above, so that its indentation is passed as well.
        start = above + text[above..line].len() - text[above..line].trim_start().len();
    }
    let after = &text[last.end..];
    let comma = after.len() - after.trim_start().len();
    let mut end = if after[comma..].starts_with(',') { last.end + comma + 1 } else { last.end };
    let line_end = text[end..].find('\n').map_or(text.len(), |at| end + at + 1);
    let rest = text[end..line_end].trim();
    if rest.is_empty() || rest.starts_with("//") {
        end = line_end;
    }
    start..end
}

/// A name of a sub-graph that is free in the graph, with a path that no file has.
fn free_name(path: &Path, file: &TextFile) -> Option<(String, PathBuf)> {
    let stem = path.file_stem()?.to_str()?.to_owned();
    let numbered = (2..1000).map(|k| format!("part{k}"));
    std::iter::once("part".to_owned()).chain(numbered).find_map(|name| {
        let target = beside(path, &format!("{stem}_{name}.ron"));
        let free = file.node_entry(&name).is_none() && file.use_of(&name).is_none() && !target.exists();
        free.then_some((name, target))
    })
}

/// A name for the parameter that replaces a link: the same for the same link.
fn free_param(base: &str, link: &str, file: &TextFile, params: &BTreeMap<String, String>) -> String {
    free_id(base, |name| match params.get(name) {
        Some(value) => value != link,
        // A parameter of the graph of that name may be read by the nodes too.
        None => file.param(name).is_some(),
    })
}

/// The edits that add an entry to the sub-graphs that a graph uses.
fn use_entry(file: &TextFile, entry: &str) -> Option<Vec<TextEdit>> {
    let graph = file.document.value.as_ref()?;
    if let Some(map) = graph.field("use") {
        return insert_item(&file.parse, map.span(), file.entries("use").len(), entry).ok();
    }
    let (_, fields) = graph.as_struct()?;
    let nodes = fields.iter().position(|field| field.name.value == "nodes")?;
    insert_item(&file.parse, graph.span(), nodes, &format!("use: {{{entry}}}")).ok()
}
