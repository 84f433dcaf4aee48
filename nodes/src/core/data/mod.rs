//! Data types and time: the types that travel between nodes, and the buffers, files and states that hold it.

pub mod buffer;
pub mod content;
pub mod fault;
pub mod feed;
pub mod files;
pub mod input;
pub mod item;
pub(crate) mod pool;
pub mod random;
pub mod silence;
pub mod state;
pub mod time;
pub mod unmatched;
