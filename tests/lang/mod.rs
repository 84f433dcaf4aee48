//! The graph language.

mod checker;
mod extends;
mod formatter;
mod plain;
mod syntax;
