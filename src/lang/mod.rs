//! The text of a graph: a lossless, error-tolerant RON syntax tree.
