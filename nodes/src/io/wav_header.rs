//! The chunk walk of RIFF, RF64 and BW64 files, which believes no length before the bytes are there.
//!
//! # Source
//! Microsoft, "Multiple channel audio data and WAVE files"; EBU Tech 3306 (RF64) and ITU-R BS.2088 (BW64).

use std::io::{Read, Seek, SeekFrom};

use super::{AudioError, AudioWarning, SampleFormat};

/// Chunks that a file may hold before this reader gives up on it.
const MAX_CHUNKS: usize = 10_000;

/// Bytes behind a chunk of a false length in which the next one is looked for.
const SEARCHED: u64 = 1 << 20;

const KNOWN: [&[u8; 4]; 22] = [
    b"fmt ", b"data", b"fact", b"LIST", b"JUNK", b"junk", b"PAD ", b"FLLR", b"bext", b"ds64", b"cue ",
    b"smpl", b"inst", b"PEAK", b"id3 ", b"ID3 ", b"iXML", b"axml", b"chna", b"acid", b"plst", b"note",
];

/// Where and how the samples of a WAV file lie.
#[derive(Clone, Debug)]
pub(super) struct WavHeader {
    pub rate: u32,
    pub channels: usize,
    pub sample_format: SampleFormat,
    /// Bytes per sample of one channel.
    pub container: usize,
    pub channel_mask: Option<u32>,
    pub data_start: u64,
    pub frames: u64,
    pub warnings: Vec<AudioWarning>,
}

struct Format {
    rate: u32,
    channels: usize,
    sample_format: SampleFormat,
    container: usize,
    channel_mask: Option<u32>,
}

struct Data {
    start: u64,
    size: u64,
    /// The header gives no length.
    open: bool,
}

impl WavHeader {
    pub fn read(source: &mut (impl Read + Seek), len: u64) -> Result<Self, AudioError> {
        let mut format = None;
        let mut data: Option<Data> = None;
        let mut wide_size = None;
        let mut at = 12_u64;
        let mut false_chunk = None;
        for _ in 0..MAX_CHUNKS {
            if at.saturating_add(8) > len || (format.is_some() && data.is_some()) {
                break;
            }
            let mut head = [0; 8];
            read_at(source, at, &mut head)?;
            let id = &head[..4];
            let size = u64::from(u32::from_le_bytes([head[4], head[5], head[6], head[7]]));
            let body = at + 8;
            let mut next = body + size;
            match id {
                b"fmt " if format.is_none() => {
                    format = Some(read_format(source, body, size.min(len - body))?)
                }
                b"ds64" if wide_size.is_none() && size >= 24 && body + 24 <= len => {
                    let mut sizes = [0; 16];
                    read_at(source, body, &mut sizes)?;
                    wide_size = sizes[8..].try_into().ok().map(u64::from_le_bytes);
                }
                b"data" if data.is_none() => {
                    let found = data_chunk(source, body, size, wide_size, len)?;
                    next = body.saturating_add(found.size);
                    data = Some(found);
                }
                _ => {}
            }
            if next <= len || data.is_some() {
                at = after_pad(source, next, len)?;
                continue;
            }
            let chunk = String::from_utf8_lossy(id).into_owned();
            false_chunk = Some(AudioWarning::FalseChunk { chunk, at, size, there: len - body });
            match find_needed(source, body, len)? {
                Some(found) => at = found,
                None => break,
            }
        }
        let missing = |what: &str| {
            let lie = false_chunk.as_ref().map(|lie| format!("{lie}; ")).unwrap_or_default();
            AudioError::Malformed { format: "WAV", at: at.min(len), what: format!("{lie}{what}") }
        };
        let format =
            format.ok_or_else(|| missing("no \"fmt \" chunk found; one must say how samples are stored"))?;
        let data = data.ok_or_else(|| missing("no \"data\" chunk found; one must hold the samples"))?;
        let mut header = Self::new(format, &data, len);
        header.warnings.extend(false_chunk);
        Ok(header)
    }

    fn new(format: Format, data: &Data, len: u64) -> Self {
        let frame_bytes = (format.container * format.channels) as u64;
        let there = len.saturating_sub(data.start);
        let bytes = if data.open { there } else { data.size.min(there) };
        let frames = bytes / frame_bytes;
        let mut warnings = Vec::new();
        if data.open {
            warnings.push(AudioWarning::OpenLength);
        } else if data.size > there {
            let header_frames = data.size / frame_bytes;
            warnings.push(AudioWarning::LengthDiffers { header_frames, frames, rate: format.rate });
        }
        if !bytes.is_multiple_of(frame_bytes) {
            warnings.push(AudioWarning::PartialLastFrame { bytes: bytes % frame_bytes });
        }
        Self {
            rate: format.rate,
            channels: format.channels,
            sample_format: format.sample_format,
            container: format.container,
            channel_mask: format.channel_mask,
            data_start: data.start,
            frames,
            warnings,
        }
    }
}

