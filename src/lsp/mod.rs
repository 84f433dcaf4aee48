//! A language server for graphs, for requests of editors over the Language Server Protocol 3.17.
//!
//! [`serve`] answers requests on the thread that it is called on. A second thread inspects graphs for diagnostics, rates and
//! formats (`analysis`), so that no request waits for a file. All requests but these are answered from the texts alone: the
//! error-tolerant tree of [`lang`](crate::lang), and the names in it (`names`).

mod actions;
mod analysis;
mod completion;
mod context;
mod diagnostics;
mod extract;
mod file;
mod formats;
mod hover;
mod names;
mod outline;
mod rename;
mod requests;
mod server;
mod test_files;
mod tokens;
mod workspace;

pub use lsp_server::Connection;
pub use server::serve;
