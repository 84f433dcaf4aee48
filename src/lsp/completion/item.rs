//! What is offered, and how it replaces what was typed.

use super::snippet::without_stops;
use crate::lang::SyntaxKind;
use crate::lang::cursor::{Frame, Word};
use crate::lsp::context::{At, Context};
use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionList, CompletionTextEdit, Documentation, InsertTextFormat,
    MarkupContent, MarkupKind, TextEdit,
};

/// Maximum number of items that are offered at once.
const MAX_ITEMS: usize = 500;

pub(super) struct Completion<'a> {
    pub(super) context: &'a Context<'a>,
    pub(super) at: At<'a>,
    pub(super) word: Option<Word>,
    /// Fields that follow in the innermost bracket.
    pub(super) following: &'a [String],
}

/// A completion: its label, the text to insert outside of quotes, and its documentation.
#[derive(Default)]
pub(super) struct Item {
    pub(super) label: String,
    /// The text that is inserted; with `$1` if it is a snippet.
    pub(super) insert: String,
    pub(super) snippet: bool,
    pub(super) kind: Option<CompletionItemKind>,
    pub(super) detail: String,
    pub(super) doc: String,
    /// Place among the others: less comes first.
    pub(super) order: u8,
}

impl Completion<'_> {
    /// The items with the typed letters; an incomplete list is requested again.
    pub(super) fn list(&self, items: Vec<Item>) -> CompletionList {
        let count = items.len();
        let mut fitting: Vec<Item> = items.into_iter().filter(|item| self.fits(&item.label)).collect();
        fitting.sort_by(|a, b| (a.order, &a.label).cmp(&(b.order, &b.label)));
        fitting.truncate(MAX_ITEMS);
        let is_incomplete = fitting.len() < count || !self.typed().is_empty();
        CompletionList { is_incomplete, items: fitting.into_iter().map(|item| self.finish(item)).collect() }
    }

    /// Returns true for a label that has the typed letters in their order.
    pub(super) fn fits(&self, label: &str) -> bool {
        let mut letters = label.chars().flat_map(char::to_lowercase);
        self.typed().chars().flat_map(char::to_lowercase).all(|typed| letters.any(|letter| letter == typed))
    }

    /// Returns true if the cursor is between quotes.
    pub(super) fn in_text(&self) -> bool {
        self.word.as_ref().is_some_and(|word| word.kind == SyntaxKind::Str)
    }

    pub(super) fn typed(&self) -> &str {
        self.word.as_ref().map_or("", |word| &word.typed)
    }

    /// A text in quotes.
    pub(super) fn text(&self, text: &str, kind: CompletionItemKind, detail: &str) -> Item {
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

    /// Returns true if the innermost bracket already contains a field or key.
    pub(super) fn is_given(&self, frame: &Frame, name: &str) -> bool {
        frame.given.iter().chain(self.following).any(|given| given == name)
    }
}
