//! The graph language.

mod arrays;
mod checker;
mod extends;
mod formatter;
mod plain;
mod syntax;
