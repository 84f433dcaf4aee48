//! Changes to a text as edits of their own locations, so that comments and layout are preserved.

use super::ast::{Document, Entry, Field, Value, ValueKind};
use super::error::{Span, SyntaxError};
use super::parser::parse;
pub use super::quoted::quote;
use super::syntax::Parse;
use items::{Brackets, not_an_item};

mod items;

pub use items::{insert_entry_before, insert_item, remove_item, set_field};

/// The replacement of a span by a new text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextEdit {
    /// The replaced range; empty to insert.
    pub span: Span,
    /// The new text.
    pub new_text: String,
}

/// Reason for which an edit is impossible.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// No value of the document has exactly this span.
    #[error("there is no value at {}..{}", .0.start, .0.end)]
    NoValue(Span),
    /// No map key with exactly this span is a string.
    #[error("there is no string as a map key at {}..{}", .0.start, .0.end)]
    NoKey(Span),
    /// The new text is not a value.
    #[error("the new text is not a value: {0}")]
    NotAValue(SyntaxError),
    /// An id is not empty and has no point, since `id.port` is a link.
    #[error("{0:?} cannot be an id: an id has at least one character and no `.`")]
    BadId(String),
    /// The map has this key already.
    #[error("the map has the key {0:?} already")]
    Taken(String),
    /// The list, struct or map has fewer items.
    #[error("item {index} cannot be inserted: there are {items}")]
    NoItem {
        /// Number of the item, from 0.
        index: usize,
        /// Number of items.
        items: usize,
    },
    /// Two edits touch the same text.
    #[error("the edits at {}..{} and {}..{} overlap", .0.start, .0.end, .1.start, .1.end)]
    Overlap(Span, Span),
    /// An edit reaches outside of the text or splits a character.
    #[error("{}..{} is no part of the text", .0.start, .0.end)]
    Outside(Span),
}

/// Replaces a value.
///
/// # Errors
/// If no value (or key) has this span, or the new text is not one value under the document's extensions.
pub fn set_value(parse: &Parse, span: Span, new_text: &str) -> Result<Vec<TextEdit>, EditError> {
    if parse.values_at(&span).is_empty() {
        return Err(EditError::NoValue(span));
    }
    let new_text = new_text.trim();
    check_value(parse, new_text)?;
    Ok(vec![TextEdit { span, new_text: new_text.to_owned() }])
}

fn check_value(document: &Parse, text: &str) -> Result<(), EditError> {
    check_item(document, text, Brackets::List)
}

/// Checks the text as the only item between brackets, under the document's extensions.
fn check_item(document: &Parse, text: &str, brackets: Brackets) -> Result<(), EditError> {
    let extensions = document.extensions();
    let names = [
        (extensions.unwrap_newtypes, "unwrap_newtypes"),
        (extensions.implicit_some, "implicit_some"),
        (extensions.unwrap_variant_newtypes, "unwrap_variant_newtypes"),
        (extensions.explicit_struct_names, "explicit_struct_names"),
    ];
    let mut head = String::new();
    for (_, name) in names.iter().filter(|(enabled, _)| *enabled) {
        head.push_str(&format!("#![enable({name})]"));
    }
    let (open, close) = brackets.pair();
    // A name, where structs need one.
    let name = if matches!(brackets, Brackets::Tuple | Brackets::Struct) { "X" } else { "" };
    head.push_str(name);
    head.push_str(open);
    let parsed = parse(&format!("{head}{text}{close}"));
    if let Some(error) = parsed.errors().first() {
        let clip = |at: usize| at.saturating_sub(head.len()).min(text.len());
        let span = clip(error.span.start)..clip(error.span.end);
        return Err(EditError::NotAValue(SyntaxError { span, ..error.clone() }));
    }
    // Nothing but the item may stand there: a comma or a comment could change what follows it.
    let whole = head.len()..head.len() + text.len();
    match parsed.document().value.as_ref().and_then(items::items) {
        Some((found, items)) if found == brackets && items == [whole] => Ok(()),
        _ => Err(not_an_item(text)),
    }
}

