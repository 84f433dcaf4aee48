//! The language server, by its messages.

mod actions;
mod editor;
mod reading;
mod typing;
