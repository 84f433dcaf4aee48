//! One output of a node on disk: blocks of its items or events, in the order of their times.
//!
//! A file is magic and format version; blocks of first position, end position, length, hash and payload; the header as JSON
//! (see [`Entry`]); and a tail that says how long the header is, its hash, and magic again. The header comes last because
//! what it tells is known last. Positions are items (ticks for events) in the time of the stream, so a reader needs to
//! know nothing of the windows, delays or threads of the run that wrote it.

use super::store::{Entry, Unusable, temporary};
use foley_nodes::core::buffer::{AnyBuffer, Budget, Pad};
use foley_nodes::core::fault::Fault;
use foley_nodes::core::item::{EventType, ItemType};
use foley_nodes::core::node::{DynNode, Summary};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::stage::{Cx, Span};
use foley_nodes::core::state::StateArchive;
use foley_nodes::core::time::Tick;
use std::any::Any;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Cursor, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

const MAGIC: &[u8; 8] = b"foleystm";
const FORMAT: u32 = 1;
/// Magic and format.
const FRONT: u64 = 12;
/// First and end position, length, hash.
const BLOCK_FRONT: usize = 8 + 8 + 8 + 32;
/// Length and hash of the header, magic.
const TAIL: u64 = 4 + 32 + 8;
/// Bytes that are gathered before a block is written.
const BLOCK: usize = 1 << 18;

/// What runs over a port, and how it becomes bytes.
#[derive(Clone, Copy, Debug)]
pub enum Codec {
    /// Items of so many elements, and the item at which the stream ends.
    Items(&'static ItemType, usize, i64),
    /// Events, and the tick at which they end.
    Events(&'static EventType, Tick),
}

impl Codec {
    /// That of an output of a node; `None` for values and for streams without end.
    #[must_use]
    pub fn of(kind: PortKind, shape: &NodeShape, port: usize) -> Option<Self> {
        let end = shape.end?;
        match kind {
            PortKind::Stream(item) => {
                let stream = shape.outputs.get(port)?.as_ref()?;
                (stream.width > 0).then_some(Self::Items(item, stream.width, stream.rate.first_at(end)))
            }
            PortKind::Events(event) => Some(Self::Events(event, end)),
            PortKind::Value(_) | PortKind::Fold(_) => None,
        }
    }

    /// Where it ends: an item, or a tick.
    #[must_use]
    pub fn end(&self) -> i64 {
        let (Self::Items(.., end) | Self::Events(_, end)) = self;
        *end
    }

    /// Bytes of all of it, about.
    #[must_use]
    pub fn bytes(&self) -> f64 {
        match self {
            Self::Items(item, width, end) => item.elem_bytes as f64 * *width as f64 * *end as f64,
            // Events are few; how many nobody knows before.
            Self::Events(..) => 4096.0,
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Items(item, ..) => item.name,
            Self::Events(event, _) => event.name,
        }
    }

    fn encode(&self, buffer: &dyn AnyBuffer, span: Span, out: &mut Vec<u8>) -> Option<()> {
        let (Self::Items(ItemType { encode, .. }, ..) | Self::Events(EventType { encode, .. }, _)) = self;
        encode(buffer, span.from, span.to, out)
    }

    /// The block as a buffer.
    fn decode(&self, block: &Block) -> Option<Box<dyn AnyBuffer>> {
        let items = usize::try_from(block.to - block.from).ok()?;
        let mut buffer = match self {
            Self::Items(item, width, _) => {
                // A false length must not ask for memory: an element takes a byte at least.
                if items.checked_mul(*width)? > block.payload.len() {
                    return None;
                }
                (item.buffer)(*width, items, 0, Pad::Silence)
            }
            Self::Events(event, _) => (event.buffer)(Tick::MAX / 4, &Budget::default()),
        };
        buffer.restart(block.from);
        let (Self::Items(ItemType { decode, .. }, ..) | Self::Events(EventType { decode, .. }, _)) = self;
        decode(&mut *buffer, &block.payload)?;
        if matches!(self, Self::Events(..)) {
            buffer.pad_to(block.to);
        }
        (buffer.end() == block.to).then_some(buffer)
    }
}

/// A file that is being written; without [`Part::commit`] nothing stays of it.
#[derive(Debug)]
pub struct Part {
    path: PathBuf,
    temporary: PathBuf,
    file: Option<BufWriter<File>>,
    bytes: u64,
    most: u64,
    end: i64,
    hash: blake3::Hasher,
    /// Why it cannot be kept.
    failed: Option<io::Error>,
}

impl Part {
    /// Starts a file that is to stand at `path` and to take at most `most` bytes.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn create(path: PathBuf, most: u64) -> io::Result<Self> {
        let temporary = temporary(&path)?;
        let mut file = BufWriter::new(File::create(&temporary)?);
        file.write_all(MAGIC)?;
        file.write_all(&FORMAT.to_le_bytes())?;
        let hash = blake3::Hasher::new();
        Ok(Self { path, temporary, file: Some(file), bytes: FRONT, most, end: 0, hash, failed: None })
    }

    /// Bytes so far, or `None` where it was given up.
    #[must_use]
    pub fn whole(&self, codec: &Codec) -> Option<u64> {
        (self.file.is_some() && self.end >= codec.end()).then_some(self.bytes)
    }

    /// Why it could not be written.
    pub fn take_failure(&mut self) -> Option<io::Error> {
        self.failed.take()
    }

    /// The hash of all that stands in it.
    #[must_use]
    pub fn hash(&self) -> blake3::Hash {
        self.hash.finalize()
    }

    fn give_up(&mut self, why: Option<io::Error>) {
        self.file = None;
        self.failed = why;
        let _ = fs::remove_file(&self.temporary);
    }

    fn block(&mut self, from: i64, to: i64, payload: &[u8]) {
        let Some(file) = &mut self.file else { return };
        self.bytes += (BLOCK_FRONT + payload.len()) as u64;
        if self.bytes > self.most || from != self.end {
            return self.give_up(None);
        }
        let hash = hash_of(from, to, payload);
        self.hash.update(hash.as_bytes());
        self.end = to;
        let numbers = [from.to_le_bytes(), to.to_le_bytes(), (payload.len() as u64).to_le_bytes()];
        let pieces = [&numbers.concat(), &hash.as_bytes()[..], payload];
        if let Err(e) = pieces.iter().try_for_each(|piece| file.write_all(piece)) {
            self.give_up(Some(e));
        }
    }

    /// Completes the file with its header, and moves it to its place.
    ///
    /// It is not synced: what a loss of power leaves of it is found out when it is read.
    ///
    /// # Errors
    /// When that cannot be done; nothing stays of it then.
    pub fn commit(mut self, entry: &Entry) -> io::Result<()> {
        let Some(mut file) = self.file.take() else { return Ok(()) };
        let header = serde_json::to_vec(entry)?;
        file.write_all(&header)?;
        file.write_all(&(header.len() as u32).to_le_bytes())?;
        file.write_all(blake3::hash(&header).as_bytes())?;
        file.write_all(MAGIC)?;
        file.flush()?;
        drop(file);
        fs::rename(&self.temporary, &self.path)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // After a commit there is no file of that name.
        let _ = fs::remove_file(&self.temporary);
    }
}

fn hash_of(from: i64, to: i64, payload: &[u8]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&from.to_le_bytes()).update(&to.to_le_bytes()).update(payload);
    hasher.finalize()
}

