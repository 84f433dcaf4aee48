//! The structure of a text: symbols, folding, and the types of links beside them.

use super::context::{At, Context};
use super::file::TextFile;
use super::names::{Target, names};
use crate::lang::ast::Entry;
use crate::lang::{Span, SyntaxKind, Value, ValueKind};
use lsp_types::{
    DocumentSymbol, FoldingRange, FoldingRangeKind, InlayHint, InlayHintKind, InlayHintLabel, SymbolKind,
};

/// Maximum depth of symbols of files that are no graphs.
const MAX_DEPTH: usize = 6;

/// The symbols of a text: the parts of a graph with its nodes, or the fields of any other file.
#[must_use]
pub fn symbols(file: &TextFile) -> Vec<DocumentSymbol> {
    let Some(value) = &file.document.value else { return Vec::new() };
    let Some((_, fields)) = value.as_struct() else { return Vec::new() };
    let one = |name: &str, span: &Span, selection: &Span, value: &Value| match value.as_map() {
        Some(entries) if file.is_graph() => {
            let children = entries.iter().filter_map(|entry| graph_entry(file, name, entry)).collect();
            symbol(file, name, String::new(), SymbolKind::NAMESPACE, (span, selection), children)
        }
        _ => {
            let children = parts(file, value, 1);
            symbol(file, name, short(file, value), SymbolKind::FIELD, (span, selection), children)
        }
    };
    fields.iter().map(|f| one(&f.name.value, &f.span, &f.name.span, &f.value)).collect()
}

fn graph_entry(file: &TextFile, map: &str, entry: &Entry) -> Option<DocumentSymbol> {
    let name = entry.key.as_str()?;
    let (kind, detail) = match map {
        "nodes" => (SymbolKind::OBJECT, entry.value.as_struct()?.0?.value.clone()),
        "use" => (SymbolKind::MODULE, short(file, &entry.value)),
        _ => (SymbolKind::CONSTANT, short(file, &entry.value)),
    };
    Some(symbol(file, name, detail, kind, (&entry.span, &entry.key.span), Vec::new()))
}

/// The parts of a value that have names.
fn parts(file: &TextFile, value: &Value, depth: usize) -> Vec<DocumentSymbol> {
    if depth > MAX_DEPTH {
        return Vec::new();
    }
    let named = |name: &str, span: &Span, selection: &Span, value: &Value| {
        let children = parts(file, value, depth + 1);
        symbol(file, name, short(file, value), SymbolKind::FIELD, (span, selection), children)
    };
    match &value.value {
        ValueKind::Struct(_, fields) => {
            fields.iter().map(|f| named(&f.name.value, &f.span, &f.name.span, &f.value)).collect()
        }
        ValueKind::Map(entries) => {
            let name = |entry: &Entry| short(file, &entry.key);
            entries.iter().map(|e| named(&name(e), &e.span, &e.key.span, &e.value)).collect()
        }
        ValueKind::List(items) if items.iter().any(|item| item.as_struct().is_some()) => {
            items.iter().enumerate().map(|(k, v)| named(&format!("[{k}]"), &v.span, &v.span, v)).collect()
        }
        _ => Vec::new(),
    }
}

/// A value on one line, shortened.
fn short(file: &TextFile, value: &Value) -> String {
    let text = file.text.get(value.span.clone()).unwrap_or_default();
    let line = text.lines().next().unwrap_or_default();
    match line.char_indices().nth(40) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line.to_owned(),
    }
}

// The field `deprecated` of a symbol is itself deprecated.
#[allow(deprecated)]
fn symbol(
    file: &TextFile,
    name: &str,
    detail: String,
    kind: SymbolKind,
    (span, selection): (&Span, &Span),
    children: Vec<DocumentSymbol>,
) -> DocumentSymbol {
    DocumentSymbol {
        // An editor may refuse a symbol without a name.
        name: if name.is_empty() { "\"\"".to_owned() } else { name.to_owned() },
        detail: (!detail.is_empty()).then_some(detail),
        kind,
        tags: None,
        deprecated: None,
        range: file.range(span),
        selection_range: file.range(selection),
        children: (!children.is_empty()).then_some(children),
    }
}

/// Ranges that can be folded: brackets over several lines, and comments of several lines.
#[must_use]
pub fn folding(file: &TextFile) -> Vec<FoldingRange> {
    let fold = |start: usize, end: usize, kind: Option<FoldingRangeKind>| {
        let (start, end) = (file.position(start).line, file.position(end).line);
        (end > start).then(|| FoldingRange {
            start_line: start,
            end_line: end,
            kind,
            ..FoldingRange::default()
        })
    };
    let root = file.parse.syntax();
    let mut found = Vec::new();
    let mut comments: Option<(usize, usize)> = None;
    for element in root.descendants_with_tokens() {
        let span = Span::from(element.text_range());
        match element.kind() {
            SyntaxKind::Struct | SyntaxKind::Tuple | SyntaxKind::List | SyntaxKind::Map => {
                // The line of the closing bracket stays visible.
                let last = file.position(span.end).line;
                let end = file.offset(lsp_types::Position::new(last.saturating_sub(1), 0));
                found.extend(fold(span.start, end.max(span.start), None));
            }
            SyntaxKind::LineComment => {
                comments = Some((comments.map_or(span.start, |(start, _)| start), span.end));
            }
            SyntaxKind::BlockComment => {
                found.extend(fold(span.start, span.end, Some(FoldingRangeKind::Comment)))
            }
            SyntaxKind::Whitespace if file.text[span].matches('\n').count() < 2 => {}
            _ if element.as_node().is_some() => {}
            _ => {
                let run = comments.take();
                found.extend(run.and_then(|(start, end)| fold(start, end, Some(FoldingRangeKind::Comment))));
            }
        }
    }
    found.extend(comments.and_then(|(start, end)| fold(start, end, Some(FoldingRangeKind::Comment))));
    found
}

/// The types of the links in a part of a text, each after its link.
#[must_use]
pub fn hints(context: &Context<'_>, at: At<'_>, part: &Span) -> Vec<InlayHint> {
    let all = names(context.workspace, context.registry, at.path, at.file);
    let mut hints = Vec::new();
    for (k, name) in all.iter().enumerate() {
        let is_link = matches!(name.target, Target::Node(..) | Target::Port(..)) && !name.declares;
        // The port belongs to the link whose node stands before it.
        let last = all.get(k + 1).is_none_or(|next| next.span.start > name.span.end + 1);
        if !is_link || !last || name.span.end < part.start || name.span.start > part.end {
            continue;
        }
        let text = &at.file.text;
        let start = text[..name.span.start].rfind('"').map_or(name.span.start, |quote| quote + 1);
        let Some((spec, stream)) = context.stream(at.path, &text[start..name.span.end]) else { continue };
        let label = match &stream {
            Some(stream) => format!("{}, {}", stream.rate, stream.format),
            None => format!("{} of {}", spec.kind.word(), spec.kind.name()),
        };
        hints.push(InlayHint {
            position: at.file.position(name.span.end + 1),
            label: InlayHintLabel::String(label),
            kind: Some(InlayHintKind::TYPE),
            text_edits: None,
            tooltip: None,
            padding_left: Some(true),
            padding_right: None,
            data: None,
        });
    }
    hints
}
