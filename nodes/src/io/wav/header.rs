//! Chunks of RIFF, RF64 and BW64 files; each length is checked against the bytes of the file.
//!
//! # Source
//! Microsoft, "Multiple channel audio data and WAVE files"; EBU Tech 3306 (RF64) and ITU-R BS.2088 (BW64).

use std::io::{Read, Seek, SeekFrom};

use crate::io::{AudioError, AudioWarning, SampleFormat};

/// Maximum number of chunks.
const MAX_CHUNKS: usize = 10_000;

/// Number of bytes to search for the next chunk after a chunk of invalid length.
const SEARCH_BYTES: u64 = 1 << 20;

/// Identifiers of common chunks.
const KNOWN_CHUNKS: [&[u8; 4]; 22] = [
    b"fmt ", b"data", b"fact", b"LIST", b"JUNK", b"junk", b"PAD ", b"FLLR", b"bext", b"ds64", b"cue ",
    b"smpl", b"inst", b"PEAK", b"id3 ", b"ID3 ", b"iXML", b"axml", b"chna", b"acid", b"plst", b"note",
];

/// Position and format of the samples of a WAV file.
#[derive(Clone, Debug)]
pub(in crate::io) struct WavHeader {
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
    /// The header states no length.
    unknown_size: bool,
}

impl WavHeader {
    pub fn read(source: &mut (impl Read + Seek), len: u64) -> Result<Self, AudioError> {
        let mut format = None;
        let mut data: Option<Data> = None;
        let mut size_64 = None;
        let mut at = 12_u64;
        let mut invalid_chunk = None;
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
                b"ds64" if size_64.is_none() && size >= 24 && body + 24 <= len => {
                    let mut sizes = [0; 16];
                    read_at(source, body, &mut sizes)?;
                    size_64 = sizes[8..].try_into().ok().map(u64::from_le_bytes);
                }
                b"data" if data.is_none() => {
                    let found = data_chunk(source, body, size, size_64, len)?;
                    next = body.saturating_add(found.size);
                    data = Some(found);
                }
                _ => {}
            }
            if next <= len || data.is_some() {
                at = skip_padding(source, next, len)?;
                continue;
            }
            let chunk = String::from_utf8_lossy(id).into_owned();
            invalid_chunk = Some(AudioWarning::InvalidChunkSize { chunk, at, size, available: len - body });
            match find_required_chunk(source, body, len)? {
                Some(found) => at = found,
                None => break,
            }
        }
        let missing = |what: &str| {
            let reason = invalid_chunk.as_ref().map(|chunk| format!("{chunk}; ")).unwrap_or_default();
            AudioError::Malformed { format: "WAV", at: at.min(len), what: format!("{reason}{what}") }
        };
        let format = format
            .ok_or_else(|| missing("there is no \"fmt \" chunk, which states how samples are stored"))?;
        let data = data.ok_or_else(|| missing("there is no \"data\" chunk, which contains the samples"))?;
        let mut header = Self::new(format, &data, len);
        header.warnings.extend(invalid_chunk);
        Ok(header)
    }

    fn new(format: Format, data: &Data, len: u64) -> Self {
        let frame_bytes = (format.container * format.channels) as u64;
        let available = len.saturating_sub(data.start);
        let bytes = if data.unknown_size { available } else { data.size.min(available) };
        let frames = bytes / frame_bytes;
        let mut warnings = Vec::new();
        if data.unknown_size {
            warnings.push(AudioWarning::UnknownLength);
        } else if data.size > available {
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
    size_64: Option<u64>,
    len: u64,
) -> Result<Data, AudioError> {
    let unknown_size = match size {
        // Without a 64-bit size, or with one that was not filled in, as below.
        0xFFFF_FFFF if size_64 == Some(0) => start < len && !begins_chunk(source, start, len)?,
        0xFFFF_FFFF => size_64.is_none(),
        // No samples, or a stream whose writer did not fill in the size: then no chunk follows.
        0 => start < len && !begins_chunk(source, start, len)?,
        _ => false,
    };
    let size = if size == 0xFFFF_FFFF { size_64.unwrap_or(size) } else { size };
    Ok(Data { start, size: if unknown_size { len - start } else { size }, unknown_size })
}

/// The next required chunk after one whose length exceeds the file.
fn find_required_chunk(
    source: &mut (impl Read + Seek),
    from: u64,
    len: u64,
) -> Result<Option<u64>, AudioError> {
    let mut bytes = vec![0; len.saturating_sub(from).min(SEARCH_BYTES) as usize];
    read_at(source, from, &mut bytes)?;
    let required = |id: &[u8]| id == b"fmt " || id == b"data";
    Ok(bytes.windows(4).position(required).map(|k| from + k as u64))
}

/// Offset of the next chunk: after a pad byte if the size is odd, unless the writer omitted it.
fn skip_padding(source: &mut (impl Read + Seek), end: u64, len: u64) -> Result<u64, AudioError> {
    if end.is_multiple_of(2) || end >= len {
        return Ok(end);
    }
    let omitted = begins_chunk(source, end, len)? && !begins_chunk(source, end + 1, len)?;
    Ok(if omitted { end } else { end + 1 })
}

/// Returns true if a common chunk begins at `at`.
fn begins_chunk(source: &mut (impl Read + Seek), at: u64, len: u64) -> Result<bool, AudioError> {
    if at.saturating_add(8) > len {
        return Ok(false);
    }
    let mut id = [0; 4];
    read_at(source, at, &mut id)?;
    Ok(KNOWN_CHUNKS.contains(&&id))
}

fn read_format(source: &mut (impl Read + Seek), at: u64, size: u64) -> Result<Format, AudioError> {
    let malformed = |what: String| AudioError::Malformed { format: "WAV", at, what };
    if size < 16 {
        return Err(malformed(format!("the \"fmt \" chunk has {size} bytes; at least 16 are needed")));
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
        return Err(malformed(format!(
            "{channels} channels at {rate} samples per second; both must be at least 1"
        )));
    }
    // The block size states the width of a container; if it is impossible, the number of bits does.
    let bytes_of_bits = usize::from(bits.div_ceil(8));
    let container = if block.is_multiple_of(channels)
        && block / channels >= bytes_of_bits.max(1)
        && block / channels <= 8
    {
        block / channels
    } else {
        bytes_of_bits
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
