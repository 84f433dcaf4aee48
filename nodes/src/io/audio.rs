//! One reader for every audio format: sniffed by content, exact in length, streaming in constant memory.

use std::io::{Read, Seek, SeekFrom};

use super::packets::Packets;
use super::wav_header::WavHeader;
use super::wav_read::WavReader;
use super::{AudioError, AudioWarning};
use crate::core::files::ReadSeek;
use crate::core::node::Summary;

/// Container and codec of an audio file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileFormat {
    /// RIFF, RF64 or BW64 with linear samples.
    Wav,
    /// Native FLAC.
    Flac,
    /// Vorbis (or FLAC) in Ogg.
    Ogg,
    /// MPEG layer III.
    Mp3,
}

impl FileFormat {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Wav => "WAV",
            Self::Flac => "FLAC",
            Self::Ogg => "Ogg",
            Self::Mp3 => "MP3",
        }
    }
}

/// How samples are stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SampleFormat {
    /// Integers of so many valid bits; value / 2^(bits - 1) is the sample.
    Int {
        /// Valid bits.
        bits: u16,
    },
    /// IEEE floats of so many bits.
    Float {
        /// 32 or 64.
        bits: u16,
    },
    /// A lossy codec, whose decoder gives 32-bit floats.
    Lossy,
}

/// What an audio file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct AudioInfo {
    /// Container and codec.
    pub format: FileFormat,
    /// Samples per second and channel.
    pub rate: u32,
    /// Number of interleaved channels.
    pub channels: usize,
    /// Frames that [`AudioReader::read`] gives, exactly.
    pub frames: u64,
    /// How samples are stored.
    pub sample_format: SampleFormat,
    /// Speaker of each channel as a WAVE channel mask, where the file says so.
    pub channel_mask: Option<u32>,
    /// What is odd about the file. [`AudioReader`] adds corrupt packets as it meets them.
    pub warnings: Vec<AudioWarning>,
}

impl AudioInfo {
    /// What is odd about the file, each after its name.
    pub fn odd<'a>(&'a self, path: &'a str) -> impl Iterator<Item = String> + 'a {
        self.warnings.iter().map(move |warning| format!("{path:?}: {warning}"))
    }

    /// What became odd only while the file was read.
    #[must_use]
    pub fn corrupt(&self) -> Option<&AudioWarning> {
        self.warnings.iter().find(|warning| matches!(warning, AudioWarning::CorruptPackets { .. }))
    }

    /// Bytes of all its samples in memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.frames.saturating_mul(self.channels as u64 * size_of::<f32>() as u64)
    }

    /// Bytes that making something of the whole recording takes at its most: the samples as they are read, by channel, filtered, and
    /// in what is made, five times [`AudioInfo::bytes`] at most by measurement.
    #[must_use]
    pub fn worked(&self) -> u64 {
        self.bytes().saturating_mul(5)
    }

    /// Length in seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.frames as f64 / f64::from(self.rate.max(1))
    }
}

/// Bounds on what a file from a stranger may hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadLimits {
    /// Longest decoded length in seconds.
    pub max_seconds: f64,
    /// Most channels.
    pub max_channels: usize,
    /// Highest rate in samples per second.
    pub max_rate: u32,
}

impl Default for ReadLimits {
    /// A day of sound, 64 channels, 768 kHz.
    fn default() -> Self {
        Self { max_seconds: 86_400.0, max_channels: 64, max_rate: 768_000 }
    }
}

impl ReadLimits {
    pub(super) fn check(&self, rate: u32, channels: usize, frames: u64) -> Result<(), AudioError> {
        let over = |what, found: f64, limit: f64| Err(AudioError::Limit { what, found, limit });
        if channels > self.max_channels {
            return over("channels", channels as f64, self.max_channels as f64);
        }
        if rate > self.max_rate {
            return over("samples per second", f64::from(rate), f64::from(self.max_rate));
        }
        let seconds = frames as f64 / f64::from(rate.max(1));
        if seconds > self.max_seconds {
            return over("seconds", seconds, self.max_seconds);
        }
        Ok(())
    }
}

/// What an audio file holds, by its bytes, under the default limits.
///
/// # Errors
/// As [`AudioReader::open`].
///
/// # Complexity
/// A few reads for WAV; one pass over the packets, without decoding, for the others.
pub fn probe(reader: impl ReadSeek) -> Result<AudioInfo, AudioError> {
    probe_with(reader, ReadLimits::default())
}

/// [`probe`] under given limits.
///
/// # Errors
/// As [`AudioReader::open`].
pub fn probe_with(reader: impl ReadSeek, limits: ReadLimits) -> Result<AudioInfo, AudioError> {
    AudioReader::open_with(Box::new(reader), limits).map(|opened| opened.info().clone())
}

