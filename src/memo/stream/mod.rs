//! Output streams of nodes on disk: blocks of items or events, in the order of their times.
//!
//! A file is magic and format version; blocks of first position, end position, length, hash and payload; the header as JSON
//! (see [`Entry`](super::Entry)); and a tail with the length and the hash of the header, and magic again. The header comes
//! last because its content is known last. Positions are items (ticks for events) in the time of the stream, so that a
//! reader does not depend on the windows, delays and threads of the run that wrote the file.

mod codec;
mod format;
mod reader;
mod writer;

pub use codec::Codec;
pub(super) use format::read_header;
pub use reader::{Source, StreamReader};
pub use writer::{PartialStream, SharedPartialStream, StreamWriter};
