//! All tests of graphs and of the command line, in one binary: one module per folder.

mod common;

mod book;
mod cli;
mod cloth;
mod lang;
mod live;
mod lsp;
mod numbers;
mod run;
mod scrape;
