//! WAV files (RIFF, RF64, BW64): header, samples, and a writer.

mod header;
mod reader;
mod samples;
mod writer;

pub(super) use header::WavHeader;
pub(super) use reader::WavReader;
pub use writer::{AudioWriter, Dither, WriteFormat, WriteSpec, WrittenInfo};
