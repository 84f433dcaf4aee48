//! The language server, by its messages.

mod actions;
mod damaged;
mod editor;
mod reading;
mod typing;
