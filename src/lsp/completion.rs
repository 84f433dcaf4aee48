//! Completion: node types, fields, values, links and files.

use super::context::{At, Context, doc, port_line};
use super::formats::{FORMATS, Format};
use super::names::field_of;
use super::test_files::{Suggestion, is_test, suggestions};
use super::workspace::beside;
use crate::docs::{param_words, port_words};
use crate::graph::{SCHEMA, placeholder};
use crate::lang::SyntaxKind;
use crate::lang::cursor::{Cursor, Frame, Slot, Word};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::{ParamKind, ParamSpec};
use foley_nodes::core::ports::{Arity, PortSpec};
use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionList, CompletionTextEdit, Documentation, InsertTextFormat,
    MarkupContent, MarkupKind, TextEdit,
};
use std::collections::BTreeSet;
use std::path::Path;

/// Fields of a graph, each with its value as a snippet and its documentation.
const GRAPH_FIELDS: [(&str, &str, &str); 6] = [
    ("title", "\"$1\"", "Title of the graph."),
    ("seed", "${1:0}", "Seed of all randomness in the graph."),
    ("extends", "\"$1\"", "The path of a graph that this one adds to and changes."),
    ("params", "{\n    $0\n}", "Values to which `\"$name\"` refers; `--set NAME=VALUE` changes them."),
    ("use", "{\n    $0\n}", "Sub-graphs by name; their nodes get ids such as `name.node`."),
    ("nodes", "{\n    $0\n}", "The nodes, each by its id."),
];

/// Maximum number of items that are offered at once.
const MAX_ITEMS: usize = 500;
/// Maximum number of files of a folder that are examined.
const MAX_FILES: usize = 4000;
/// Maximum depth of sub-graphs whose nodes are offered.
const MAX_DEPTH: usize = 3;

/// Returns the completions at a cursor that contain the typed letters in their order. Of very many the first are returned, marked as
/// incomplete, so that the editor requests them again when more is typed.
#[must_use]
pub fn complete(context: &Context<'_>, at: At<'_>) -> CompletionList {
    let Some(cursor) = Cursor::at(&at.file.text, at.offset) else { return CompletionList::default() };
    let completion = Completion { context, at, word: cursor.word.clone(), following: &cursor.following };
    if is_test(at.file) {
        let is_given = |name: &str| cursor.frames.last().is_some_and(|f| completion.is_given(f, name));
        let all = suggestions(&cursor).into_iter().filter(|one| !is_given(one.name));
        let item = |one: Suggestion| Item {
            label: one.name.to_owned(),
            insert: one.insert,
            snippet: true,
            kind: Some(CompletionItemKind::FIELD),
            doc: one.doc.to_owned(),
            ..Item::default()
        };
        return completion.list(all.map(item).collect());
    }
    if let Some(format) = Format::of(at.file) {
        let is_given = |name: &String| cursor.frames.last().is_some_and(|f| completion.is_given(f, name));
        let names = format.names(&cursor).into_iter().filter(|name| !is_given(name));
        return completion.list(names.map(|name| format_item(name, &cursor.slot)).collect());
    }
    // `Some(...)` changes nothing about what is meant.
    let slot = match cursor.frames.last() {
        Some(Frame { key: Some(key), .. }) if cursor.frames.last().is_some_and(Frame::is_some) => {
            Slot::Value(key.clone())
        }
        _ => cursor.slot.clone(),
    };
    let frames: Vec<&Frame> = cursor.frames[1..].iter().filter(|frame| !frame.is_some()).collect();
    completion.list(completion.at_place(&frames, &slot))
}

/// A field or a choice of a file that is no graph.
fn format_item(name: String, slot: &Slot) -> Item {
    let (insert, kind) = match slot {
        Slot::Value(_) => (name.clone(), CompletionItemKind::ENUM_MEMBER),
        _ => (format!("{name}: "), CompletionItemKind::FIELD),
    };
    Item { label: name, insert, kind: Some(kind), ..Item::default() }
}

