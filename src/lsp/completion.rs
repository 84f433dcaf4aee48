//! Completion: node types, fields, values, links and files.

mod item;
mod links;
mod snippet;
mod values;

use super::context::{At, Context, doc, port_line};
use super::formats::{FORMATS, Format};
use super::names::field_of;
use super::test_files::{Suggestion, is_test, suggestions};
use super::workspace::beside;
use crate::docs::{param_words, port_words};
use crate::graph::SCHEMA;
use crate::lang::SyntaxKind;
use crate::lang::cursor::{Cursor, Frame, Slot};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::ports::Arity;
use item::{Completion, Item};
use lsp_types::{CompletionItemKind, CompletionList};
use snippet::{node_snippet, value_snippet};
use values::Files;

/// Fields of a graph, each with its value as a snippet and its documentation.
const GRAPH_FIELDS: [(&str, &str, &str); 6] = [
    ("title", "\"$1\"", "Title of the graph."),
    ("seed", "${1:0}", "Seed of all randomness in the graph."),
    ("extends", "\"$1\"", "The path of a graph that this one adds to and changes."),
    ("params", "{\n    $0\n}", "Values to which `\"$name\"` refers; `--set NAME=VALUE` changes them."),
    ("use", "{\n    $0\n}", "Sub-graphs by name; their nodes get ids such as `name.node`."),
    ("nodes", "{\n    $0\n}", "The nodes, each by its id."),
];

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

impl Completion<'_> {
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
}
