//! Items of a list, tuple, struct or map, inserted and removed with their own lines.

use super::super::ast::{Value, ValueKind};
use super::super::error::{ErrorKind, Span, SyntaxError};
use super::super::syntax::{Parse, SyntaxKind, SyntaxToken};
use super::{EditError, TextEdit, check_item, set_value};

/// Kind of the brackets around items, which determines the kind of an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Brackets {
    /// `[value, ...]`
    List,
    /// `(value, ...)`
    Tuple,
    /// `(name: value, ...)`
    Struct,
    /// `{key: value, ...}`
    Map,
}

impl Brackets {
    /// The brackets themselves.
    pub(super) fn pair(self) -> (&'static str, &'static str) {
        match self {
            Self::List => ("[", "]"),
            Self::Tuple | Self::Struct => ("(", ")"),
            Self::Map => ("{", "}"),
        }
    }

    fn opener(self) -> SyntaxKind {
        match self {
            Self::List => SyntaxKind::LBracket,
            Self::Tuple | Self::Struct => SyntaxKind::LParen,
            Self::Map => SyntaxKind::LBrace,
        }
    }
}

/// The items of a value: elements, fields or entries. `()` and `Name()` count as structs.
pub(super) fn items(value: &Value) -> Option<(Brackets, Vec<Span>)> {
    let of_values = |values: &[Value]| values.iter().map(Value::span).collect::<Vec<_>>();
    Some(match &value.value {
        ValueKind::List(values) => (Brackets::List, of_values(values)),
        ValueKind::Tuple(values) => (Brackets::Tuple, of_values(values)),
        ValueKind::NamedTuple(_, values) if !values.is_empty() => (Brackets::Tuple, of_values(values)),
        ValueKind::Unit | ValueKind::NamedTuple(..) => (Brackets::Struct, Vec::new()),
        ValueKind::Struct(_, fields) => {
            (Brackets::Struct, fields.iter().map(|field| field.span.clone()).collect())
        }
        ValueKind::Map(entries) => (Brackets::Map, entries.iter().map(|entry| entry.span.clone()).collect()),
        _ => return None,
    })
}

/// Inserts an item before the one at `index`, or as the last one where `index` is their number: `1.5` into a list, `name: 1.5` into a
/// struct, `"key": 1.5` into a map. It stands on a line of its own where the first item does. Comments after an item stay with it.
///
/// # Errors
/// If no value with items has this span, `index` is beyond them, or the text is not one item under the document's extensions.
pub fn insert_item(
    parse: &Parse,
    container: Span,
    index: usize,
    item: &str,
) -> Result<Vec<TextEdit>, EditError> {
    let (brackets, items) = container_at(parse, &container)?;
    if index > items.len() {
        return Err(EditError::NoItem { index, items: items.len() });
    }
    let item = item.trim();
    check_item(parse, item, brackets)?;
    let opener = tokens_from(parse, container.start)
        .find(|token| token.kind() == brackets.opener())
        .ok_or(EditError::NoValue(container))?;
    let space = spacing(parse, &opener, items.first());
    let on_a_line = space.contains('\n');
    let Some(previous) = index.checked_sub(1).map(|k| &items[k]) else {
        let new_text = match (on_a_line, items.is_empty()) {
            (true, _) => format!("{space}{item},"),
            (false, true) => item.to_owned(),
            (false, false) => format!("{item}, "),
        };
        let at = end(&opener);
        return Ok(vec![TextEdit { span: at..at, new_text }]);
    };
    let after = After::of(parse, previous);
    let space = if after.line_comment && !on_a_line { "\n" } else { &space };
    let comma = if index < items.len() || after.comma.is_some() { "," } else { "" };
    let new = TextEdit { span: after.end..after.end, new_text: format!("{space}{item}{comma}") };
    Ok(match after.comma {
        Some(_) => vec![new],
        None => vec![TextEdit { span: previous.end..previous.end, new_text: ",".to_owned() }, new],
    })
}

/// Inserts an entry before the one with this key: on a line of its own where that one begins a line.
///
/// # Errors
/// If no map has this key, or the text is not one entry under the document's extensions.
pub fn insert_entry_before(parse: &Parse, key: Span, entry: &str) -> Result<Vec<TextEdit>, EditError> {
    let at_key = |(brackets, items): &(Brackets, Vec<Span>)| {
        *brackets == Brackets::Map && items.iter().any(|item| item.start == key.start)
    };
    let root = parse.syntax();
    let token = tokens_from(parse, key.start).next().filter(|token| start(token) == key.start);
    let mut maps = token.iter().flat_map(|token| token.parent_ancestors());
    let map =
        maps.find(|node| node.kind() == SyntaxKind::Map).ok_or_else(|| EditError::NoKey(key.clone()))?;
    let map = Span::from(map.text_range());
    if !container_at(parse, &map).is_ok_and(|found| at_key(&found)) {
        return Err(EditError::NoKey(key));
    }
    let entry = entry.trim();
    check_item(parse, entry, Brackets::Map)?;
    let text = root.text().to_string();
    let line = text[..key.start].rfind('\n').map_or(0, |at| at + 1);
    let before = &text[line..key.start];
    let space = if before.trim().is_empty() { format!("\n{before}") } else { " ".to_owned() };
    Ok(vec![TextEdit { span: key.start..key.start, new_text: format!("{entry},{space}") }])
}