struct Completion<'a> {
    context: &'a Context<'a>,
    at: At<'a>,
    word: Option<Word>,
    /// Fields that follow in the innermost bracket.
    following: &'a [String],
}

/// A completion: its label, the text to insert outside of quotes, and its documentation.
#[derive(Default)]
struct Item {
    label: String,
    /// The text that is inserted; with `$1` if it is a snippet.
    insert: String,
    snippet: bool,
    kind: Option<CompletionItemKind>,
    detail: String,
    doc: String,
    /// Place among the others: less comes first.
    order: u8,
}

impl Completion<'_> {
    /// The items with the typed letters; an incomplete list is requested again.
    fn list(&self, items: Vec<Item>) -> CompletionList {
        let count = items.len();
        let mut fitting: Vec<Item> = items.into_iter().filter(|item| self.fits(&item.label)).collect();
        fitting.sort_by(|a, b| (a.order, &a.label).cmp(&(b.order, &b.label)));
        fitting.truncate(MAX_ITEMS);
        let is_incomplete = fitting.len() < count || !self.typed().is_empty();
        CompletionList { is_incomplete, items: fitting.into_iter().map(|item| self.finish(item)).collect() }
    }

    /// Returns true for a label that has the typed letters in their order.
    fn fits(&self, label: &str) -> bool {
        let mut letters = label.chars().flat_map(char::to_lowercase);
        self.typed().chars().flat_map(char::to_lowercase).all(|typed| letters.any(|letter| letter == typed))
    }

    fn at_place(&self, frames: &[&Frame], slot: &Slot) -> Vec<Item> {
        match (frames, slot) {
            (_, Slot::After) => Vec::new(),
            ([], Slot::Item) => self.document(),
            ([attribute], Slot::Value(key)) if attribute.opener == SyntaxKind::LBracket => match &*key.text {
                "schema" => vec![self.text(SCHEMA, CompletionItemKind::CONSTANT, "the format of graphs")],
                _ => Vec::new(),
            },
            ([graph], Slot::Item) if graph.name() == Some("Graph") => self.graph_fields(graph),
            ([graph], Slot::Value(key)) if graph.name() == Some("Graph") && key.text == "extends" => {
                self.files("", Files::Graphs)
            }
            ([_, map], Slot::Item) if map.key() == Some("nodes") && self.in_text() => self.base_ids(),
            ([_, map], Slot::Value(_)) if map.key() == Some("nodes") => self.node_types(),
            ([_, map], Slot::Value(_)) if map.key() == Some("use") => {
                let mut items = self.files("", Files::Graphs);
                if !self.in_text() {
                    items.push(Item {
                        label: "Sub".into(),
                        insert: "Sub(path: \"$1\", params: {$2})".into(),
                        snippet: true,
                        kind: Some(CompletionItemKind::STRUCT),
                        doc: "A sub-graph with values for its parameters.".into(),
                        ..Item::default()
                    });
                    items.push(Item {
                        label: "Array".into(),
                        insert: "Array(path: \"$1\", items: [{$2}])".into(),
                        snippet: true,
                        kind: Some(CompletionItemKind::STRUCT),
                        doc: "A sub-graph for each of some items, with their parameters.".into(),
                        ..Item::default()
                    });
                }
                items
            }
            ([_, map, sub, rest @ ..], slot) if map.key() == Some("use") => self.sub_graph(sub, rest, slot),
            ([_, map], Slot::Value(_)) if map.key() == Some("params") => self.params(),
            ([_, map, node, rest @ ..], slot) if map.key() == Some("nodes") => self.in_node(node, rest, slot),
            _ => Vec::new(),
        }
    }

    /// Returns true if the cursor is between quotes.
    fn in_text(&self) -> bool {
        self.word.as_ref().is_some_and(|word| word.kind == SyntaxKind::Str)
    }

    fn typed(&self) -> &str {
        self.word.as_ref().map_or("", |word| &word.typed)
    }

    /// A text in quotes.
    fn text(&self, text: &str, kind: CompletionItemKind, detail: &str) -> Item {
        Item {
            label: text.to_owned(),
            insert: if self.in_text() { text.to_owned() } else { format!("\"{text}\"") },
            kind: Some(kind),
            detail: detail.to_owned(),
            ..Item::default()
        }
    }

    fn finish(&self, item: Item) -> CompletionItem {
        let file = self.at.file;
        let span = match &self.word {
            Some(word) if word.kind == SyntaxKind::Str => {
                let closed = file.text[word.span.clone()].len() > 1 && word.span.end > self.at.offset;
                word.span.start + 1..if closed { word.span.end - 1 } else { word.span.end }
            }
            Some(word) => word.span.clone(),
            None => self.at.offset..self.at.offset,
        };
        let snippet = item.snippet && self.context.snippets;
        let new_text = if item.snippet && !snippet { without_stops(&item.insert) } else { item.insert };
        let doc = (!item.doc.is_empty()).then_some(Documentation::MarkupContent(MarkupContent {
            kind: MarkupKind::Markdown,
            value: item.doc,
        }));
        CompletionItem {
            filter_text: Some(item.label.clone()),
            sort_text: Some(format!("{}{}", item.order, item.label)),
            label: item.label,
            kind: item.kind,
            detail: (!item.detail.is_empty()).then_some(item.detail),
            documentation: doc,
            insert_text_format: snippet.then_some(InsertTextFormat::SNIPPET),
            text_edit: Some(CompletionTextEdit::Edit(TextEdit { range: file.range(&span), new_text })),
            ..CompletionItem::default()
        }
    }

    fn document(&self) -> Vec<Item> {
        let schema = format!("#![schema = \"{SCHEMA}\"]\n");
        let head = if self.at.file.document.attributes.is_empty() { &*schema } else { "" };
        let formats = FORMATS.iter().map(|format| Item {
            label: format.name.to_owned(),
            insert: format!("{}(\n    version: 1,\n    $0\n)", format.name),
            snippet: true,
            kind: Some(CompletionItemKind::STRUCT),
            doc: format.doc.to_owned(),
            order: 1,
            ..Item::default()
        });
        let graph = Item {
            label: "Graph".into(),
            insert: format!("{head}Graph(\n    nodes: {{\n        $0\n    }},\n)"),
            snippet: true,
            kind: Some(CompletionItemKind::STRUCT),
            doc: "A graph of nodes.".into(),
            ..Item::default()
        };
        std::iter::once(graph).chain(formats).collect()
    }

    fn graph_fields(&self, graph: &Frame) -> Vec<Item> {
        let fields = GRAPH_FIELDS.iter().filter(|(name, _, _)| !self.is_given(graph, name));
        let item = |(name, value, doc): &(&str, &str, &str)| Item {
            label: (*name).to_owned(),
            insert: format!("{name}: {value},"),
            snippet: true,
            kind: Some(CompletionItemKind::FIELD),
            doc: (*doc).to_owned(),
            ..Item::default()
        };
        fields.map(item).collect()
    }

    /// Returns true if the innermost bracket already contains a field or key.
    fn is_given(&self, frame: &Frame, name: &str) -> bool {
        frame.given.iter().chain(self.following).any(|given| given == name)
    }

    fn node_types(&self) -> Vec<Item> {
        if self.in_text() {
            return Vec::new();
        }
        let end = self.word.as_ref().map_or(self.at.offset, |word| word.span.end);
        let has_bracket = self.at.file.text[end..].starts_with('(');
        let item = |ty: &NodeType| Item {
            label: ty.name.to_owned(),
            insert: if has_bracket { ty.name.to_owned() } else { node_snippet(ty) },
            snippet: !has_bracket,
            kind: Some(CompletionItemKind::CLASS),
            detail: ty.family.to_owned(),
            doc: ty.summary().to_owned(),
            ..Item::default()
        };
        self.context.registry.types().iter().map(|ty| item(ty)).collect()
    }

    /// Ids of the nodes of the graphs that this one extends.
    fn base_ids(&self) -> Vec<Item> {
        let layers = self.context.workspace.layers(self.at.path);
        let base = layers.iter().skip(1).flat_map(|(_, file)| file.nodes());
        let missing = base.filter(|node| self.at.file.node_entry(node.id).is_none());
        missing.map(|node| self.text(node.id, CompletionItemKind::VARIABLE, &node.ty.value)).collect()
    }

    fn in_node(&self, node: &Frame, rest: &[&Frame], slot: &Slot) -> Vec<Item> {
        let Some(ty) = node.name().and_then(|name| self.context.registry.get(name)) else {
            return Vec::new();
        };
        let field = match (rest.first(), slot) {
            (Some(list), _) => list.key(),
            (None, Slot::Value(key)) => Some(&*key.text),
            (None, _) => None,
        };
        let Some(field) = field else { return self.fields(ty, node) };
        let (port, spec) = field_of(ty, field);
        let in_list = !rest.is_empty();
        let mut items = Vec::new();
        if let Some(port) = port {
            items.extend(self.links(node.key().unwrap_or_default(), port, in_list));
        }
        if let Some(spec) = &spec {
            items.extend(self.values(spec, in_list));
        }
        items.extend(self.params());
        items
    }

    fn fields(&self, ty: &NodeType, node: &Frame) -> Vec<Item> {
        let specs = (ty.params)();
        let ports = ty.inputs.iter().filter(|port| !self.is_given(node, port.name)).map(|port| {
            let value = match port.arity {
                Arity::Many => "[\"$1\"]",
                Arity::One | Arity::Optional => "\"$1\"",
            };
            let by_value = specs.iter().find(|spec| spec.name == port.name);
            let value = by_value.map_or_else(|| value.to_owned(), value_snippet);
            let takes_value = by_value.map(|spec| format!("; or {}", param_words(spec))).unwrap_or_default();
            let required = port.arity != Arity::Optional && by_value.is_none();
            Item {
                label: port.name.to_owned(),
                insert: format!("{}: {value}", port.name),
                snippet: true,
                kind: Some(CompletionItemKind::FIELD),
                detail: format!("{}{takes_value}", port_words(port)),
                doc: doc(port.doc),
                order: if required { 0 } else { 1 },
            }
        });
        let only = specs.iter().filter(|spec| ty.inputs.iter().all(|port| port.name != spec.name));
        let params = only.filter(|spec| !self.is_given(node, spec.name)).map(|spec| Item {
            label: spec.name.to_owned(),
            insert: format!("{}: {}", spec.name, value_snippet(spec)),
            snippet: true,
            kind: Some(CompletionItemKind::PROPERTY),
            detail: param_words(spec),
            doc: doc(spec.doc),
            order: if spec.default.is_none() { 0 } else { 2 },
        });
        ports.chain(params).collect()
    }

    /// Outputs that an input accepts; outputs of nodes before this one, and of the rate of its other inputs, come first.
    fn links(&self, id: &str, port: &PortSpec, in_list: bool) -> Vec<Item> {
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
    fn outputs(
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

    fn values(&self, spec: &ParamSpec, in_list: bool) -> Vec<Item> {
        let mut items = Vec::new();
        let innermost = spec.kind.innermost();
        match innermost {
            ParamKind::Asset => items.extend(self.files(self.typed(), Files::All)),
            ParamKind::Folder => items.extend(self.files(self.typed(), Files::Folders)),
            _ if self.in_text() => {}
            ParamKind::Choice(names) => items.extend(names.iter().map(|(name, text)| Item {
                label: (*name).to_owned(),
                insert: (*name).to_owned(),
                kind: Some(CompletionItemKind::ENUM_MEMBER),
                doc: doc(text),
                ..Item::default()
            })),
            ParamKind::Bool => items.extend(["true", "false"].map(|word| Item {
                label: word.to_owned(),
                insert: word.to_owned(),
                kind: Some(CompletionItemKind::VALUE),
                ..Item::default()
            })),
            _ => {}
        }
        if self.in_text() {
            return items;
        }
        if matches!(spec.kind, ParamKind::Maybe(_)) {
            items.push(Item {
                label: "None".into(),
                insert: "None".into(),
                kind: Some(CompletionItemKind::VALUE),
                ..Item::default()
            });
        }
        if let Some(default) = spec.default.as_ref().filter(|_| !in_list).map(ToString::to_string)
            && items.iter().all(|item| item.label != default)
        {
            items.push(Item {
                insert: default.clone(),
                label: default,
                kind: Some(CompletionItemKind::VALUE),
                detail: format!("the default; {}", param_words(spec)),
                ..Item::default()
            });
        }
        items
    }

    /// The parameters of the graph.
    fn params(&self) -> Vec<Item> {
        let layers = self.context.workspace.layers(self.at.path);
        let mut items: Vec<Item> = Vec::new();
        for (_, file) in &layers {
            for entry in file.entries("params") {
                let Some(name) = entry.key.as_str() else { continue };
                let value = file.text.get(entry.value.span.clone()).unwrap_or_default();
                let item = self.text(&format!("${name}"), CompletionItemKind::CONSTANT, value);
                if items.iter().all(|known| known.label != item.label) {
                    items.push(Item { order: 5, ..item });
                }
            }
        }
        items
    }

    fn sub_graph(&self, sub: &Frame, rest: &[&Frame], slot: &Slot) -> Vec<Item> {
        match (rest, slot) {
            ([], Slot::Item) => {
                let fields = [("path", "\"$1\""), ("params", "{$1}"), ("items", "[{$1}]")];
                let count = if sub.name() == Some("Array") { 3 } else { 2 };
                let fields = fields[..count].to_vec();
                let fields = fields.iter().filter(|(name, _)| !self.is_given(sub, name));
                let item = |(name, value): &(&str, &str)| Item {
                    label: (*name).to_owned(),
                    insert: format!("{name}: {value}"),
                    snippet: true,
                    kind: Some(CompletionItemKind::FIELD),
                    ..Item::default()
                };
                fields.map(item).collect()
            }
            ([], Slot::Value(key)) if key.text == "path" => self.files(self.typed(), Files::Graphs),
            ([params], Slot::Item) | ([_, params], Slot::Item) if params.opener == SyntaxKind::LBrace => {
                let used = sub.key().and_then(|name| self.at.file.use_of(name));
                let path = used.and_then(|used| Some(beside(self.at.path, used.path.as_str()?)));
                let Some(file) = path.and_then(|path| self.context.workspace.file(&path)) else {
                    return Vec::new();
                };
                let entries = file.entries("params").iter().filter_map(|entry| {
                    let name = entry.key.as_str()?;
                    let value = file.text.get(entry.value.span.clone()).unwrap_or_default();
                    (!self.is_given(params, name)).then_some((name, value))
                });
                entries.map(|(name, value)| self.text(name, CompletionItemKind::CONSTANT, value)).collect()
            }
            ([.., params], Slot::Value(_)) if params.opener == SyntaxKind::LBrace => {
                let mut items = self.params();
                self.outputs(self.at.path, "", 0, &mut |link, ty, output, _| {
                    let detail = format!("{}, {}", ty.name, port_line(output, None).replace('`', ""));
                    items.push(Item { order: 6, ..self.text(link, CompletionItemKind::VARIABLE, &detail) });
                });
                items
            }
            _ => Vec::new(),
        }
    }

    /// Files and folders beside the graph, or in the folder that is typed already.
    fn files(&self, typed: &str, wanted: Files) -> Vec<Item> {
        let typed = if typed.is_empty() { self.typed() } else { typed };
        let typed = if self.in_text() { typed } else { "" };
        let folder = typed.rfind('/').map_or("", |at| &typed[..=at]);
        let mut items = Vec::new();
        let mut add = |name: &str, is_folder: bool, size: u64| {
            let text = format!("{folder}{name}{}", if is_folder { "/" } else { "" });
            let kind = if is_folder { CompletionItemKind::FOLDER } else { CompletionItemKind::FILE };
            let size = if is_folder { String::new() } else { crate::plan::format_bytes(size as usize) };
            let order = if is_folder { 4 } else { 3 };
            items.push(Item { order, ..self.text(&text, kind, &size) });
        };
        let root = beside(self.at.path, folder);
        for entry in std::fs::read_dir(root).into_iter().flatten().flatten().take(MAX_FILES) {
            let (name, path) = (entry.file_name(), entry.path());
            let (Some(name), Ok(meta)) = (name.to_str(), path.metadata()) else { continue };
            let fits = match wanted {
                Files::Folders => meta.is_dir(),
                Files::Graphs => meta.is_dir() || name.ends_with(".ron") && path != self.at.path,
                Files::All => true,
            };
            if fits && !name.starts_with('.') {
                add(name, meta.is_dir(), meta.len());
            }
        }
        // The folders that a graph may read besides its own.
        for shared in ["../assets", "../lib"] {
            if folder.is_empty() && beside(self.at.path, shared).is_dir() {
                add(shared, true, 0);
            }
        }
        items.sort_by(|a, b| (a.order, &a.label).cmp(&(b.order, &b.label)));
        items
    }
}

/// Files that a field takes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Files {
    All,
    Graphs,
    Folders,
}

