//! Quick fixes of diagnostics, and changes of selected nodes.

use super::analysis::Analysis;
use super::context::Context;
use super::extract::extract;
use super::file::TextFile;
use super::workspace::uri_of;
use crate::lang::edit::{TextEdit, remove_item};
use crate::lang::{Parse, Span};
use lsp_types::{
    CodeAction, CodeActionKind, CreateFile, CreateFileOptions, Diagnostic, DocumentChangeOperation,
    DocumentChanges, OneOf, OptionalVersionedTextDocumentIdentifier, Position, Range, ResourceOp,
    TextDocumentEdit, Uri, WorkspaceEdit,
};
use std::collections::HashMap;
use std::path::Path;

/// Codes of findings about something that can be removed: a node, a parameter, a duplicate.
const REMOVABLE: [(&str, &str); 3] =
    [("F026", "remove the node"), ("F029", "remove the parameter"), ("F005", "remove the second one")];

/// The actions for a selection of a text.
#[must_use]
pub fn actions(
    context: &Context<'_>,
    (path, file, uri): (&Path, &TextFile, &Uri),
    selection: &Span,
    known: &[Diagnostic],
) -> Vec<CodeAction> {
    let analysis = context.analyses.get(path);
    let mut all = Vec::new();
    if let Some(analysis) = analysis {
        all.extend(fixes(analysis, file, uri, selection, known));
    }
    if !selection.is_empty() {
        all.extend(extraction(context, (path, file, uri), selection));
    }
    all
}

/// The corrections of the findings that a selection touches.
fn fixes(
    analysis: &Analysis,
    file: &TextFile,
    uri: &Uri,
    selection: &Span,
    known: &[Diagnostic],
) -> Vec<CodeAction> {
    let mut all = Vec::new();
    let own = |place: usize| analysis.sources.get(place).is_some_and(|source| source.text == file.text);
    for found in &analysis.diagnostics {
        let Some(location) = found.location.as_ref().filter(|at| own(at.file)) else { continue };
        if location.span.start > selection.end || selection.start > location.span.end {
            continue;
        }
        let known = known.iter().filter(|d| d.range == file.range(&location.span)).cloned().collect();
        let known: Vec<Diagnostic> = known;
        let mut add = |title: String, edits: Vec<TextEdit>, preferred: bool| {
            all.push(CodeAction {
                title,
                kind: Some(CodeActionKind::QUICKFIX),
                diagnostics: (!known.is_empty()).then(|| known.clone()),
                edit: Some(edit_of(uri, file, &edits)),
                is_preferred: Some(preferred),
                ..CodeAction::default()
            });
        };
        for (k, fix) in found.fixes.iter().enumerate() {
            if let Some(edits) = fix.edits(&file.parse) {
                add(fix.title.clone(), edits, k == 0);
            }
        }
        if let Some((_, title)) = REMOVABLE.iter().find(|(code, _)| *code == found.code)
            && let Some(edits) = removal(&file.parse, &location.span)
        {
            add((*title).to_owned(), edits, false);
        }
    }
    all
}

/// Removes the entry or field whose key has this span.
fn removal(parse: &Parse, key: &Span) -> Option<Vec<TextEdit>> {
    let value = parse.document().value?;
    let mut item = None;
    value.walk(&mut |value| {
        let entries = value.as_map().unwrap_or_default().iter().map(|entry| (&entry.key.span, &entry.span));
        let fields = value.as_struct().map_or(&[][..], |(_, fields)| fields);
        let fields = fields.iter().map(|field| (&field.name.span, &field.span));
        let found = entries.chain(fields).find(|(of, _)| *of == key);
        item = found.map(|(_, span)| span.clone()).or(item.take());
    });
    remove_item(parse, item?).ok()
}

/// Moves the selected nodes into a sub-graph.
fn extraction(
    context: &Context<'_>,
    (path, file, uri): (&Path, &TextFile, &Uri),
    selection: &Span,
) -> Option<CodeAction> {
    let extraction = extract(context.workspace, context.registry, (path, file), selection)?;
    let new = uri_of(&extraction.path)?;
    let text = |uri: &Uri, edits: Vec<lsp_types::TextEdit>| {
        DocumentChangeOperation::Edit(TextDocumentEdit {
            text_document: OptionalVersionedTextDocumentIdentifier { uri: uri.clone(), version: None },
            edits: edits.into_iter().map(OneOf::Left).collect(),
        })
    };
    let start = Range::new(Position::new(0, 0), Position::new(0, 0));
    let create = CreateFile {
        uri: new.clone(),
        options: Some(CreateFileOptions { overwrite: Some(false), ignore_if_exists: Some(false) }),
        annotation_id: None,
    };
    let changes = vec![
        DocumentChangeOperation::Op(ResourceOp::Create(create)),
        text(&new, vec![lsp_types::TextEdit { range: start, new_text: extraction.text }]),
        text(uri, text_edits(file, &extraction.edits)),
    ];
    let name = extraction.path.file_name().unwrap_or_default().to_string_lossy();
    Some(CodeAction {
        title: format!("move {} node(s) into the sub-graph {name}", extraction.nodes),
        kind: Some(CodeActionKind::REFACTOR_EXTRACT),
        edit: Some(WorkspaceEdit {
            document_changes: Some(DocumentChanges::Operations(changes)),
            ..WorkspaceEdit::default()
        }),
        ..CodeAction::default()
    })
}

/// Edits of a text for the editor.
#[must_use]
pub fn text_edits(file: &TextFile, edits: &[TextEdit]) -> Vec<lsp_types::TextEdit> {
    let one = |e: &TextEdit| lsp_types::TextEdit { range: file.range(&e.span), new_text: e.new_text.clone() };
    edits.iter().map(one).collect()
}

// An address is a key as the protocol has it.
#[allow(clippy::mutable_key_type)]
fn edit_of(uri: &Uri, file: &TextFile, edits: &[TextEdit]) -> WorkspaceEdit {
    WorkspaceEdit {
        changes: Some(HashMap::from([(uri.clone(), text_edits(file, edits))])),
        ..WorkspaceEdit::default()
    }
}
