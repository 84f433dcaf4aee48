//! Answers to the requests of an editor.

use super::actions::{actions, text_edits};
use super::completion::complete;
use super::context::{At, Context};
use super::diagnostics::uri;
use super::file::TextFile;
use super::hover::hover;
use super::names::{Occurrence, Target, name_at, names, occurrences};
use super::outline::{folding, hints, symbols};
use super::rename::rename;
use super::tokens::tokens;
use super::workspace::path_of;
use crate::lang::edit::TextEdit;
use crate::lang::fmt::format;
use lsp_types::request::{
    CodeActionRequest, Completion, DocumentHighlightRequest, DocumentLinkRequest, DocumentSymbolRequest,
    FoldingRangeRequest, Formatting, GotoDefinition, HoverRequest, InlayHintRequest, PrepareRenameRequest,
    References, Rename, Request, SemanticTokensFullRequest, SemanticTokensRangeRequest,
};
use lsp_types::{
    CodeActionOrCommand, CompletionResponse, DocumentHighlight, DocumentLink, DocumentSymbolResponse,
    GotoDefinitionResponse, Hover, HoverContents, Location, MarkupContent, MarkupKind, Position,
    PrepareRenameResponse, Range, SemanticTokens, SemanticTokensRangeResult, SemanticTokensResult,
    TextDocumentPositionParams, Uri, WorkspaceEdit,
};
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The answer to a request; `None` for an unknown method.
///
/// # Errors
/// Parameters that cannot be read, or a rename that cannot be made.
pub fn answer(context: &Context<'_>, method: &str, params: Value) -> Option<Result<Value, String>> {
    let requests = Requests { context };
    Some(match method {
        Completion::METHOD => reply::<Completion>(params, |p| {
            let at = requests.place(&p.text_document_position);
            let list = at.map(|place| complete(context, place.at()));
            Ok(Some(CompletionResponse::List(list.unwrap_or_default())))
        }),
        HoverRequest::METHOD => reply::<HoverRequest>(params, |p| {
            let Some(place) = requests.place(&p.text_document_position_params) else { return Ok(None) };
            Ok(hover(context, place.at()).map(|(span, value)| Hover {
                contents: HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value }),
                range: Some(place.file.range(&span)),
            }))
        }),
        GotoDefinition::METHOD => reply::<GotoDefinition>(params, |p| {
            let name = requests.name(&p.text_document_position_params);
            let location = name.and_then(|(_, name)| requests.declaration(&name.target));
            Ok(location.map(GotoDefinitionResponse::Scalar))
        }),
        References::METHOD => reply::<References>(params, |p| {
            let Some((_, name)) = requests.name(&p.text_document_position) else { return Ok(None) };
            let all = occurrences(context.workspace, context.registry, &name.target).into_iter();
            let all = all.filter(|(_, found)| p.context.include_declaration || !found.declares);
            Ok(Some(all.filter_map(|(path, found)| requests.location(&path, &found)).collect()))
        }),
        DocumentHighlightRequest::METHOD => reply::<DocumentHighlightRequest>(params, |p| {
            let Some((place, name)) = requests.name(&p.text_document_position_params) else {
                return Ok(None);
            };
            let all = names(context.workspace, context.registry, &place.path, &place.file).into_iter();
            let same = all.filter(|found| found.target == name.target);
            let one =
                |found: Occurrence| DocumentHighlight { range: place.file.range(&found.span), kind: None };
            Ok(Some(same.map(one).collect()))
        }),
        PrepareRenameRequest::METHOD => reply::<PrepareRenameRequest>(params, |p| {
            let Some((place, name)) = requests.name(&p) else { return Ok(None) };
            let placeholder = match name.target {
                Target::Node(_, name) | Target::Use(_, name) | Target::Param(_, name) => name,
                Target::Port(..) | Target::File(_) => return Ok(None),
            };
            let range = place.file.range(&name.span);
            Ok(Some(PrepareRenameResponse::RangeWithPlaceholder { range, placeholder }))
        }),
        Rename::METHOD => reply::<Rename>(params, |p| {
            let name = requests.name(&p.text_document_position);
            let (_, name) = name.ok_or("no node, sub-graph or parameter is named here")?;
            let edits = rename(context.workspace, context.registry, &name.target, &p.new_name)?;
            Ok(Some(requests.workspace_edit(edits)))
        }),
        Formatting::METHOD => reply::<Formatting>(params, |p| {
            let file = requests.file(&p.text_document.uri).map(|(_, file)| file);
            let laid_out = file.as_ref().and_then(|file| Some((file, format(&file.text).ok()?)));
            Ok(laid_out.map(|(file, new)| text_edits(file, &difference(&file.text, &new))))
        }),
        DocumentSymbolRequest::METHOD => reply::<DocumentSymbolRequest>(params, |p| {
            let file = requests.file(&p.text_document.uri);
            Ok(file.map(|(_, file)| DocumentSymbolResponse::Nested(symbols(&file))))
        }),
        FoldingRangeRequest::METHOD => reply::<FoldingRangeRequest>(params, |p| {
            Ok(requests.file(&p.text_document.uri).map(|(_, file)| folding(&file)))
        }),
        SemanticTokensFullRequest::METHOD => reply::<SemanticTokensFullRequest>(params, |p| {
            let tokens = requests.tokens(&p.text_document.uri, None);
            Ok(tokens.map(SemanticTokensResult::Tokens))
        }),
        SemanticTokensRangeRequest::METHOD => reply::<SemanticTokensRangeRequest>(params, |p| {
            let tokens = requests.tokens(&p.text_document.uri, Some(p.range));
            Ok(tokens.map(SemanticTokensRangeResult::Tokens))
        }),
        InlayHintRequest::METHOD => reply::<InlayHintRequest>(params, |p| {
            let Some((path, file)) = requests.file(&p.text_document.uri) else { return Ok(None) };
            let at = At { path: &path, file: &file, offset: 0 };
            Ok(Some(hints(context, at, &file.span(p.range))))
        }),
        CodeActionRequest::METHOD => reply::<CodeActionRequest>(params, |p| {
            let address = &p.text_document.uri;
            let Some((path, file)) = requests.file(address) else { return Ok(None) };
            let text = (&*path, &*file, address);
            let all = actions(context, text, &file.span(p.range), &p.context.diagnostics);
            let wanted = |kind: &lsp_types::CodeActionKind| {
                let only = p.context.only.as_deref();
                only.is_none_or(|only| only.iter().any(|only| kind.as_str().starts_with(only.as_str())))
            };
            let all = all.into_iter().filter(|action| action.kind.as_ref().is_none_or(wanted));
            Ok(Some(all.map(CodeActionOrCommand::CodeAction).collect()))
        }),
        DocumentLinkRequest::METHOD => reply::<DocumentLinkRequest>(params, |p| {
            let Some((path, file)) = requests.file(&p.text_document.uri) else { return Ok(None) };
            let all = names(context.workspace, context.registry, &path, &file).into_iter();
            let links = all.filter_map(|found| match found.target {
                Target::File(path) if path.is_file() => Some(DocumentLink {
                    range: file.range(&found.span),
                    target: uri(context.workspace, &path),
                    tooltip: None,
                    data: None,
                }),
                _ => None,
            });
            Ok(Some(links.collect()))
        }),
        _ => return None,
    })
}

