//! Verifies stream files, and reads them in place of the nodes that produced the streams.

use super::codec::Codec;
use super::format::{BLOCK, PREFIX, read_block, verify};
use crate::memo::entry::{Entry, Unusable};
use crate::memo::plain_file;
use foley_nodes::core::buffer::AnyBuffer;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::stage::{Cx, Span};
use std::any::Any;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// A verified stream that can be read more than once.
#[derive(Debug)]
pub enum Source {
    /// In memory.
    Bytes(Arc<[u8]>),
    /// In an open file, which remains readable when another process removes it.
    File(Mutex<File>),
}

impl Source {
    /// Finds and verifies the stream of a key; files of up to `max_bytes` are read into memory.
    ///
    /// # Errors
    /// If a file of this name exists, but is not a complete entry of the key.
    pub fn find(
        path: &Path,
        key: &str,
        codec: &Codec,
        max_bytes: u64,
    ) -> Result<Option<(Entry, Self)>, Unusable> {
        let unusable = |reason: &str| Unusable(reason.to_owned());
        let mut file = match plain_file::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Unusable(format!("it cannot be read: {e}"))),
        };
        let length = file.metadata().map_or(u64::MAX, |meta| meta.len());
        if length > max_bytes {
            let mut reader = BufReader::with_capacity(BLOCK, file);
            let entry = verify(&mut reader, key, codec.end()).map_err(unusable)?;
            return Ok(Some((entry, Self::File(Mutex::new(reader.into_inner())))));
        }
        let mut bytes = Vec::with_capacity(length as usize);
        file.read_to_end(&mut bytes).map_err(|e| Unusable(format!("it cannot be read: {e}")))?;
        let bytes: Arc<[u8]> = bytes.into();
        let entry = verify(&mut Cursor::new(&bytes[..]), key, codec.end()).map_err(unusable)?;
        Ok(Some((entry, Self::Bytes(bytes))))
    }

    fn open(&self) -> io::Result<Box<dyn Read + Send>> {
        Ok(match self {
            Self::Bytes(bytes) => {
                let mut bytes = Cursor::new(Arc::clone(bytes));
                bytes.set_position(PREFIX);
                Box::new(bytes)
            }
            Self::File(file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner).try_clone()?;
                file.seek(SeekFrom::Start(PREFIX))?;
                Box::new(BufReader::with_capacity(BLOCK, file))
            }
        })
    }
}

/// One port of a [`StreamReader`].
struct PortReader {
    port: usize,
    codec: Codec,
    file: Box<dyn Read + Send>,
    block: Option<Box<dyn AnyBuffer>>,
}

impl PortReader {
    fn fill(&mut self, buffer: &mut dyn AnyBuffer, span: Span) -> Result<(), &'static str> {
        let mut at = span.from;
        while at < span.to {
            let block = match &self.block {
                Some(block) if block.end() > at => block,
                _ => {
                    let block = read_block(&mut *self.file)?;
                    let decoded = self.codec.decode(&block).ok_or("a block has the wrong content")?;
                    self.block.insert(decoded)
                }
            };
            // A resumed run skips the blocks before its checkpoint.
            let to = block.end().min(span.to);
            if to > at {
                buffer.append_from(&**block, at, to);
                at = to;
            }
        }
        Ok(())
    }
}

/// Runs in place of a node whose streams are cached.
pub struct StreamReader(Vec<PortReader>);

impl StreamReader {
    /// Opens the outputs of a node, by port.
    ///
    /// # Errors
    /// When a file cannot be opened.
    pub fn open(outputs: &[(usize, Codec, Arc<Source>)]) -> io::Result<Self> {
        let one = |(port, codec, source): &(usize, Codec, Arc<Source>)| {
            Ok(PortReader { port: *port, codec: *codec, file: source.open()?, block: None })
        };
        outputs.iter().map(one).collect::<io::Result<_>>().map(Self)
    }
}

impl DynNode for StreamReader {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        for reader in &mut self.0 {
            let name = reader.codec.name();
            let filled = cx.raw_output(reader.port, |buffer, span| reader.fill(buffer, span));
            if let Some(Err(reason)) = filled {
                // It was verified before: it has changed since.
                let message = format!("the cached {name} of an earlier run cannot be used: {reason}");
                return Err(Fault::new("F084", message).help("run again, or without the cache: --no-cache"));
            }
        }
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
