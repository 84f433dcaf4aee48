//! The text of a graph: a lossless, error-tolerant RON syntax tree that accepts what `ron` 0.12 accepts.
//! [`parse`] makes the tree and every syntax error, [`ast`] reads it with spans, [`fmt`] lays it out,
//! and [`edit`] changes it as text edits that preserve comments.

pub mod ast;
pub mod cursor;
pub mod edit;
mod error;
pub mod fmt;
mod layout;
mod lexer;
mod lines;
mod number;
mod parser;
mod quoted;
mod syntax;

pub use ast::{Document, Value, ValueKind};
pub use error::{ErrorKind, Span, SyntaxError};
pub use lines::{LineColumn, LineIndex};
pub use parser::{DEFAULT_RECURSION_LIMIT, MAX_ERRORS, parse, parse_with_limit};
pub use syntax::{Extensions, Parse, RonLanguage, SyntaxKind, SyntaxNode, SyntaxToken};