/// Reads an audio file as interleaved 32-bit floats, block by block.
///
/// Integers become value / 2^(bits - 1), so full scale is +-1. For a lossy file the encoder's delay and padding are cut
/// off. Exactly [`AudioInfo::frames`] frames come out: a packet that does not decode becomes silence of its length.
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
    /// be read at all, [`AudioError::Limit`] above the limits.
    ///
    /// # Complexity
    /// As [`probe`].
    pub fn open(source: Box<dyn ReadSeek + 's>) -> Result<Self, AudioError> {
        Self::open_with(source, ReadLimits::default())
    }

    /// Opens a file under given limits.
    ///
    /// # Errors
    /// As [`AudioReader::open`].
    pub fn open_with(mut source: Box<dyn ReadSeek + 's>, limits: ReadLimits) -> Result<Self, AudioError> {
        let len = source.seek(SeekFrom::End(0))?;
        let (format, start) = sniff(&mut source, len)?;
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

    /// What the file holds.
    #[must_use]
    pub fn info(&self) -> &AudioInfo {
        &self.info
    }

    /// The frame that the next [`AudioReader::read`] begins with.
    #[must_use]
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Reads the next frames and returns how many; 0 at the end, and only there.
    ///
    /// # Shapes
    /// `out`: interleaved, a whole number of frames; filled completely except at the end of the file.
    ///
    /// # Errors
    /// [`AudioError::NotFinite`] names the first frame with a NaN or infinity, [`AudioError::PartialFrame`] a buffer
    /// of the wrong length, [`AudioError::Io`] a source that fails.
    pub fn read(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
        let channels = self.info.channels;
        if !out.len().is_multiple_of(channels) {
            return Err(AudioError::PartialFrame { len: out.len(), channels });
        }
        let left = self.info.frames - self.position;
        let frames = ((out.len() / channels) as u64).min(left) as usize;
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

    /// Reads the rest as the mean of its channels.
    ///
    /// Whoever calls this has looked at the length.
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

    /// Moves to `frame`; what is read there equals what a read from the start gives, bit for bit.
    ///
    /// # Errors
    /// [`AudioError::SeekBehindEnd`] (the end itself is allowed).
    ///
    /// # Complexity
    /// O(1) for WAV. The others walk the packets from the current frame (backwards: from the start) and decode only as
    /// many as their codec needs to reach the same state.
    pub fn seek(&mut self, frame: u64) -> Result<(), AudioError> {
        if frame > self.info.frames {
            return Err(AudioError::SeekBehindEnd { frame, frames: self.info.frames });
        }
        if let Samples::Packets(packets) = &mut self.samples {
            packets.seek(frame)?;
        }
        self.position = frame;
        Ok(())
    }
}

/// Share of the power of a recording in its mean, above which it is said.
const CONSTANT: f64 = 0.1;

/// What is odd about a recording once it has been read: packets that do not decode, and a part that does not move.
pub(crate) fn oddities(path: &str, info: &AudioInfo, samples: &[f32]) -> Summary {
    let n = samples.len().max(1) as f64;
    let mean = samples.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
    let power = samples.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>() / n;
    let share = if power > 0.0 { mean * mean / power } else { 0.0 };
    let constant = (share > CONSTANT).then(|| {
        let percent = 100.0 * share;
        format!(
            "{path:?}: {percent:.0} % of its power is a constant of {mean:.3}, which nobody hears but everything here measures: \
             take it out first (remove DC)"
        )
    });
    let corrupt = info.corrupt().map(|warning| format!("{path:?}: {warning}"));
    corrupt.into_iter().chain(constant).map(|text| ("warning", text.into())).collect()
}

pub(super) fn check_finite(samples: &[f32], channels: usize, first: u64) -> Result<(), AudioError> {
    match samples.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(at) => Err(AudioError::NotFinite {
            frame: first + (at / channels) as u64,
            channel: at % channels,
            value: f64::from(samples[at]),
        }),
    }
}

/// The format and the byte at which it begins (behind ID3v2 tags).
fn sniff(source: &mut (impl Read + Seek), len: u64) -> Result<(FileFormat, u64), AudioError> {
    let mut start = 0;
    let mut head = head_at(source, start)?;
    let mut tagged = false;
    // An ID3v2 size has four bytes of seven bits and leaves out the header of ten bytes and a footer of ten.
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

fn head_at(source: &mut (impl Read + Seek), at: u64) -> Result<Vec<u8>, AudioError> {
    source.seek(SeekFrom::Start(at))?;
    let mut head = Vec::with_capacity(12);
    source.by_ref().take(12).read_to_end(&mut head)?;
    Ok(head)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_and_lost_packets_are_told_of_a_recording() {
        let info = AudioInfo {
            format: FileFormat::Flac,
            rate: 8000,
            channels: 1,
            frames: 4,
            sample_format: SampleFormat::Int { bits: 16 },
            channel_mask: None,
            warnings: vec![AudioWarning::NoEnd],
        };
        let texts = |info: &AudioInfo, samples: &[f32]| -> Vec<String> {
            oddities("a.flac", info, samples).iter().map(|(_, text)| text.to_string()).collect()
        };
        assert!(texts(&info, &[0.5, -0.5, 0.5, -0.4]).is_empty());
        assert!(texts(&info, &[]).is_empty() && texts(&info, &[0.0; 4]).is_empty());
        let told = texts(&info, &[0.3, 0.3, 0.3, 0.3]);
        assert!(told.len() == 1 && told[0].contains("100 %") && told[0].contains("0.300"), "{told:?}");
        let lost = AudioInfo { warnings: vec![AudioWarning::CorruptPackets { packets: 2 }], ..info };
        let told = texts(&lost, &[0.5, -0.5]);
        assert!(told.len() == 1 && told[0].contains("2 packets"), "{told:?}");
        assert_eq!(lost.odd("a.flac").count(), 1);
    }
}
