//! The pages of the book, the example graphs and the presets.

mod examples;
mod follows;
mod levels;
mod pages;
mod presets;
mod reader;
