//! Ogawa, the container of Alembic: a tree of groups and data blocks.
//!
//! The header is `"Ogawa"`, 0xff if the file was closed, the version (u16, big endian) and the position of the root
//! group. A group is a count and that many child positions. A data block is a length and the bytes. The top bit of a
//! position is set for a data block.

use super::super::bytes::{Source, u64_le};
use super::super::{MeshError, ReadSeek};

pub(super) const FORMAT: &str = "Alembic";
const DATA: u64 = 1 << 63;

/// A child of a group: a position with the flag for data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Child(u64);

impl Child {
    pub(super) fn is_data(self) -> bool {
        self.0 & DATA != 0
    }

    fn position(self) -> u64 {
        self.0 & !DATA
    }
}

pub(super) struct Ogawa {
    source: Source,
    /// Bytes left for tables: groups that refer to each other must not be read without end.
    budget: u64,
    max_bytes: u64,
}

pub(super) fn malformed(what: impl Into<String>) -> MeshError {
    MeshError::Malformed { format: FORMAT, what: what.into() }
}

impl Ogawa {
    /// Opens the container and returns the children of its root group.
    pub(super) fn open(file: Box<dyn ReadSeek>, max_bytes: u64) -> Result<(Self, Vec<Child>), MeshError> {
        let mut source = Source::new(file, FORMAT)?;
        let mut head = [0; 16];
        let n = source.length().min(16) as usize;
        source.read_at(0, &mut head[..n], || "the header".into())?;
        if head.starts_with(b"\x89HDF\r\n\x1a\n") {
            return Err(MeshError::Unsupported {
                format: FORMAT,
                what:
                    "the old HDF5 container; this reader reads Ogawa: convert it with `abcconvert -toOgawa`"
                        .into(),
            });
        }
        if !head.starts_with(b"Ogawa") || n < 16 {
            return Err(MeshError::Format {
                expected: "an Alembic file (Ogawa)",
                found: format!(
                    "it starts with {:?} and has {} bytes",
                    String::from_utf8_lossy(&head[..n.min(5)]),
                    source.length()
                ),
            });
        }
        if head[5] != 0xff {
            return Err(malformed(
                "it was not closed by the program that wrote it (byte 5 is not 0xff): export it again",
            ));
        }
        if head[6..8] != [0, 1] {
            return Err(malformed(format!(
                "Ogawa version {}, this reader reads 1",
                u16::from(head[6]) << 8 | u16::from(head[7])
            )));
        }
        let budget = source.length().saturating_mul(2).saturating_add(1 << 16).min(max_bytes);
        let mut ogawa = Self { source, budget, max_bytes };
        let root = ogawa.group_at(u64_le(&head[8..]))?;
        Ok((ogawa, root))
    }

    /// Children of a group.
    pub(super) fn group(&mut self, child: Child) -> Result<Vec<Child>, MeshError> {
        if child.is_data() {
            return Err(malformed(format!("data at {} where a group is expected", child.position())));
        }
        self.group_at(child.position())
    }

    fn group_at(&mut self, position: u64) -> Result<Vec<Child>, MeshError> {
        if position == 0 {
            return Ok(Vec::new());
        }
        let count = self.length_at(position, "a group")?;
        let size = count.saturating_mul(8);
        let bytes = self.bytes(position, size, "a group")?;
        Ok(bytes.chunks_exact(8).map(|c| Child(u64_le(c))).collect())
    }

    /// Number of bytes of a data block.
    pub(super) fn data_length(&mut self, child: Child) -> Result<u64, MeshError> {
        if !child.is_data() && child.position() != 0 {
            return Err(malformed(format!("a group at {} where data is expected", child.position())));
        }
        if child.position() == 0 {
            return Ok(0);
        }
        let length = self.length_at(child.position(), "data")?;
        let needed = child.position().saturating_add(8).saturating_add(length);
        if needed > self.source.length() {
            let what = format!("data at {}", child.position());
            return Err(MeshError::Truncated {
                format: FORMAT,
                what,
                needed,
                available: self.source.length(),
            });
        }
        Ok(length)
    }

    /// Bytes of a data block, for tables and small values.
    pub(super) fn data(&mut self, child: Child) -> Result<Vec<u8>, MeshError> {
        let length = self.data_length(child)?;
        if length == 0 { Ok(Vec::new()) } else { self.bytes(child.position(), length, "data") }
    }

    /// Fills `out` with the bytes of a data block from `offset`.
    pub(super) fn read(&mut self, child: Child, offset: u64, out: &mut [u8]) -> Result<(), MeshError> {
        let start = child.position().saturating_add(8).saturating_add(offset);
        self.source.read_at(start, out, || "a sample".into())
    }

    fn length_at(&mut self, position: u64, what: &str) -> Result<u64, MeshError> {
        let mut length = [0; 8];
        self.source.read_at(position, &mut length, || format!("{what} at {position}"))?;
        Ok(u64::from_le_bytes(length))
    }

    fn bytes(&mut self, position: u64, size: u64, what: &str) -> Result<Vec<u8>, MeshError> {
        let start = position.saturating_add(8);
        let end = start.saturating_add(size);
        if end > self.source.length() {
            return Err(MeshError::Truncated {
                format: FORMAT,
                what: format!("{what} at {position}"),
                needed: end,
                available: self.source.length(),
            });
        }
        if size > self.budget {
            return Err(malformed(format!(
                "its tables take more than twice the size of the file or more than `max_bytes` ({}): {what} at {position} is used many times",
                self.max_bytes
            )));
        }
        self.budget -= size;
        let mut out = vec![0; size as usize];
        self.source.read_at(start, &mut out, || format!("{what} at {position}"))?;
        Ok(out)
    }
}
