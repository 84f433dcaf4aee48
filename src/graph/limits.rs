//! Limits of graphs and their files.

/// Limits of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of one graph file, and of all its sub-graphs, each as often as it is used.
    pub graph_bytes: u64,
    /// Bytes of one input file.
    pub file_bytes: u64,
    /// Bytes of all buffers, and of a file that is held as a whole.
    pub memory: usize,
    /// Nodes of a graph, sub-graphs included.
    pub nodes: usize,
    /// Links of a graph.
    pub links: usize,
    /// Sub-graphs inside sub-graphs.
    pub depth: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            graph_bytes: 4 << 20,
            file_bytes: 64 << 30,
            memory: 4 << 30,
            nodes: 20_000,
            links: 200_000,
            depth: 16,
        }
    }
}
