//! Probable positions of the missing brackets of an unbalanced text.
//!
//! A text whose brackets match is parsed by its brackets alone. Only when they do not, the layout is
//! consulted: which lines are indented how far, and which bracket there are too many of.

use super::lexer::Token;
use super::syntax::SyntaxKind;

/// Layout of a token: true if it starts or ends its line, and the indentation of the line.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TokenLayout {
    pub starts_line: bool,
    pub ends_line: bool,
    pub indent: usize,
}

/// The layout of an unbalanced text.
#[derive(Debug)]
pub(super) struct Layout {
    /// One token_layout for each significant token.
    places: Vec<TokenLayout>,
    /// Excess of closing brackets over opening ones, for `)`, `]`, `}`.
    excess: [isize; 3],
}

fn shape(kind: SyntaxKind) -> Option<(usize, isize)> {
    Some(match kind {
        SyntaxKind::LParen => (0, -1),
        SyntaxKind::RParen => (0, 1),
        SyntaxKind::LBracket => (1, -1),
        SyntaxKind::RBracket => (1, 1),
        SyntaxKind::LBrace => (2, -1),
        SyntaxKind::RBrace => (2, 1),
        _ => return None,
    })
}

fn balanced(tokens: &[Token]) -> bool {
    let mut open = Vec::new();
    for token in tokens {
        if let Some(closer) = token.kind.closer() {
            open.push(closer);
        } else if token.kind.is_closer() && open.pop() != Some(token.kind) {
            return false;
        }
    }
    open.is_empty()
}

impl Layout {
    /// The layout of the tokens, if their brackets do not match. `significant` are the indices of the
    /// tokens that are not trivia.
    pub(super) fn of_unbalanced(text: &str, tokens: &[Token], significant: &[usize]) -> Option<Self> {
        if balanced(tokens) {
            return None;
        }
        let mut excess = [0; 3];
        let mut places = Vec::with_capacity(significant.len());
        let (mut line_start, mut seen) = (0, 0);
        let mut indent = 0;
        for &index in significant {
            let token = &tokens[index];
            if let Some((which, change)) = shape(token.kind) {
                excess[which] += change;
            }
            let newline = text[seen..token.start].rfind('\n').map(|at| seen + at + 1);
            line_start = newline.unwrap_or(line_start);
            let starts_line = newline.is_some() || places.is_empty();
            if starts_line {
                indent = token.start - line_start;
                if let Some(TokenLayout { ends_line, .. }) = places.last_mut() {
                    *ends_line = true;
                }
            }
            places.push(TokenLayout { starts_line, ends_line: false, indent });
            seen = token.end;
        }
        Some(Layout { places, excess })
    }

    /// The token_layout of a significant token.
    pub(super) fn token_layout(&self, significant: usize) -> TokenLayout {
        self.places.get(significant).copied().unwrap_or_default()
    }

    /// Returns true if there are too many closing brackets of this kind; if so, this one is taken as one of them.
    pub(super) fn take_excess(&mut self, closer: SyntaxKind) -> bool {
        let Some((which, _)) = shape(closer) else { return false };
        let taken = self.excess[which] > 0;
        self.excess[which] -= isize::from(taken);
        taken
    }

    /// Returns true if a bracket opened at `opener` must have ended before the significant token `next`: its line
    /// is indented no further than the opener's, and it is not the closing bracket. A bracket whose content
    /// is not indented has no information.
    pub(super) fn ended(&self, opener_at: usize, next: usize, next_closes: bool) -> bool {
        let (opener, next) = (self.token_layout(opener_at), self.token_layout(next));
        if opener.ends_line && self.token_layout(opener_at + 1).indent <= opener.indent {
            return false;
        }
        next.starts_line
            && if next_closes { next.indent < opener.indent } else { next.indent <= opener.indent }
    }

    /// Returns true if there are too few closing brackets of this kind.
    pub(super) fn lacks(&self, closer: SyntaxKind) -> bool {
        shape(closer).is_some_and(|(which, _)| self.excess[which] < 0)
    }

    /// Returns true if a matching closing bracket stands where only a stray one would: in the middle of a line,
    /// though the opening bracket ended its line, and there are too many of its kind.
    pub(super) fn strays(&self, opener: usize, closer_at: usize, closer: SyntaxKind) -> bool {
        let many = shape(closer).is_some_and(|(which, _)| self.excess[which] > 0);
        many && self.token_layout(opener).ends_line && !self.token_layout(closer_at).starts_line
    }
}
