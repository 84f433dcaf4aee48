//! The pages of the book, the example graphs and the presets.

mod examples;
mod levels;
mod pages;
mod presets;
mod tutorials;
