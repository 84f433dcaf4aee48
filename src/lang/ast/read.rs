//! The tree to values.

use std::ops::Range;

use rowan::TextRange;

use super::*;
use crate::lang::number::{self, Number};
use crate::lang::quoted::{self, Encoding};
use crate::lang::syntax::SyntaxToken;

fn span(range: TextRange) -> Span {
    Range::from(range)
}

fn tokens(node: &SyntaxNode) -> impl Iterator<Item = SyntaxToken> {
    node.children_with_tokens().filter_map(|element| element.into_token()).filter(|t| !t.kind().is_trivia())
}

fn values(node: &SyntaxNode) -> Vec<Value> {
    node.children().filter(|child| child.kind().is_value()).map(|child| value(&child)).collect()
}

pub(super) fn document(root: &SyntaxNode) -> Document {
    let attributes = root.children().filter(|child| child.kind() == SyntaxKind::Attribute);
    Document {
        attributes: attributes.map(|node| attribute(&node)).collect(),
        value: root.children().find(|child| child.kind().is_value()).map(|node| value(&node)),
    }
}

fn attribute(node: &SyntaxNode) -> Attribute {
    let mut names = tokens(node).filter(|token| is_name(token.kind())).map(|token| name(&token));
    let text = tokens(node).find_map(|token| match literal(token.kind(), token.text()) {
        ValueKind::Str(text) => Some(Spanned { span: span(token.text_range()), value: text }),
        _ => None,
    });
    let complete = node.last_token().is_some_and(|token| token.kind() == SyntaxKind::RBracket);
    let kind = match (names.next(), text) {
        (Some(first), Some(text)) if complete => AttributeKind::Text(first, text),
        (Some(first), None) if complete && first.value == "enable" => AttributeKind::Enable(names.collect()),
        _ => AttributeKind::Error,
    };
    Attribute { span: span(node.text_range()), kind }
}

fn is_name(kind: SyntaxKind) -> bool {
    matches!(kind, SyntaxKind::Ident | SyntaxKind::RawIdent)
}

fn name(token: &SyntaxToken) -> Name {
    let text = token.text();
    let bare = if token.kind() == SyntaxKind::RawIdent { &text[2..] } else { text };
    Spanned { span: span(token.text_range()), value: bare.to_owned() }
}

fn first_name(node: &SyntaxNode) -> Option<Name> {
    tokens(node).next().filter(|token| is_name(token.kind())).map(|token| name(&token))
}

/// The nodes with exactly this span, the outermost first.
pub(super) fn nodes_at(parse: &Parse, span: &Span) -> impl Iterator<Item = SyntaxNode> {
    let root = parse.syntax();
    let bound = |at: usize| u32::try_from(at).ok().map(rowan::TextSize::from);
    let range = bound(span.start).zip(bound(span.end)).filter(|(start, end)| start <= end);
    let range = range.map(|(start, end)| TextRange::new(start, end));
    let range = range.filter(|range| root.text_range().contains_range(*range));
    let innermost = range.and_then(|range| match root.covering_element(range) {
        rowan::NodeOrToken::Node(node) => Some(node),
        rowan::NodeOrToken::Token(token) => token.parent(),
    });
    let same = std::iter::successors(innermost, SyntaxNode::parent)
        .take_while(|node| Some(node.text_range()) == range);
    let mut nodes: Vec<SyntaxNode> = same.collect();
    nodes.reverse();
    nodes.into_iter()
}

pub(super) fn value(node: &SyntaxNode) -> Value {
    let kind = match node.kind() {
        SyntaxKind::Literal => tokens(node).next().map_or(ValueKind::Error, |t| literal(t.kind(), t.text())),
        SyntaxKind::Unit => ValueKind::Unit,
        SyntaxKind::Name => first_name(node).map_or(ValueKind::Error, ValueKind::Name),
        SyntaxKind::List => ValueKind::List(values(node)),
        SyntaxKind::Map => ValueKind::Map(nodes(node, SyntaxKind::Entry).map(|n| entry(&n)).collect()),
        SyntaxKind::Tuple => match first_name(node) {
            Some(name) => ValueKind::NamedTuple(name, values(node)),
            None => ValueKind::Tuple(values(node)),
        },
        SyntaxKind::Struct => ValueKind::Struct(
            bracket_name(node),
            nodes(node, SyntaxKind::Field).filter_map(|n| field(&n)).collect(),
        ),
        SyntaxKind::Optional => option(node),
        SyntaxKind::Range => range(node),
        _ => ValueKind::Error,
    };
    Spanned { span: span(node.text_range()), value: kind }
}

/// The name before the bracket. A struct unwrapped in `Some(...)` has no bracket, and so no name.
fn bracket_name(node: &SyntaxNode) -> Option<Name> {
    first_name(node)
}

fn nodes(node: &SyntaxNode, kind: SyntaxKind) -> impl Iterator<Item = SyntaxNode> {
    node.children().filter(move |child| child.kind() == kind)
}

