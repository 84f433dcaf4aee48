//! The layout of a graph's text.