/// A file that several windows write to, one after the other.
pub type SharedPart = Arc<Mutex<Part>>;

/// Writes an output as it runs by.
pub struct Writer {
    codec: Codec,
    part: SharedPart,
    payload: Vec<u8>,
    from: i64,
    to: i64,
}

impl Writer {
    /// Writes what comes in at port 0.
    #[must_use]
    pub fn new(codec: Codec, part: SharedPart) -> Self {
        Self { codec, part, payload: Vec::new(), from: 0, to: 0 }
    }

    fn flush(&mut self) {
        let mut part = self.part.lock().unwrap_or_else(PoisonError::into_inner);
        part.block(self.from, self.to, &self.payload);
        self.payload.clear();
        self.from = self.to;
    }
}

impl DynNode for Writer {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let done = cx.raw_input(0, |buffer, span| {
            self.to = self.to.max(span.to);
            if span.to > span.from { self.codec.encode(buffer, span, &mut self.payload) } else { Some(()) }
        });
        if done.flatten().is_none() {
            let mut part = self.part.lock().unwrap_or_else(PoisonError::into_inner);
            part.give_up(None);
        }
        if self.payload.len() >= BLOCK {
            self.flush();
        }
        Ok(())
    }

    fn finish(&mut self, _: &Cx<'_>) -> Result<Summary, Fault> {
        if self.to > self.from {
            self.flush();
        }
        Ok(Summary::new())
    }

    /// A run that goes on has not what came before: it keeps nothing.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        if archive.restores() {
            self.part.lock().unwrap_or_else(PoisonError::into_inner).give_up(None);
        }
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// A block as it was read.
struct Block {
    from: i64,
    to: i64,
    payload: Vec<u8>,
    hash: blake3::Hash,
}

fn read_block(file: &mut dyn Read) -> Result<Block, &'static str> {
    let mut front = [0; BLOCK_FRONT];
    file.read_exact(&mut front).map_err(|_| "it is cut short")?;
    let number = |k: usize| front[8 * k..8 * k + 8].try_into().map_or(0, i64::from_le_bytes);
    let (from, to, length) = (number(0), number(1), number(2));
    let length = u64::try_from(length).map_err(|_| "a block has a false length")?;
    let mut payload = Vec::new();
    // Grows with what is there: the length is not believed.
    let read = file.take(length).read_to_end(&mut payload).map_err(|_| "it cannot be read")?;
    let hash = hash_of(from, to, &payload);
    if read as u64 != length || hash.as_bytes()[..] != front[24..] || to < from {
        return Err("a block is damaged or cut short");
    }
    Ok(Block { from, to, payload, hash })
}