/// A node with its required fields.
fn node_snippet(ty: &NodeType) -> String {
    let specs = (ty.params)();
    let has_value = |name: &str| specs.iter().any(|spec| spec.name == name && spec.default.is_some());
    let mut fields = Vec::new();
    for port in ty.inputs.iter().filter(|port| port.arity != Arity::Optional && !has_value(port.name)) {
        let stop = fields.len() + 1;
        fields.push(match port.arity {
            Arity::Many => format!("{}: [\"${stop}\"]", port.name),
            Arity::One | Arity::Optional => format!("{}: \"${stop}\"", port.name),
        });
    }
    for spec in specs.iter().filter(|s| s.default.is_none() && ty.inputs.iter().all(|p| p.name != s.name)) {
        let stop = fields.len() + 1;
        fields.push(format!(
            "{}: {}",
            spec.name,
            value_snippet(spec).replacen("$1", &format!("${stop}"), 1).replacen(
                "${1",
                &format!("${{{stop}"),
                1
            )
        ));
    }
    format!("{}({})", ty.name, fields.join(", "))
}

/// The value of a parameter as a snippet: its default or a first value, to be typed over.
fn value_snippet(spec: &ParamSpec) -> String {
    let value = spec.default.as_ref().map_or_else(|| placeholder(spec), ToString::to_string);
    match value.as_str() {
        "\"\"" => "\"$1\"".to_owned(),
        value => format!("${{1:{}}}", value.replace('\\', "\\\\").replace('$', "\\$").replace('}', "\\}")),
    }
}

/// A snippet as plain text.
fn without_stops(snippet: &str) -> String {
    let (mut out, mut rest) = (String::new(), snippet);
    while let Some(at) = rest.find(['$', '\\']) {
        out.push_str(&rest[..at]);
        let tail = &rest[at + 1..];
        if rest[at..].starts_with('\\') {
            out.extend(tail.chars().next());
            rest = tail.get(1..).unwrap_or("");
        } else if let Some(inner) = tail.strip_prefix('{') {
            let end = inner.find('}').unwrap_or(inner.len());
            out.push_str(inner[..end].split_once(':').map_or("", |(_, value)| value));
            rest = inner.get(end + 1..).unwrap_or("");
        } else {
            rest = tail.trim_start_matches(|c: char| c.is_ascii_digit());
        }
    }
    out + rest
}