/// A string that may be a link to a key.
#[derive(Clone, Copy, Debug)]
pub struct LinkSite<'a> {
    /// The entry of the map that contains the string.
    pub entry: &'a Entry,
    /// The innermost field that holds the string, if one does.
    pub field: Option<&'a Field>,
    /// The string.
    pub value: &'a Value,
}

/// Renames the map key at `key`, and in that map's values every string `"old"` or `"old.port"`.
///
/// # Errors
/// If no string key has this span, or the new id is empty, has a point, or is taken.
pub fn rename(parse: &Parse, key: Span, new: &str) -> Result<Vec<TextEdit>, EditError> {
    rename_where(parse, key, new, |_| true)
}

/// As [`rename`], but changes only the strings that `is_link` says are links.
///
/// # Errors
/// As [`rename`].
pub fn rename_where(
    parse: &Parse,
    key: Span,
    new: &str,
    mut is_link: impl FnMut(LinkSite<'_>) -> bool,
) -> Result<Vec<TextEdit>, EditError> {
    let document = parse.document();
    let (entries, old) = map_of(&document, &key).ok_or_else(|| EditError::NoKey(key.clone()))?;
    if new.is_empty() || new.contains('.') {
        return Err(EditError::BadId(new.to_owned()));
    }
    if entries.iter().any(|entry| entry.key.span != key && entry.key.as_str() == Some(new)) {
        return Err(EditError::Taken(new.to_owned()));
    }
    let mut edits = vec![TextEdit { span: key, new_text: quote(new) }];
    for entry in entries {
        links(&entry.value, None, &mut |field, value| {
            let Some(port) = value.as_str().and_then(|text| text.strip_prefix(old.as_str())) else { return };
            let links = port.is_empty() || port.starts_with('.');
            if links && is_link(LinkSite { entry, field, value }) {
                edits.push(TextEdit { span: value.span(), new_text: quote(&format!("{new}{port}")) });
            }
        });
    }
    edits.sort_by_key(|edit| edit.span.start);
    Ok(edits)
}

/// The entries of the map that has a string key at `key`, and that string.
fn map_of<'d>(document: &'d Document, key: &Span) -> Option<(&'d [Entry], String)> {
    let mut found = None;
    document.value.as_ref()?.walk(&mut |value| {
        let entries = value.as_map().unwrap_or_default();
        if let Some(entry) = entries.iter().find(|entry| entry.key.span == *key)
            && let Some(text) = entry.key.as_str()
        {
            found = Some((entries, text.to_owned()));
        }
    });
    found
}

/// Calls `visit` with each string in a value that is not a map key, and the innermost field around it.
fn links<'a>(
    value: &'a Value,
    field: Option<&'a Field>,
    visit: &mut impl FnMut(Option<&'a Field>, &'a Value),
) {
    match &value.value {
        ValueKind::Str(_) => visit(field, value),
        ValueKind::List(values) | ValueKind::Tuple(values) | ValueKind::NamedTuple(_, values) => {
            values.iter().for_each(|value| links(value, field, visit));
        }
        ValueKind::Map(entries) => entries.iter().for_each(|entry| links(&entry.value, field, visit)),
        ValueKind::Struct(_, fields) => {
            fields.iter().for_each(|field| links(&field.value, Some(field), visit))
        }
        ValueKind::Option(Some(value)) => links(value, field, visit),
        _ => {}
    }
}

/// Makes the edits, in whatever order they are given. Insertions at one place keep their order.
///
/// # Errors
/// If two edits overlap, or one is not within the text.
pub fn apply(text: &str, edits: &[TextEdit]) -> Result<String, EditError> {
    let mut edits: Vec<&TextEdit> = edits.iter().collect();
    edits.sort_by_key(|edit| (edit.span.start, edit.span.end));
    let mut out = String::with_capacity(text.len());
    let mut last = 0..0;
    for edit in edits {
        let span = edit.span.clone();
        if text.get(span.clone()).is_none() {
            return Err(EditError::Outside(span));
        }
        let Some(kept) = text.get(last.end..span.start) else { return Err(EditError::Overlap(last, span)) };
        out.push_str(kept);
        out.push_str(&edit.new_text);
        last = span;
    }
    out.push_str(&text[last.end..]);
    Ok(out)
}

#[cfg(test)]
mod tests;
