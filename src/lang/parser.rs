//! Tokens to the tree.
//!
//! The grammar is the one that `ron::Deserializer::deserialize_any` walks, down to where it demands
//! that two tokens touch. After an error the parser continues with the next element it can make out; the
//! brackets of a text in which they do not match are placed by its [`Layout`].

use rowan::{GreenNode, GreenNodeBuilder, Language};

use super::error::{ErrorKind, Span, SyntaxError};
use super::layout::Layout;
use super::lexer::{Token, lex};
use super::number;
use super::syntax::SyntaxKind::{self, *};
use super::syntax::{Extensions, Parse, RonLanguage};

mod attribute;
mod body;
mod value;

/// The recursion limit of [`parse`], counted as `ron` counts: a bracket and its content cost two, `Some`
/// costs one. So 64 nested lists are within the limit.
pub const DEFAULT_RECURSION_LIMIT: usize = 128;

/// Maximum number of errors of one text.
pub const MAX_ERRORS: usize = 10_000;

/// Deeper recursion could overflow a small thread's stack.
const HIGHEST_RECURSION_LIMIT: usize = 512;

/// Parses a text as RON.
///
/// # Errors
/// None: the errors are in the result. A text of 4 GiB or more results in an empty tree and one error.
///
/// # Complexity
/// Linear in the text's length.
pub fn parse(text: &str) -> Parse {
    parse_with_limit(text, DEFAULT_RECURSION_LIMIT)
}

/// Parses a text with another recursion limit, at most 512.
pub fn parse_with_limit(text: &str, limit: usize) -> Parse {
    if u32::try_from(text.len()).is_err() {
        return too_large(text.len());
    }
    let lexed = lex(text);
    let significant: Vec<usize> =
        (0..lexed.tokens.len()).filter(|&i| !lexed.tokens[i].kind.is_trivia()).collect();
    let mut parser = Parser {
        text,
        layout: Layout::of_unbalanced(text, &lexed.tokens, &significant),
        tokens: lexed.tokens,
        significant,
        next: 0,
        written: 0,
        builder: GreenNodeBuilder::new(),
        errors: lexed.errors,
        extensions: Extensions::default(),
        budget: limit.min(HIGHEST_RECURSION_LIMIT),
        open: Vec::new(),
    };
    parser.document();
    parser.finish()
}

fn too_large(len: usize) -> Parse {
    let mut builder = GreenNodeBuilder::new();
    builder.start_node(RonLanguage::kind_to_raw(Document));
    builder.finish_node();
    let error = SyntaxError {
        span: 0..0,
        message: format!("the text has {len} bytes"),
        expected: Some("less than 4 GiB".to_owned()),
        code: ErrorKind::TooLarge,
    };
    Parse { green: builder.finish(), errors: vec![error], extensions: Extensions::default() }
}

struct Parser<'t> {
    text: &'t str,
    tokens: Vec<Token>,
    /// The indices of the tokens that are not trivia.
    significant: Vec<usize>,
    /// The next significant token, as an index into `significant`.
    next: usize,
    /// Number of tokens in the tree.
    written: usize,
    builder: GreenNodeBuilder<'static>,
    errors: Vec<SyntaxError>,
    extensions: Extensions,
    /// Remaining depth of nested values, see [`DEFAULT_RECURSION_LIMIT`].
    budget: usize,
    /// The open brackets: the token that closes each, and the position of each.
    open: Vec<(SyntaxKind, usize)>,
    /// Layout analysis, only for a text whose brackets do not match.
    layout: Option<Layout>,
}

