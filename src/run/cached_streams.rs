//! Streams that are read from the cache in place of nodes, and written to it in addition to taps.

use crate::memo::stream::{Codec, SharedPartialStream, Source, StreamReader, StreamWriter};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use std::collections::HashMap;
use std::sync::Arc;

/// Outputs of a node: port, codec, and data per output.
pub type Outputs<T> = Vec<(usize, Codec, T)>;

/// The streams of a phase that are read from the cache or written to it.
#[derive(Default)]
pub struct CachedStreams {
    /// Number of the first tap that is a stream writer; those before it are the taps of the job.
    pub first_tap: usize,
    /// Sources of the nodes whose outputs are read.
    pub sources: HashMap<usize, Outputs<Arc<Source>>>,
    /// Outputs that are written.
    pub pending: Vec<PendingStream>,
}

/// An output that is being written to the cache.
pub struct PendingStream {
    /// The node.
    pub node: usize,
    /// Its output port.
    pub port: usize,
    /// Encoding.
    pub codec: Codec,
    /// Key in the cache.
    pub key: String,
    /// The file.
    pub file: SharedPartialStream,
}

impl CachedStreams {
    /// Returns true if the outputs of a node are read instead of computed.
    pub fn reads(&self, n: usize) -> bool {
        self.sources.contains_key(&n)
    }

    /// Opens the reader that runs in place of a node; `None` for a node that runs itself.
    pub fn reader(&self, n: usize) -> Option<Result<Box<dyn DynNode>, Fault>> {
        let outputs = self.sources.get(&n)?;
        let failed =
            |e| Fault::new("F084", format!("the cached streams of an earlier run cannot be read: {e}"));
        Some(StreamReader::open(outputs).map(|r| Box::new(r) as Box<dyn DynNode>).map_err(failed))
    }

    /// Makes the stream writer that runs as a tap of this number; `None` for a tap of the job.
    pub fn writer(&self, tap: usize) -> Option<Box<dyn DynNode>> {
        let pending = self.pending.get(tap.checked_sub(self.first_tap)?)?;
        Some(Box::new(StreamWriter::new(pending.codec, Arc::clone(&pending.file))))
    }
}
