//! Semantic tokens: the kind of each word of a text.

use super::file::TextFile;
use super::names::{Occurrence, Target};
use crate::lang::{Span, SyntaxKind, SyntaxNode};
use lsp_types::{SemanticToken, SemanticTokenModifier, SemanticTokenType, SemanticTokensLegend};
use std::collections::HashMap;

/// The types of tokens, in the order of their numbers.
const TYPES: [SemanticTokenType; 9] = [
    SemanticTokenType::CLASS,
    SemanticTokenType::PROPERTY,
    SemanticTokenType::ENUM_MEMBER,
    SemanticTokenType::STRING,
    SemanticTokenType::NUMBER,
    SemanticTokenType::COMMENT,
    SemanticTokenType::VARIABLE,
    SemanticTokenType::MACRO,
    SemanticTokenType::PARAMETER,
];

const CLASS: u32 = 0;
const PROPERTY: u32 = 1;
const ENUM_MEMBER: u32 = 2;
const STRING: u32 = 3;
const NUMBER: u32 = 4;
const COMMENT: u32 = 5;
const VARIABLE: u32 = 6;
const MACRO: u32 = 7;
const PARAMETER: u32 = 8;
/// The modifier of a declaration.
const DECLARATION: u32 = 1;

/// The types and modifiers of the tokens.
#[must_use]
pub fn legend() -> SemanticTokensLegend {
    SemanticTokensLegend {
        token_types: TYPES.to_vec(),
        token_modifiers: vec![SemanticTokenModifier::DECLARATION],
    }
}

/// The tokens of a part of a text. `names` are the names in the text.
#[must_use]
pub fn tokens(file: &TextFile, names: &[Occurrence], part: &Span) -> Vec<SemanticToken> {
    let by_start: HashMap<usize, &Occurrence> = names.iter().map(|name| (name.span.start, name)).collect();
    let root = file.parse.syntax();
    let mut found: Vec<(Span, u32, u32)> = Vec::new();
    for token in root.descendants_with_tokens().filter_map(|element| element.into_token()) {
        let span = Span::from(token.text_range());
        if span.end <= part.start || span.start >= part.end {
            continue;
        }
        let parent = token.parent();
        let kind = match token.kind() {
            kind if kind.is_comment() => COMMENT,
            SyntaxKind::Number | SyntaxKind::Byte | SyntaxKind::Char => NUMBER,
            SyntaxKind::Str | SyntaxKind::RawStr | SyntaxKind::ByteStr | SyntaxKind::RawByteStr => {
                string(&span, &by_start, &mut found);
                continue;
            }
            SyntaxKind::Ident | SyntaxKind::RawIdent => match parent.as_ref().map(SyntaxNode::kind) {
                Some(SyntaxKind::Attribute) => MACRO,
                Some(SyntaxKind::Field) => PROPERTY,
                Some(SyntaxKind::Struct | SyntaxKind::Tuple) => CLASS,
                Some(SyntaxKind::Name) if is_node(parent.as_ref()) => CLASS,
                Some(SyntaxKind::Name | SyntaxKind::Optional) => ENUM_MEMBER,
                Some(SyntaxKind::Literal) => NUMBER,
                _ => continue,
            },
            _ => continue,
        };
        found.push((span, kind, 0));
    }
    encode(file, &found)
}

/// Returns true for a node without fields and brackets: the value of an entry of the nodes.
fn is_node(name: Option<&SyntaxNode>) -> bool {
    let entry = name.and_then(SyntaxNode::parent).filter(|entry| entry.kind() == SyntaxKind::Entry);
    let field = entry.and_then(|entry| entry.parent()?.parent());
    field.is_some_and(|field| field.first_token().is_some_and(|token| token.text() == "nodes"))
}

/// The parts of a text in quotes: names, and the text between them.
fn string(span: &Span, names: &HashMap<usize, &Occurrence>, found: &mut Vec<(Span, u32, u32)>) {
    let mut at = span.start;
    for name in (span.start + 1..span.end).filter_map(|at| names.get(&at)) {
        let kind = match name.target {
            Target::Node(..) | Target::Use(..) | Target::Port(..) => VARIABLE,
            Target::Param(..) => PARAMETER,
            Target::File(..) => continue,
        };
        if at < name.span.start {
            found.push((at..name.span.start, if kind == PARAMETER { PARAMETER } else { STRING }, 0));
        }
        found.push((name.span.clone(), kind, if name.declares { DECLARATION } else { 0 }));
        at = name.span.end;
    }
    if at < span.end {
        found.push((at..span.end, STRING, 0));
    }
}

/// Tokens by their distance from the one before, line by line.
fn encode(file: &TextFile, found: &[(Span, u32, u32)]) -> Vec<SemanticToken> {
    let mut all = Vec::with_capacity(found.len());
    let mut last = (0, 0);
    for (span, token_type, modifiers) in found {
        let mut start = span.start;
        // Not every editor takes tokens over several lines.
        for line in file.text[span.clone()].split_inclusive('\n') {
            let end = start + line.trim_end_matches(['\n', '\r']).len();
            let (from, to) = (file.position(start), file.position(end));
            start += line.len();
            if to.character <= from.character {
                continue;
            }
            let delta_line = from.line - last.0;
            all.push(SemanticToken {
                delta_line,
                delta_start: if delta_line == 0 { from.character - last.1 } else { from.character },
                length: to.character - from.character,
                token_type: *token_type,
                token_modifiers_bitset: *modifiers,
            });
            last = (from.line, from.character);
        }
    }
    all
}