/// Reads the parameters of a request, and writes its answer.
fn reply<R: Request>(
    params: Value,
    answer: impl FnOnce(R::Params) -> Result<R::Result, String>,
) -> Result<Value, String> {
    let params = serde_json::from_value(params).map_err(|e| format!("{}: {e}", R::METHOD))?;
    serde_json::to_value(answer(params)?).map_err(|e| format!("{}: {e}", R::METHOD))
}

struct Requests<'a> {
    context: &'a Context<'a>,
}

/// A position in a text.
struct Place {
    path: PathBuf,
    file: Arc<TextFile>,
    offset: usize,
}

impl Place {
    fn at(&self) -> At<'_> {
        At { path: &self.path, file: &self.file, offset: self.offset }
    }
}

impl Requests<'_> {
    fn file(&self, uri: &Uri) -> Option<(PathBuf, Arc<TextFile>)> {
        let path = path_of(uri);
        let file = self.context.workspace.file(&path)?;
        Some((path, file))
    }

    fn place(&self, at: &TextDocumentPositionParams) -> Option<Place> {
        let (path, file) = self.file(&at.text_document.uri)?;
        let offset = file.offset(at.position);
        Some(Place { path, file, offset })
    }

    fn name(&self, at: &TextDocumentPositionParams) -> Option<(Place, Occurrence)> {
        let place = self.place(at).filter(|place| place.file.is_graph())?;
        let (workspace, registry) = (self.context.workspace, self.context.registry);
        let name = name_at(workspace, registry, (&place.path, &place.file), place.offset)?;
        Some((place, name))
    }

    fn location(&self, path: &Path, found: &Occurrence) -> Option<Location> {
        let file = self.context.workspace.file(path)?;
        Some(Location { uri: uri(self.context.workspace, path)?, range: file.range(&found.span) })
    }

    /// Declaration of a target.
    fn declaration(&self, target: &Target) -> Option<Location> {
        let at = |path: &PathBuf, span: Option<crate::lang::Span>| {
            let file = self.context.workspace.file(path)?;
            Some(Location { uri: uri(self.context.workspace, path)?, range: file.range(&span?) })
        };
        match target {
            Target::Node(path, id) | Target::Port(path, id, _) => {
                let file = self.context.workspace.file(path)?;
                at(path, file.node_entry(id).map(|entry| entry.key.span()))
            }
            Target::Use(path, name) => {
                let file = self.context.workspace.file(path)?;
                at(path, file.use_of(name).map(|used| used.entry.key.span()))
            }
            Target::Param(path, name) => {
                let file = self.context.workspace.file(path)?;
                at(path, file.param(name).map(|entry| entry.key.span()))
            }
            Target::File(path) => {
                let start = Position::new(0, 0);
                let uri = uri(self.context.workspace, path).filter(|_| path.is_file())?;
                Some(Location { uri, range: Range::new(start, start) })
            }
        }
    }

    fn tokens(&self, uri: &Uri, range: Option<Range>) -> Option<SemanticTokens> {
        let (path, file) = self.file(uri)?;
        let names = names(self.context.workspace, self.context.registry, &path, &file);
        let part = range.map_or(0..file.text.len(), |range| file.span(range));
        Some(SemanticTokens { result_id: None, data: tokens(&file, &names, &part) })
    }

    // An address is a key as the protocol has it.
    #[allow(clippy::mutable_key_type)]
    fn workspace_edit(
        &self,
        edits: impl IntoIterator<Item = (PathBuf, Vec<lsp_types::TextEdit>)>,
    ) -> WorkspaceEdit {
        let one = |(path, edits): (PathBuf, _)| Some((uri(self.context.workspace, &path)?, edits));
        let changes: HashMap<Uri, Vec<lsp_types::TextEdit>> = edits.into_iter().filter_map(one).collect();
        WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() }
    }
}

