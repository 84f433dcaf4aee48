//! The parts of a stream file: blocks, header and tail.

use crate::memo::entry::Entry;
use crate::memo::plain_file;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

pub const MAGIC: &[u8; 8] = b"foleystm";
pub const FORMAT: u32 = 1;
/// Bytes of magic and format.
pub const PREFIX: u64 = 12;
/// Bytes of a block before its payload: first and end position, length, hash.
pub const BLOCK_PREFIX: usize = 8 + 8 + 8 + 32;
/// Bytes of the length and hash of the header, and magic.
const TAIL: u64 = 4 + 32 + 8;
/// Bytes that are gathered before a block is written.
pub const BLOCK: usize = 1 << 18;

pub fn block_hash(from: i64, to: i64, payload: &[u8]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&from.to_le_bytes()).update(&to.to_le_bytes()).update(payload);
    hasher.finalize()
}

/// A verified block.
pub struct Block {
    /// First position.
    pub from: i64,
    /// End position.
    pub to: i64,
    /// Encoded items or events.
    pub payload: Vec<u8>,
    hash: blake3::Hash,
}

/// Reads and verifies the next block.
pub fn read_block(file: &mut dyn Read) -> Result<Block, &'static str> {
    let mut prefix = [0; BLOCK_PREFIX];
    file.read_exact(&mut prefix).map_err(|_| "it is cut short")?;
    let number = |k: usize| prefix[8 * k..8 * k + 8].try_into().map_or(0, i64::from_le_bytes);
    let (from, to, length) = (number(0), number(1), number(2));
    let length = u64::try_from(length).map_err(|_| "a block has a wrong length")?;
    let mut payload = Vec::new();
    // The buffer grows with the data: the length may be wrong.
    let read = file.take(length).read_to_end(&mut payload).map_err(|_| "it cannot be read")?;
    let hash = block_hash(from, to, &payload);
    if read as u64 != length || hash.as_bytes()[..] != prefix[24..] || to < from {
        return Err("a block is damaged or cut short");
    }
    Ok(Block { from, to, payload, hash })
}

/// Reads the header of a file and its position, without the blocks.
fn read_tail(file: &mut (impl Read + Seek)) -> Result<(Entry, u64), &'static str> {
    const SHORT: &str = "it is cut short";
    let length = file.seek(SeekFrom::End(0)).map_err(|_| SHORT)?;
    let tail_at = length.checked_sub(TAIL).ok_or(SHORT)?;
    file.seek(SeekFrom::Start(tail_at)).map_err(|_| SHORT)?;
    let mut tail = [0; TAIL as usize];
    file.read_exact(&mut tail).map_err(|_| SHORT)?;
    if &tail[36..] != MAGIC {
        return Err("it is damaged or cut short");
    }
    let size = u64::from(tail[..4].try_into().map_or(0, u32::from_le_bytes));
    let header_at =
        tail_at.checked_sub(size).filter(|at| *at >= PREFIX).ok_or("its header has a wrong length")?;
    file.seek(SeekFrom::Start(header_at)).map_err(|_| SHORT)?;
    let mut header = Vec::new();
    file.take(size).read_to_end(&mut header).map_err(|_| SHORT)?;
    if blake3::hash(&header).as_bytes()[..] != tail[4..36] {
        return Err("its header is damaged");
    }
    let entry = serde_json::from_slice(&header).map_err(|_| "its header cannot be read")?;
    Ok((entry, header_at))
}

/// Reads the header of a file; `None` if it cannot be read.
pub fn read_header(path: &Path) -> Option<Entry> {
    read_tail(&mut plain_file::open(path).ok()?).ok().map(|(entry, _)| entry)
}

/// Reads a whole file, compares every hash, and checks the key and the end position.
pub fn verify(file: &mut (impl Read + Seek), key: &str, stream_end: i64) -> Result<Entry, &'static str> {
    let (entry, end) = read_tail(file)?;
    if entry.key != key {
        return Err("it belongs to another key");
    }
    file.seek(SeekFrom::Start(0)).map_err(|_| "it cannot be read")?;
    let mut prefix = [0; PREFIX as usize];
    file.read_exact(&mut prefix).map_err(|_| "it is cut short")?;
    if &prefix[..8] != MAGIC || prefix[8..] != FORMAT.to_le_bytes() {
        return Err("it is another kind of file");
    }
    let (mut all, mut at, mut position) = (blake3::Hasher::new(), PREFIX, 0);
    while at < end {
        let block = read_block(file)?;
        if block.from != position {
            return Err("a block is missing");
        }
        at += (BLOCK_PREFIX + block.payload.len()) as u64;
        position = block.to;
        all.update(block.hash.as_bytes());
    }
    let hash = entry.outputs.first().map(|o| o.hash.as_str());
    if hash != Some(all.finalize().to_string().as_str()) || position < stream_end {
        return Err("it is not complete");
    }
    Ok(entry)
}
