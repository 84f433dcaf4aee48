//! One text with its tree, its values and its lines.

use crate::lang::ast::{Entry, Field, Name};
use crate::lang::{Document, LineIndex, Parse, Span, Value, parse};
use lsp_types::{Position, Range};
use std::collections::HashMap;
use std::sync::Arc;

/// A text of RON.
#[derive(Debug)]
pub struct TextFile {
    /// The text.
    pub text: Arc<str>,
    /// Its tree.
    pub parse: Parse,
    /// Its values.
    pub document: Document,
    lines: LineIndex,
    /// Locations of the nodes of a graph in its map, by id; the first of several with one id.
    by_id: HashMap<String, usize>,
}

/// A node in the text of a graph.
#[derive(Clone, Copy, Debug)]
pub struct NodeText<'a> {
    /// The entry of the map.
    pub entry: &'a Entry,
    /// Its id.
    pub id: &'a str,
    /// Its type.
    pub ty: &'a Name,
    /// Its fields.
    pub fields: &'a [Field],
}

/// A sub-graph that a graph uses.
#[derive(Clone, Copy, Debug)]
pub struct UseText<'a> {
    /// The entry of the map.
    pub entry: &'a Entry,
    /// Its name.
    pub name: &'a str,
    /// The value that is its path.
    pub path: &'a Value,
    /// True for an array of sub-graphs.
    pub is_array: bool,
}

impl TextFile {
    /// Parses a text.
    #[must_use]
    pub fn new(text: impl Into<Arc<str>>) -> Self {
        let text = text.into();
        let parse = parse(&text);
        let document = parse.document();
        let lines = LineIndex::new(&text);
        let mut file = Self { text, parse, document, lines, by_id: HashMap::new() };
        let entries = file.entries("nodes").iter().enumerate();
        let ids = entries.rev().filter_map(|(k, entry)| Some((entry.key.as_str()?.to_owned(), k))).collect();
        file.by_id = ids;
        file
    }

    /// The name of the value of the whole file, such as `Graph`.
    #[must_use]
    pub fn kind(&self) -> Option<&str> {
        Some(&self.document.value.as_ref()?.as_struct()?.0?.value)
    }

    /// Returns true if it is a graph, or is empty and may become one.
    #[must_use]
    pub fn is_graph(&self) -> bool {
        match (self.kind(), self.document.attribute("schema")) {
            (Some(kind), _) => kind == "Graph",
            (None, Some(schema)) => schema.value.starts_with("foley:graph/"),
            (None, None) => self.document.value.is_none(),
        }
    }

    /// The entries of a field of the graph that is a map.
    #[must_use]
    pub fn entries(&self, field: &str) -> &[Entry] {
        let value = self.document.value.as_ref().and_then(|graph| graph.field(field));
        value.and_then(Value::as_map).unwrap_or_default()
    }

    /// The nodes of a graph.
    pub fn nodes(&self) -> impl Iterator<Item = NodeText<'_>> {
        self.entries("nodes").iter().filter_map(node_text)
    }

    /// The node with an id.
    #[must_use]
    pub fn node(&self, id: &str) -> Option<NodeText<'_>> {
        node_text(self.entries("nodes").get(*self.by_id.get(id)?)?)
    }

    /// The entry of an id, also where its value is not a node yet.
    #[must_use]
    pub fn node_entry(&self, id: &str) -> Option<&Entry> {
        self.entries("nodes").get(*self.by_id.get(id)?)
    }

    /// The node whose text has an offset.
    #[must_use]
    pub fn node_at(&self, offset: usize) -> Option<NodeText<'_>> {
        let nodes = self.entries("nodes");
        let at = nodes.partition_point(|entry| entry.span.end < offset);
        nodes.get(at).filter(|entry| entry.span.start <= offset).and_then(node_text)
    }

    /// The sub-graphs that a graph uses.
    pub fn uses(&self) -> impl Iterator<Item = UseText<'_>> {
        self.entries("use").iter().filter_map(|entry| {
            let name = entry.key.as_str()?;
            let path =
                if entry.value.as_str().is_some() { &entry.value } else { entry.value.field("path")? };
            let is_array = matches!(entry.value.as_struct(), Some((Some(kind), _)) if kind.value == "Array");
            Some(UseText { entry, name, path, is_array })
        })
    }

    /// The sub-graph of a name.
    #[must_use]
    pub fn use_of(&self, name: &str) -> Option<UseText<'_>> {
        self.uses().find(|used| used.name == name)
    }

    /// The path of the graph that it extends.
    #[must_use]
    pub fn extends(&self) -> Option<&Value> {
        self.document.value.as_ref()?.field("extends").filter(|base| base.as_str().is_some())
    }

    /// The entry of a parameter of the graph.
    #[must_use]
    pub fn param(&self, name: &str) -> Option<&Entry> {
        self.entries("params").iter().find(|entry| entry.key.as_str() == Some(name))
    }

    /// The byte offset of a position of the editor.
    #[must_use]
    pub fn offset(&self, position: Position) -> usize {
        self.lines.offset_of_utf16(position.line as usize, position.character as usize)
    }

    /// The byte offset of a line and a column in characters, both from 1.
    #[must_use]
    pub fn offset_of(&self, line: usize, column: usize) -> usize {
        let Some(span) = self.lines.line_span(line) else { return self.text.len() };
        let columns = self.text[span.clone()].char_indices();
        let mut after = columns.skip(column.saturating_sub(1));
        after.next().map_or(span.end, |(at, _)| span.start + at)
    }

    /// The position of a byte offset for the editor.
    #[must_use]
    pub fn position(&self, offset: usize) -> Position {
        let (line, column) = self.lines.utf16(offset);
        Position::new(line as u32, column as u32)
    }

    /// The range of a span for the editor.
    #[must_use]
    pub fn range(&self, span: &Span) -> Range {
        Range::new(self.position(span.start), self.position(span.end))
    }

    /// The span of a range of the editor.
    #[must_use]
    pub fn span(&self, range: Range) -> Span {
        let (start, end) = (self.offset(range.start), self.offset(range.end));
        start..end.max(start)
    }
}

impl<'a> UseText<'a> {
    /// The values of its parameters, those of all items of an array among them.
    pub fn params(&self) -> impl Iterator<Item = &'a Entry> {
        let entry = self.entry;
        let of = |value: Option<&'a Value>| value.and_then(Value::as_map).unwrap_or_default();
        let items = entry.value.field("items").and_then(Value::as_list).unwrap_or_default();
        of(entry.value.field("params")).iter().chain(items.iter().flat_map(move |item| of(Some(item))))
    }

    /// Rest of a link after its name, without the number or `*` of an item of an array.
    #[must_use]
    pub fn rest<'t>(&self, rest: &'t str) -> &'t str {
        let (first, tail) = rest.split_once('.').unwrap_or((rest, ""));
        let is_item = first == "*" || first.parse::<usize>().is_ok();
        if self.is_array && is_item { tail } else { rest }
    }
}

fn node_text(entry: &Entry) -> Option<NodeText<'_>> {
    let id = entry.key.as_str()?;
    let (ty, fields) = entry.value.as_struct()?;
    Some(NodeText { entry, id, ty: ty?, fields })
}
