//! Errors in the text of a graph.

use std::ops::Range;

/// A range of byte offsets in the text.
pub type Span = Range<usize>;

/// One syntax error: its location, the text found and the correct form.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct SyntaxError {
    /// The offending text; empty where something is missing.
    pub span: Span,
    /// One sentence that states the text found.
    pub message: String,
    /// The expected token, if it is known.
    pub expected: Option<String>,
    /// The class of the error.
    pub code: ErrorKind,
}

/// The classes of syntax errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ErrorKind {
    /// A character that starts nothing in RON.
    UnknownCharacter,
    /// A string or byte string without its closing quote.
    UnterminatedString,
    /// A block comment without its `*/`.
    UnterminatedComment,
    /// An escape sequence that is not one of RON's.
    BadEscape,
    /// A number that is malformed or out of its type's range.
    BadNumber,
    /// A character or byte literal that does not hold exactly one character.
    BadCharacter,
    /// Two elements without a comma between them.
    MissingComma,
    /// A key or field name without its colon.
    MissingColon,
    /// A location where a value should be.
    MissingValue,
    /// A location where a map key or a field name should be.
    MissingKey,
    /// An opening bracket that is never closed, or closed too late.
    MissingBracket,
    /// A closing bracket that closes nothing.
    StrayBracket,
    /// Named fields and positional values in one pair of parentheses, or keys in a list.
    MixedFields,
    /// Something that can stand neither as a value nor between two values.
    Unexpected,
    /// Text after the document's value.
    TrailingText,
    /// An attribute `#![...]` that is not understood.
    BadAttribute,
    /// An extension that `ron` does not support.
    UnknownExtension,
    /// `Some` without a value in parentheses.
    BareSome,
    /// Values nested deeper than the limit.
    TooDeep,
    /// A text larger than the tree can address.
    TooLarge,
}