/// The header of a file, and where it begins, without a look at the blocks.
fn tail(file: &mut (impl Read + Seek)) -> Result<(Entry, u64), &'static str> {
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
        tail_at.checked_sub(size).filter(|at| *at >= FRONT).ok_or("its header has a false length")?;
    file.seek(SeekFrom::Start(header_at)).map_err(|_| SHORT)?;
    let mut header = Vec::new();
    file.take(size).read_to_end(&mut header).map_err(|_| SHORT)?;
    if blake3::hash(&header).as_bytes()[..] != tail[4..36] {
        return Err("its header is damaged");
    }
    let entry = serde_json::from_slice(&header).map_err(|_| "its header cannot be read")?;
    Ok((entry, header_at))
}

/// The header of a file; `None` where there is none that can be read.
pub(super) fn header(path: &Path) -> Option<Entry> {
    tail(&mut File::open(path).ok()?).ok().map(|(entry, _)| entry)
}

/// Reads all of a file and compares every hash.
fn verify(file: &mut (impl Read + Seek), key: &str, codec: &Codec) -> Result<Entry, &'static str> {
    let (entry, end) = tail(file)?;
    if entry.key != key {
        return Err("it belongs to another key");
    }
    file.seek(SeekFrom::Start(0)).map_err(|_| "it cannot be read")?;
    let mut front = [0; FRONT as usize];
    file.read_exact(&mut front).map_err(|_| "it is cut short")?;
    if &front[..8] != MAGIC || front[8..] != FORMAT.to_le_bytes() {
        return Err("it is another kind of file");
    }
    let (mut all, mut at, mut position) = (blake3::Hasher::new(), FRONT, 0);
    while at < end {
        let block = read_block(file)?;
        if block.from != position {
            return Err("a block is missing");
        }
        at += (BLOCK_FRONT + block.payload.len()) as u64;
        position = block.to;
        all.update(block.hash.as_bytes());
    }
    let hash = entry.outputs.first().map(|o| o.hash.as_str());
    if hash != Some(all.finalize().to_string().as_str()) || position < codec.end() {
        return Err("it is not whole");
    }
    Ok(entry)
}

/// A stream that is kept, verified and ready to be read from its start, more than once.
#[derive(Debug)]
pub enum Source {
    /// In memory.
    Bytes(Arc<[u8]>),
    /// In a file, which stays readable when another process removes it.
    File(Mutex<File>),
}

impl Source {
    /// Looks for the stream of a key; files of up to `most` bytes are read into memory.
    ///
    /// # Errors
    /// When a file of that name is there, and is no whole entry of that key.
    pub fn find(path: &Path, key: &str, codec: &Codec, most: u64) -> Result<Option<(Entry, Self)>, Unusable> {
        let unusable = |what: &str| Unusable(what.to_owned());
        let mut file = match File::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Unusable(format!("it cannot be read: {e}"))),
        };
        let length = file.metadata().map_or(u64::MAX, |meta| meta.len());
        if length > most {
            let mut reader = BufReader::with_capacity(BLOCK, file);
            let entry = verify(&mut reader, key, codec).map_err(unusable)?;
            return Ok(Some((entry, Self::File(Mutex::new(reader.into_inner())))));
        }
        let mut bytes = Vec::with_capacity(length as usize);
        file.read_to_end(&mut bytes).map_err(|e| Unusable(format!("it cannot be read: {e}")))?;
        let bytes: Arc<[u8]> = bytes.into();
        let entry = verify(&mut Cursor::new(&bytes[..]), key, codec).map_err(unusable)?;
        Ok(Some((entry, Self::Bytes(bytes))))
    }

    fn open(&self) -> io::Result<Box<dyn Read + Send>> {
        Ok(match self {
            Self::Bytes(bytes) => {
                let mut bytes = Cursor::new(Arc::clone(bytes));
                bytes.set_position(FRONT);
                Box::new(bytes)
            }
            Self::File(file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner).try_clone()?;
                file.seek(SeekFrom::Start(FRONT))?;
                Box::new(BufReader::with_capacity(BLOCK, file))
            }
        })
    }
}

/// One port of a [`Reader`].
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
                    let decoded = self.codec.decode(&block).ok_or("a block holds something else")?;
                    self.block.insert(decoded)
                }
            };
            // Blocks that an earlier run has read are passed over.
            let to = block.end().min(span.to);
            if to > at {
                buffer.append_from(&**block, at, to);
                at = to;
            }
        }
        Ok(())
    }
}

/// Stands for a node whose streams were kept.
pub struct Reader(Vec<PortReader>);

impl Reader {
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

impl DynNode for Reader {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        for reader in &mut self.0 {
            let name = reader.codec.name();
            let filled = cx.raw_output(reader.port, |buffer, span| reader.fill(buffer, span));
            if let Some(Err(what)) = filled {
                // It was whole a moment ago.
                let message = format!("the {name} kept from an earlier run cannot be used: {what}");
                return Err(Fault::new("F084", message).help("run again, or without the cache: --no-cache"));
            }
        }
        Ok(())
    }

    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}