/// The values before and after the colon; what is missing is an error at the end of the node.
fn around_colon(node: &SyntaxNode) -> (Option<Value>, Value) {
    let (mut before, mut after, mut colon) = (None, None, None);
    for child in node.children_with_tokens() {
        match child {
            rowan::NodeOrToken::Token(token) if token.kind() == SyntaxKind::Colon => {
                colon = Some(token.text_range().end());
            }
            rowan::NodeOrToken::Node(child) if child.kind().is_value() => {
                let value = value(&child);
                // A map entry without its colon still has its key first.
                if colon.is_none() && before.is_none() && node.kind() == SyntaxKind::Entry {
                    before = Some(value);
                } else {
                    after = Some(value);
                }
            }
            _ => {}
        }
    }
    let end = usize::from(node.text_range().end());
    (before, after.unwrap_or(Spanned { span: end..end, value: ValueKind::Error }))
}

fn entry(node: &SyntaxNode) -> Entry {
    let (key, value) = around_colon(node);
    let start = usize::from(node.text_range().start());
    let key = key.unwrap_or(Spanned { span: start..start, value: ValueKind::Error });
    Entry { span: span(node.text_range()), key, value }
}

fn field(node: &SyntaxNode) -> Option<Field> {
    let token = tokens(node).next()?;
    let name = match literal(token.kind(), token.text()) {
        _ if is_name(token.kind()) => name(&token),
        // A quoted field name is an error of its own; what it means is clear.
        ValueKind::Str(text) => Spanned { span: span(token.text_range()), value: text },
        _ => return None,
    };
    let (_, value) = around_colon(node);
    Some(Field { span: span(node.text_range()), name, value })
}

fn option(node: &SyntaxNode) -> ValueKind {
    let is_none = tokens(node).next().is_some_and(|token| token.text() == "None");
    let inner = values(node).into_iter().next().or_else(|| {
        // With `unwrap_variant_newtypes`, `Some()` holds a unit.
        let open = tokens(node).nth(1).filter(|token| token.kind() == SyntaxKind::LParen)?;
        let at = usize::from(open.text_range().end());
        Some(Spanned { span: at..at, value: ValueKind::Unit })
    });
    match inner {
        _ if is_none => ValueKind::Option(None),
        Some(inner) => ValueKind::Option(Some(Box::new(inner))),
        None => ValueKind::Error,
    }
}

fn range(node: &SyntaxNode) -> ValueKind {
    let mut range = RangeValue { start: None, end: None, inclusive: false };
    let mut past_dots = false;
    for child in node.children_with_tokens() {
        match child {
            rowan::NodeOrToken::Token(token) => {
                past_dots = true;
                range.inclusive = token.kind() == SyntaxKind::DotDotEq;
            }
            rowan::NodeOrToken::Node(child) if past_dots => range.end = Some(value(&child)),
            rowan::NodeOrToken::Node(child) => range.start = Some(value(&child)),
        }
    }
    if range.inclusive && range.end.is_none() { ValueKind::Error } else { ValueKind::Range(Box::new(range)) }
}

/// The value of one token; an error if the token is malformed.
fn literal(kind: SyntaxKind, text: &str) -> ValueKind {
    literal_value(kind, text).unwrap_or(ValueKind::Error)
}

fn literal_value(kind: SyntaxKind, text: &str) -> Option<ValueKind> {
    Some(match kind {
        SyntaxKind::Ident if text == "true" => ValueKind::Bool(true),
        SyntaxKind::Ident if text == "false" => ValueKind::Bool(false),
        SyntaxKind::Ident => ValueKind::Float(number::named(text)?),
        SyntaxKind::Number => match number::scan(text) {
            (len, Ok(Number::Int(value))) if len == text.len() => ValueKind::Int(value),
            (len, Ok(Number::Float(value))) if len == text.len() => ValueKind::Float(value),
            _ => return None,
        },
        SyntaxKind::Byte => {
            ValueKind::Int(decode(inside(text, "b'", "'")?, Encoding::Byte)?.first().copied()?.into())
        }
        SyntaxKind::Char => {
            let bytes = decode(inside(text, "'", "'")?, Encoding::Char)?;
            let mut chars = std::str::from_utf8(&bytes).ok()?.chars();
            let only = chars.next()?;
            chars.next().is_none().then_some(ValueKind::Char(only))?
        }
        SyntaxKind::Str => {
            ValueKind::Str(String::from_utf8(decode(inside(text, "\"", "\"")?, Encoding::Text)?).ok()?)
        }
        SyntaxKind::ByteStr => ValueKind::Bytes(decode(inside(text, "b\"", "\"")?, Encoding::Bytes)?),
        SyntaxKind::RawStr => ValueKind::Str(raw(text.strip_prefix('r')?)?.to_owned()),
        SyntaxKind::RawByteStr => ValueKind::Bytes(raw(text.strip_prefix("br")?)?.as_bytes().to_vec()),
        _ => return None,
    })
}

fn inside<'t>(text: &'t str, open: &str, close: &str) -> Option<&'t str> {
    text.strip_prefix(open)?.strip_suffix(close)
}

fn decode(body: &str, encoding: Encoding) -> Option<Vec<u8>> {
    let mut good = true;
    let bytes = quoted::decode(body, encoding, |_| good = false);
    good.then_some(bytes)
}

fn raw(text: &str) -> Option<&str> {
    let bare = text.trim_start_matches('#');
    let hashes = &text[..text.len() - bare.len()];
    bare.strip_prefix('"')?.strip_suffix(hashes)?.strip_suffix('"')
}