/// Looking at tokens and writing them.
impl Parser<'_> {
    /// The significant token `n` places ahead.
    fn ahead(&self, n: usize) -> Option<Token> {
        self.significant.get(self.next + n).map(|&index| self.tokens[index])
    }

    fn kind_ahead(&self, n: usize) -> Option<SyntaxKind> {
        self.ahead(n).map(|token| token.kind)
    }

    fn kind(&self) -> Option<SyntaxKind> {
        self.kind_ahead(0)
    }

    fn at(&self, kind: SyntaxKind) -> bool {
        self.kind() == Some(kind)
    }

    fn text_ahead(&self, n: usize) -> &str {
        self.ahead(n).map_or("", |token| &self.text[token.start..token.end])
    }

    /// Returns true if no trivia stands before the token `n` places ahead.
    fn touches(&self, n: usize) -> bool {
        let index = self.next + n;
        index > 0 && self.ahead(n).is_some() && self.significant[index] == self.significant[index - 1] + 1
    }

    /// Returns true if the token `n` places ahead is on the same line as the one before it.
    fn same_line(&self, n: usize) -> bool {
        match (self.next + n).checked_sub(1).map(|last| self.tokens[self.significant[last]]) {
            Some(last) => self.ahead(n).is_some_and(|token| !self.text[last.end..token.start].contains('\n')),
            None => true,
        }
    }

    fn last_kind(&self) -> Option<SyntaxKind> {
        self.next.checked_sub(1).map(|last| self.tokens[self.significant[last]].kind)
    }

    /// The end of the last significant token that was read.
    fn last_end(&self) -> usize {
        self.next.checked_sub(1).map_or(0, |last| self.tokens[self.significant[last]].end)
    }

    /// Returns the position of the next token, or of the end of the text.
    fn here(&self) -> Span {
        self.ahead(0).map_or(self.text.len()..self.text.len(), |token| token.start..token.end)
    }

    fn write(&mut self, until: usize) {
        for token in &self.tokens[self.written..until] {
            self.builder.token(RonLanguage::kind_to_raw(token.kind), &self.text[token.start..token.end]);
        }
        self.written = self.written.max(until);
    }

    /// Writes the trivia before the next token.
    fn trivia(&mut self) {
        let until = self.significant.get(self.next).map_or(self.tokens.len(), |&index| index);
        self.write(until);
    }

    /// Writes the next token, and the trivia before it.
    fn bump(&mut self) {
        if let Some(&index) = self.significant.get(self.next) {
            self.write(index + 1);
            self.next += 1;
        }
    }

    fn eat(&mut self, kind: SyntaxKind) -> bool {
        let here = self.at(kind);
        if here {
            self.bump();
        }
        here
    }

    /// Writes a node that begins with the next token and has all that `content` writes.
    fn node<T>(&mut self, kind: SyntaxKind, content: impl FnOnce(&mut Self) -> T) -> T {
        self.trivia();
        self.builder.start_node(RonLanguage::kind_to_raw(kind));
        let result = content(self);
        self.builder.finish_node();
        result
    }

    fn finish(mut self) -> Parse {
        self.errors.sort_by_key(|error| (error.span.start, error.span.end));
        self.errors.truncate(MAX_ERRORS);
        let green: GreenNode = self.builder.finish();
        Parse { green, errors: self.errors, extensions: self.extensions }
    }
}

/// Errors.
impl Parser<'_> {
    fn error(&mut self, span: Span, code: ErrorKind, message: String, expected: &str) {
        // Twice the limit, since what comes later in the pass may stand earlier in the text.
        if self.errors.len() < 2 * MAX_ERRORS {
            self.errors.push(SyntaxError { span, message, expected: Some(expected.to_owned()), code });
        }
    }

    fn error_here(&mut self, code: ErrorKind, expected: &str) {
        let message = format!("found {}", self.found());
        self.error(self.here(), code, message, expected);
    }

    /// Reports that something is missing right after the last token.
    fn missing(&mut self, code: ErrorKind, expected: &str) {
        let (end, message) = (self.last_end(), format!("found {}", self.found()));
        self.error(end..end, code, message, expected);
    }

    /// The next token in words.
    fn found(&self) -> String {
        const LONGEST: usize = 24;
        let Some(kind) = self.kind() else { return "the end of the text".to_owned() };
        let text = self.text_ahead(0);
        let line = text.lines().next().unwrap_or_default();
        let short: String = line.chars().take(LONGEST).collect();
        let dots = if short.len() < text.len() { "…" } else { "" };
        match kind {
            Ident | RawIdent => format!("the name `{short}{dots}`"),
            Number | Byte => format!("the number `{short}{dots}`"),
            Str | RawStr => format!("the string `{short}{dots}`"),
            ByteStr | RawByteStr => format!("the byte string `{short}{dots}`"),
            Char => format!("the character `{short}{dots}`"),
            _ => format!("`{short}{dots}`"),
        }
    }
}

impl Parser<'_> {
    fn document(&mut self) {
        self.builder.start_node(RonLanguage::kind_to_raw(Document));
        while self.at(Hash) {
            self.attribute();
        }
        while self.kind().is_some() && !self.starts_value() {
            if !self.at(Unknown) {
                self.error_here(ErrorKind::Unexpected, "a value");
            }
            self.node(Error, Self::bump);
        }
        if self.kind().is_some() {
            self.value();
        } else if self.errors.is_empty() {
            self.error_here(ErrorKind::MissingValue, "a value");
        }
        if self.kind().is_some() {
            if !self.at(Unknown) {
                self.error_here(ErrorKind::TrailingText, "the end of the text: a document has one value");
            }
            self.node(Error, |p| {
                while p.kind().is_some() {
                    p.bump()
                }
            });
        }
        self.trivia();
        self.builder.finish_node();
    }

    /// Returns true if the next token can begin a value. Malformed characters count: their error is known.
    fn starts_value(&self) -> bool {
        self.kind().is_some_and(begins_value)
    }
}

/// Returns true if a token of this kind can begin a value.
fn begins_value(kind: SyntaxKind) -> bool {
    matches!(kind, LParen | LBracket | LBrace | DotDot | DotDotEq | Ident | RawIdent) || is_literal(kind)
}

fn is_literal(kind: SyntaxKind) -> bool {
    matches!(kind, Number | Byte | Char | Str | RawStr | ByteStr | RawByteStr)
}

fn is_name(kind: Option<SyntaxKind>) -> bool {
    matches!(kind, Some(Ident | RawIdent))
}

/// Returns true if a token is a number, also one that looks like a name.
fn is_number(kind: Option<SyntaxKind>, text: &str) -> bool {
    matches!(kind, Some(Number | Byte)) || kind == Some(Ident) && number::named(text).is_some()
}

#[cfg(test)]
mod tests;
