//! Layout on one line.

use super::*;

/// The width of a text in columns, one for each character.
pub(super) fn width(text: &str) -> usize {
    text.chars().count()
}

/// Returns true if a comment cannot stand inside a line; outside of brackets it moves before its item.
pub(super) fn hoists(comment: &SyntaxToken) -> bool {
    comment.kind() == LineComment || comment.text().contains('\n')
}

/// The node on one line, if it stood on one line from its opening bracket on.
pub(super) fn flat(node: &SyntaxNode) -> Option<String> {
    let mut out = String::new();
    let mut last: Option<SyntaxToken> = None;
    let mut in_brackets = 0_usize;
    for token in node.descendants_with_tokens().filter_map(|element| element.into_token()) {
        let (kind, text) = (token.kind(), token.text());
        let breaks = text.contains('\n') && !is_inside_empty(&token);
        if (in_brackets > 0 || !kind.is_trivia()) && breaks || out.len() > 8 * LINE {
            return None;
        }
        in_brackets += usize::from(kind.closer().is_some());
        in_brackets -= usize::from(kind.is_closer() && in_brackets > 0);
        if kind == Whitespace || kind.is_comment() && hoists(&token) || kind == Comma && !comma_stays(&token)
        {
            continue;
        }
        if let Some(last) = &last {
            let empty_tuple = (last.kind(), kind) == (LParen, RParen)
                && token
                    .parent()
                    .is_some_and(|tuple| tuple.kind() == Tuple && tuple.first_token().as_ref() == Some(last));
            if empty_tuple || !touch(last.kind(), kind) {
                out.push(' ');
            }
        }
        out.push_str(text);
        last = Some(token);
    }
    Some(out)
}

/// Returns true for the white space between two brackets with nothing else between them.
fn is_inside_empty(token: &SyntaxToken) -> bool {
    let kind = |token: Option<SyntaxToken>| token.map(|token| token.kind());
    let opener = kind(token.prev_token()).and_then(SyntaxKind::closer);
    token.kind() == Whitespace && opener.is_some() && opener == kind(token.next_token())
}

/// Returns true if a comma is needed on one line: not the last one, except of a tuple of one.
fn comma_stays(comma: &SyntaxToken) -> bool {
    let mut after =
        comma.siblings_with_tokens(rowan::Direction::Next).skip(1).filter(|next| !next.kind().is_trivia());
    let is_last = after.next().is_none_or(|next| next.kind().is_closer());
    let tuple_of_one =
        || comma.parent().is_some_and(|node| node.kind() == Tuple && node.children().count() == 1);
    !is_last || tuple_of_one()
}
