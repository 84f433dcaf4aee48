//! The runtime of foley: RON graphs of typed nodes, checked, planned and run.
//!
//! Data goes down these rooms once: [`lang`] reads the text, [`graph`] checks it, [`plan`] finds what it needs,
//! [`run`] runs it. [`Session`] leads through all of them. [`diag`] describes errors, [`watch`] detects changed files,
//! and [`cli`] is the command.
//!
//! # A graph run to files, and to memory
//!
//! [`run_file`] runs a graph file; a [`Session`] has settings, and taps any output as a typed array:
//!
//! ```
//! use foley::Session;
//! use foley::run::StreamTap;
//! use std::sync::Arc;
//!
//! let mut session = Session::from_file("graphs/impact/strikes.ron").with_until(Some(0.5));
//! let sound = Arc::new(StreamTap::<f32>::new());
//! session.tap("loud", &sound);
//! session.render_to_memory()?;
//! assert!(sound.take().is_some_and(|stream| stream.data.iter().any(|x| *x != 0.0)));
//! # Ok::<(), foley::Errors>(())
//! ```
//!
//! # One algorithm without a graph
//!
//! [`nodes`] is the library `foley-nodes`: functions and structs on slices, without the runtime. The chapter "From another tool" of the book
//! (`foley docs from-another-tool`) has ten lines for each family, among them the mel cepstrum of a file and a modal bank under impacts; "The node library in your
//! program" (`foley docs library`) goes on from there.
#![forbid(unsafe_code)]
// Messages go through `cli::console`: the macros panic where nobody reads them.
#![cfg_attr(not(test), deny(clippy::print_stderr, clippy::print_stdout))]

pub mod cli;
pub mod diag;
#[doc(hidden)]
pub mod docs;
#[doc(hidden)]
pub mod draw;
pub mod graph;
pub mod lang;
pub mod live;
#[doc(hidden)]
pub mod lsp;
pub mod memo;
pub mod plan;
pub mod probe;
pub mod run;
pub mod session;
pub mod testing;
#[doc(hidden)]
pub mod watch;

pub use foley_nodes as nodes;
pub use foley_nodes::registry::Registry;
pub use session::{Errors, Session, run_file};

// The Rust examples of the book are compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../docs/src/writing-a-node.md")]
pub mod book_writing_a_node {}
#[cfg(doctest)]
#[doc = include_str!("../docs/src/library.md")]
pub mod book_library {}
#[cfg(doctest)]
#[doc = include_str!("../docs/src/from-another-tool.md")]
pub mod book_from_another_tool {}
#[cfg(doctest)]
#[doc = include_str!("../docs/src/impact.md")]
pub mod book_impact {}
#[cfg(doctest)]
#[doc = include_str!("../docs/src/crumple.md")]
pub mod book_crumple {}
#[cfg(doctest)]
#[doc = include_str!("../docs/src/texture.md")]
pub mod book_texture {}
