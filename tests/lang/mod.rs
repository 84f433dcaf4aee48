//! The graph language.

mod checker;
mod formatter;
mod plain;
mod syntax;