fn data_chunk(
    source: &mut (impl Read + Seek),
    start: u64,
    size: u64,
    wide_size: Option<u64>,
    len: u64,
) -> Result<Data, AudioError> {
    let open = match size {
        // As below; there is no wide size, or one that was never filled in.
        0xFFFF_FFFF if wide_size == Some(0) => start < len && !begins_chunk(source, start, len)?,
        0xFFFF_FFFF => wide_size.is_none(),
        // Nothing, or a stream whose writer never came back to fill in the size: then no chunk follows.
        0 => start < len && !begins_chunk(source, start, len)?,
        _ => false,
    };
    let size = if size == 0xFFFF_FFFF { wide_size.unwrap_or(size) } else { size };
    Ok(Data { start, size: if open { len - start } else { size }, open })
}

/// The first chunk near by that a file cannot do without, behind one whose length leads out of the file.
fn find_needed(source: &mut (impl Read + Seek), from: u64, len: u64) -> Result<Option<u64>, AudioError> {
    let mut near = vec![0; len.saturating_sub(from).min(SEARCHED) as usize];
    read_at(source, from, &mut near)?;
    let needed = |id: &[u8]| id == b"fmt " || id == b"data";
    Ok(near.windows(4).position(needed).map(|k| from + k as u64))
}

/// The next chunk: behind a pad byte when the size was odd, unless the writer forgot to pad.
fn after_pad(source: &mut (impl Read + Seek), end: u64, len: u64) -> Result<u64, AudioError> {
    if end.is_multiple_of(2) || end >= len {
        return Ok(end);
    }
    let forgotten = begins_chunk(source, end, len)? && !begins_chunk(source, end + 1, len)?;
    Ok(if forgotten { end } else { end + 1 })
}

fn begins_chunk(source: &mut (impl Read + Seek), at: u64, len: u64) -> Result<bool, AudioError> {
    if at.saturating_add(8) > len {
        return Ok(false);
    }
    let mut id = [0; 4];
    read_at(source, at, &mut id)?;
    Ok(KNOWN.contains(&&id))
}

fn read_format(source: &mut (impl Read + Seek), at: u64, size: u64) -> Result<Format, AudioError> {
    let broken = |what: String| AudioError::Malformed { format: "WAV", at, what };
    if size < 16 {
        return Err(broken(format!("the \"fmt \" chunk has {size} bytes; it needs at least 16")));
    }
    let mut b = [0; 40];
    let size = size.min(40) as usize;
    read_at(source, at, &mut b[..size])?;
    let u16_at = |i: usize| u16::from_le_bytes([b[i], b[i + 1]]);
    let u32_at = |i: usize| u32::from_le_bytes([b[i], b[i + 1], b[i + 2], b[i + 3]]);
    let mut tag = u16_at(0);
    let channels = usize::from(u16_at(2));
    let rate = u32_at(4);
    let block = usize::from(u16_at(12));
    let bits = u16_at(14);
    let mut valid_bits = bits;
    let mut channel_mask = None;
    if tag == 0xFFFE && size >= 40 {
        if u16_at(18) != 0 {
            valid_bits = u16_at(18);
        }
        channel_mask = Some(u32_at(20)).filter(|&mask| mask != 0);
        tag = u16_at(24);
    }
    if channels == 0 || rate == 0 {
        return Err(broken(format!(
            "{channels} channels at {rate} samples per second; both must be at least 1"
        )));
    }
    // The block says how wide a container is; a block that cannot be right gives way to the bits.
    let by_bits = usize::from(bits.div_ceil(8));
    let container =
        if block.is_multiple_of(channels) && block / channels >= by_bits.max(1) && block / channels <= 8 {
            block / channels
        } else {
            by_bits
        };
    let sample_format = match (tag, container, valid_bits) {
        (1, 1..=4, v) if v >= 1 && usize::from(v) <= 8 * container => SampleFormat::Int { bits: v },
        (3, 4, _) => SampleFormat::Float { bits: 32 },
        (3, 8, _) => SampleFormat::Float { bits: 64 },
        _ => {
            let name = match tag {
                1 => "linear PCM",
                2 => "ADPCM",
                3 => "float",
                6 => "A-law",
                7 => "mu-law",
                0x11 => "IMA ADPCM",
                0x55 => "MP3 in WAV",
                _ => "codec",
            };
            return Err(AudioError::Unsupported {
                found: format!("WAV with {name} (tag {tag:#06x}), {valid_bits} bits in {container} bytes"),
                wanted: "WAV is read as 8 to 32-bit linear PCM and as 32 or 64-bit float",
            });
        }
    };
    Ok(Format { rate, channels, sample_format, container, channel_mask })
}

pub(super) fn read_at(source: &mut (impl Read + Seek), at: u64, out: &mut [u8]) -> Result<(), AudioError> {
    source.seek(SeekFrom::Start(at))?;
    source.read_exact(out)?;
    Ok(())
}
