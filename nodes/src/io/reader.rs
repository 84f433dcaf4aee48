//! One reader for all audio formats: detection by content, exact length, constant memory.

use std::io::{Read, Seek, SeekFrom};

use super::info::{AudioInfo, FileFormat, ReadLimits, check_finite};
#[cfg(feature = "flac")]
use super::packets::Packets;
use super::wav::{WavHeader, WavReader};
#[cfg(not(feature = "flac"))]
use super::without_packets::Packets;
use super::{AudioError, ReadSeek};

/// Reads the format and length of an audio file under the default limits.
///
/// # Errors
/// As [`AudioReader::open`].
///
/// # Complexity
/// A few reads for WAV; one pass over the packets, without decoding, for the others.
pub fn probe(reader: impl ReadSeek) -> Result<AudioInfo, AudioError> {
    probe_with(reader, ReadLimits::default())
}

/// [`probe`] with other limits.
///
/// # Errors
/// As [`AudioReader::open`].
pub fn probe_with(reader: impl ReadSeek, limits: ReadLimits) -> Result<AudioInfo, AudioError> {
    AudioReader::open_with(Box::new(reader), limits).map(|opened| opened.info().clone())
}

/// Reads an audio file as interleaved 32-bit floats, block by block.
///
/// Integers become value / 2^(bits - 1), so that full scale is +-1. The encoder delay and padding of a lossy file are
/// removed. The reader returns exactly [`AudioInfo::frames`] frames: a packet that does not decode is silence.
///
/// # Example
/// ```
/// use foley_nodes::io::{AudioReader, AudioWriter, WriteFormat, WriteSpec};
/// use std::io::Cursor;
///
/// let mut file = Cursor::new(Vec::new());
/// let mut writer = AudioWriter::new(&mut file, WriteSpec::new(48_000, 1, WriteFormat::Float32))?;
/// writer.write(&[0.25, -0.5])?;
/// writer.finish()?;
///
/// let mut reader = AudioReader::open(Box::new(file))?;
/// let mut samples = [0.0; 16];
/// assert_eq!(reader.read(&mut samples)?, 2);
/// assert_eq!(samples[..2], [0.25, -0.5]);
/// # Ok::<(), foley_nodes::io::AudioError>(())
/// ```
pub struct AudioReader<'s> {
    info: AudioInfo,
    position: u64,
    samples: Samples<'s>,
}