/// Removes an element, field or entry with its comma, and where it stands on lines of its own, these lines with the comment at their end.
/// Comments on lines above it stay.
///
/// # Errors
/// If no item has this span.
pub fn remove_item(parse: &Parse, item: Span) -> Result<Vec<TextEdit>, EditError> {
    let holders = parse.holders_of(&item);
    if !holders.iter().filter_map(items).any(|(_, items)| items.contains(&item)) {
        return Err(EditError::NoValue(item));
    }
    let text = parse.syntax().text().to_string();
    let after = After::of(parse, &item);
    let line_start = text[..item.start].rfind('\n').map_or(0, |at| at + 1);
    let own_lines = text[line_start..item.start].trim().is_empty()
        && text[after.end..].trim_start_matches([' ', '\t', '\r']).starts_with('\n');
    let span = if own_lines {
        let line_end = text[after.end..].find('\n').map_or(text.len(), |at| after.end + at + 1);
        line_start..line_end
    } else if let Some(comma) = after.comma {
        let blanks = text[comma..].len() - text[comma..].trim_start_matches([' ', '\t']).len();
        item.start..comma + blanks
    } else {
        // The last item: without the comma and the space before it, unless a comment ends there.
        let before = text[..item.start].trim_end_matches([' ', '\t']);
        before.strip_suffix(',').unwrap_or(before).len()..item.end
    };
    Ok(vec![TextEdit { span, new_text: String::new() }])
}

/// Sets a field of a struct: replaces its value, or adds the field as the last one.
///
/// # Errors
/// If no struct has this span, or the text is not a value.
pub fn set_field(
    parse: &Parse,
    structure: Span,
    name: &str,
    new_text: &str,
) -> Result<Vec<TextEdit>, EditError> {
    let found = parse.values_at(&structure).into_iter().rfind(|value| value.as_struct().is_some());
    let found =
        found.map(|value| (value.field(name).map(Value::span), matches!(value.value, ValueKind::Name(_))));
    match found {
        Some((Some(span), _)) => set_value(parse, span, new_text),
        // A name alone has no parentheses yet.
        Some((None, true)) => {
            let field = format!("{name}: {}", new_text.trim());
            check_item(parse, &field, Brackets::Struct)?;
            Ok(vec![TextEdit { span: structure.end..structure.end, new_text: format!("({field})") }])
        }
        Some((None, false)) => {
            let count = container_at(parse, &structure)?.1.len();
            insert_item(parse, structure, count, &format!("{name}: {}", new_text.trim()))
        }
        None => Err(EditError::NoValue(structure)),
    }
}

/// An error where a text is not one item.
pub(super) fn not_an_item(text: &str) -> EditError {
    EditError::NotAValue(SyntaxError {
        span: 0..text.len(),
        message: "found something else than one value".to_owned(),
        expected: Some("one value".to_owned()),
        code: ErrorKind::MissingValue,
    })
}

fn container_at(parse: &Parse, span: &Span) -> Result<(Brackets, Vec<Span>), EditError> {
    let found = parse.values_at(span).iter().rev().find_map(items);
    found.ok_or_else(|| EditError::NoValue(span.clone()))
}

/// Text that follows an item on its line.
struct After {
    /// End of the comma after the item.
    comma: Option<usize>,
    /// End of the item, its comma and the comments on the same line.
    end: usize,
    /// True if the last of these comments ends with its line.
    line_comment: bool,
}

impl After {
    fn of(parse: &Parse, item: &Span) -> Self {
        let mut after = Self { comma: None, end: item.end, line_comment: false };
        for token in tokens_from(parse, item.end) {
            match token.kind() {
                SyntaxKind::Comma if after.comma.is_none() => {
                    after = Self { comma: Some(end(&token)), end: end(&token), line_comment: false };
                }
                // A comma may stand on a later line; comments there belong to the next item.
                SyntaxKind::Whitespace if after.comma.is_some() && token.text().contains('\n') => break,
                SyntaxKind::Whitespace => {}
                kind if kind.is_comment() => {
                    after.line_comment = kind == SyntaxKind::LineComment;
                    after.end = end(&token);
                }
                _ => break,
            }
        }
        if after.comma.is_none() {
            return Self::without_comma(parse, item);
        }
        after
    }

    fn without_comma(parse: &Parse, item: &Span) -> Self {
        let mut after = Self { comma: None, end: item.end, line_comment: false };
        for token in tokens_from(parse, item.end) {
            match token.kind() {
                SyntaxKind::Whitespace if token.text().contains('\n') => break,
                SyntaxKind::Whitespace => {}
                kind if kind.is_comment() => {
                    after.line_comment = kind == SyntaxKind::LineComment;
                    after.end = end(&token);
                }
                _ => break,
            }
        }
        after
    }
}

/// The white space between the opening bracket and the first item where that has a line of its own; else one space.
fn spacing(parse: &Parse, opener: &SyntaxToken, first: Option<&Span>) -> String {
    let first = first.map_or(usize::MAX, |span| span.start);
    let blank = tokens_from(parse, end(opener)).take_while(|token| start(token) < first);
    let last = blank.filter(|token| token.kind() == SyntaxKind::Whitespace).last();
    let last = last.filter(|_| first != usize::MAX).filter(|token| token.text().contains('\n'));
    last.map_or_else(
        || " ".to_owned(),
        |token| token.text()[token.text().rfind('\n').unwrap_or(0)..].to_owned(),
    )
}

fn start(token: &SyntaxToken) -> usize {
    token.text_range().start().into()
}

fn end(token: &SyntaxToken) -> usize {
    token.text_range().end().into()
}

/// The tokens that start at or after an offset.
fn tokens_from(parse: &Parse, offset: usize) -> impl Iterator<Item = SyntaxToken> {
    let first = u32::try_from(offset).ok().and_then(|offset| {
        parse
            .syntax()
            .token_at_offset(offset.into())
            .right_biased()
            .filter(|token| start(token) >= offset as usize)
    });
    std::iter::successors(first, SyntaxToken::next_token)
}
