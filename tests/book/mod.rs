//! The pages of the book, the example graphs and the presets.

mod examples;
#[cfg(unix)]
mod follows;
mod levels;
mod pages;
mod presets;
#[cfg(unix)]
mod reader;