/// The edit that turns one text into another: of the lines between their common beginning and their common end.
fn difference(old: &str, new: &str) -> Vec<TextEdit> {
    if old == new {
        return Vec::new();
    }
    let same = |a: &str, b: &str| a == b;
    let lines = |text: &'_ str| text.split_inclusive('\n').map(str::len).collect::<Vec<_>>();
    let (old_lines, new_lines) = (lines(old), lines(new));
    let (mut start, mut count) = (0, 0);
    for (a, b) in old_lines.iter().zip(&new_lines) {
        if a != b || !same(&old[start..start + a], &new[start..start + b]) {
            break;
        }
        (start, count) = (start + a, count + 1);
    }
    let (mut old_end, mut new_end) = (old.len(), new.len());
    let tails = old_lines[count..].iter().rev().zip(new_lines[count..].iter().rev());
    for (a, b) in tails {
        if a != b || !same(&old[old_end - a..old_end], &new[new_end - b..new_end]) {
            break;
        }
        (old_end, new_end) = (old_end - a, new_end - b);
    }
    vec![TextEdit { span: start..old_end, new_text: new[start..new_end].to_owned() }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lang::edit::apply;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_difference_makes_the_new_text(old in "[ab\n]{0,12}", new in "[ab\n]{0,12}") {
            prop_assert_eq!(apply(&old, &difference(&old, &new)).unwrap(), new);
        }
    }
}
