//! `foley lsp`.

use super::Exit;
use super::args::LspArgs;
use crate::lsp::{Connection, serve};
use foley_nodes::registry::Registry;
use std::sync::Arc;

/// Answers an editor over standard input and output until it ends the connection.
///
/// # Errors
/// When the editor breaks the protocol, or a stream fails.
pub fn lsp(args: &LspArgs, registry: &Arc<Registry>) -> anyhow::Result<Exit> {
    let (connection, threads) = Connection::stdio();
    let served = serve(&connection, &args.options(registry));
    // The threads end when nothing can be sent any more.
    drop(connection);
    served?;
    threads.join()?;
    Ok(Exit::Done)
}