enum Samples<'s> {
    Wav(WavReader<'s>),
    Packets(Box<Packets<'s>>),
}

impl<'s> AudioReader<'s> {
    /// Opens a file under the default limits.
    ///
    /// # Errors
    /// [`AudioError::UnknownFormat`], [`AudioError::Unsupported`] and [`AudioError::Malformed`] for files that cannot
    /// be read, [`AudioError::Limit`] above the limits.
    ///
    /// # Complexity
    /// As [`probe`].
    pub fn open(source: Box<dyn ReadSeek + 's>) -> Result<Self, AudioError> {
        Self::open_with(source, ReadLimits::default())
    }

    /// Opens a file with other limits.
    ///
    /// # Errors
    /// As [`AudioReader::open`].
    pub fn open_with(mut source: Box<dyn ReadSeek + 's>, limits: ReadLimits) -> Result<Self, AudioError> {
        let len = source.seek(SeekFrom::End(0))?;
        let (format, start) = detect_format(&mut source, len)?;
        let (info, samples) = if format == FileFormat::Wav {
            let header = WavHeader::read(&mut source, len)?;
            limits.check(header.rate, header.channels, header.frames)?;
            let (info, wav) = WavReader::new(source, header)?;
            (info, Samples::Wav(wav))
        } else {
            let (info, packets) = Packets::open(source, start, len, format, &limits)?;
            (info, Samples::Packets(Box::new(packets)))
        };
        Ok(Self { info, position: 0, samples })
    }

    /// Format and length of the file.
    #[must_use]
    pub fn info(&self) -> &AudioInfo {
        &self.info
    }

    /// First frame of the next [`AudioReader::read`].
    #[must_use]
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Reads the next frames and returns their number; 0 only at the end.
    ///
    /// # Shapes
    /// `out`: interleaved, an integer number of frames; filled completely except at the end of the file.
    ///
    /// # Errors
    /// [`AudioError::NotFinite`] names the first frame with a NaN or infinity, [`AudioError::PartialFrame`] a buffer
    /// of the wrong length, [`AudioError::Io`] a source that fails.
    pub fn read(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
        let channels = self.info.channels;
        if !out.len().is_multiple_of(channels) {
            return Err(AudioError::PartialFrame { len: out.len(), channels });
        }
        let remaining = self.info.frames - self.position;
        let frames = ((out.len() / channels) as u64).min(remaining) as usize;
        let out = &mut out[..frames * channels];
        match &mut self.samples {
            Samples::Wav(wav) => wav.read(self.position, out)?,
            Samples::Packets(packets) => {
                packets.read(out);
                packets.report_corrupt(&mut self.info.warnings);
            }
        }
        check_finite(out, channels, self.position)?;
        self.position += frames as u64;
        Ok(frames)
    }

    /// Reads the remaining frames as the mean of their channels.
    ///
    /// The caller limits the length.
    ///
    /// # Errors
    /// As [`AudioReader::read`].
    pub fn read_mono(&mut self) -> Result<Vec<f32>, AudioError> {
        let channels = self.info.channels.max(1);
        let mut block = vec![0.0; 4096 * channels];
        let mut samples = Vec::new();
        loop {
            let frames = self.read(&mut block)?;
            if frames == 0 {
                return Ok(samples);
            }
            let start = samples.len();
            samples.resize(start + frames, 0.0);
            crate::dsp::channel_mean(&block[..frames * channels], channels, &mut samples[start..]);
        }
    }

    /// Moves to `frame`; the samples read there are bit for bit those of a read from the start.
    ///
    /// # Errors
    /// [`AudioError::SeekPastEnd`]; the end itself is a valid position.
    ///
    /// # Complexity
    /// O(1) for WAV. The other formats step through the packets from the current frame (backwards: from the start) and
    /// decode only the packets that their codec needs to reach the same state.
    pub fn seek(&mut self, frame: u64) -> Result<(), AudioError> {
        if frame > self.info.frames {
            return Err(AudioError::SeekPastEnd { frame, frames: self.info.frames });
        }
        if let Samples::Packets(packets) = &mut self.samples {
            packets.seek(frame)?;
        }
        self.position = frame;
        Ok(())
    }
}

/// The format and the offset of its first byte, after ID3v2 tags.
fn detect_format(source: &mut (impl Read + Seek), len: u64) -> Result<(FileFormat, u64), AudioError> {
    let mut start = 0;
    let mut head = head_at(source, start)?;
    let mut tagged = false;
    // An ID3v2 size has four bytes of 7 bits and excludes the header of 10 bytes and the optional footer of 10 bytes.
    while head.len() >= 10 && head.starts_with(b"ID3") && start < len {
        let size = head[6..10].iter().fold(0_u64, |size, &b| (size << 7) | u64::from(b & 0x7F));
        start += 10 + size + if head[5] & 0x10 != 0 { 10 } else { 0 };
        tagged = true;
        head = head_at(source, start.min(len))?;
    }
    let unsupported = |found: &str| {
        Err(AudioError::Unsupported {
            found: found.into(),
            wanted: "convert it to WAV, FLAC, Ogg Vorbis or MP3",
        })
    };
    match head.as_slice() {
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'A', b'V', b'E', ..]
        | [b'R', b'F', b'6', b'4', _, _, _, _, b'W', b'A', b'V', b'E', ..]
        | [b'B', b'W', b'6', b'4', _, _, _, _, b'W', b'A', b'V', b'E', ..] => Ok((FileFormat::Wav, 0)),
        [b'f', b'L', b'a', b'C', ..] => Ok((FileFormat::Flac, start)),
        [b'O', b'g', b'g', b'S', ..] => Ok((FileFormat::Ogg, start)),
        [b'R', b'I', b'F', b'X', ..] => unsupported("big-endian WAV (RIFX)"),
        [b'F', b'O', b'R', b'M', ..] => unsupported("AIFF"),
        [b'c', b'a', b'f', b'f', ..] => unsupported("Core Audio Format"),
        [_, _, _, _, b'f', b't', b'y', b'p', ..] => unsupported("MPEG-4 audio"),
        [b'w', b'v', b'p', b'k', ..] => unsupported("WavPack"),
        // Sync word, then layer III (bits 01).
        [0xFF, b, ..] if b & 0xE6 == 0xE2 => Ok((FileFormat::Mp3, start)),
        _ if tagged => Ok((FileFormat::Mp3, start.min(len))),
        [] => Err(AudioError::UnknownFormat { found: "nothing (it is empty)".into() }),
        other => {
            let text = other[..other.len().min(8)].escape_ascii().to_string();
            Err(AudioError::UnknownFormat { found: format!("\"{text}\"") })
        }
    }
}

fn head_at(source: &mut (impl Read + Seek), offset: u64) -> Result<Vec<u8>, AudioError> {
    source.seek(SeekFrom::Start(offset))?;
    let mut head = Vec::with_capacity(12);
    source.by_ref().take(12).read_to_end(&mut head)?;
    Ok(head)
}
