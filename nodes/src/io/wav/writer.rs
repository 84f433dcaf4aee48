//! A writer of WAV files whose bits do not depend on the block size.
//!
//! The file begins with a `JUNK` chunk of the size of a `ds64` chunk. If the samples exceed the 32-bit limit of RIFF,
//! finishing replaces it by a `ds64` chunk and the file becomes RF64.
//!
//! The writer does not use `hound`, since the writer of `hound` has no room before its `fmt ` chunk and counts bytes in
//! 32 bits, which excludes RF64. It sets the lowest bits of the channel mask for any speakers (mono would be front left).
//! It writes no `fact` chunk for floats. An unfinished file states that it is empty. The tests read the files with `hound`.

use std::io::{Seek, SeekFrom, Write};

use crate::core::fault::Fault;
use crate::core::random::Random;
use crate::core::state::{StateArchive, Stateful, archive_position};
use crate::io::AudioError;
use crate::io::info::check_finite;

/// Samples per encoded block.
const BLOCK: usize = 8192;
/// Body of a `ds64` chunk without a table.
const DS64: u32 = 28;
/// Size from which a RIFF file becomes RF64.
const RIFF_LIMIT: u64 = 0xFFFF_FFFF;

/// Format of the stored samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteFormat {
    /// 16-bit linear.
    Pcm16,
    /// 24-bit linear.
    Pcm24,
    /// 32-bit float, without rounding or clipping.
    Float32,
}

impl WriteFormat {
    const fn bytes(self) -> u32 {
        match self {
            Self::Pcm16 => 2,
            Self::Pcm24 => 3,
            Self::Float32 => 4,
        }
    }
}

/// Rounding of samples to integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dither {
    /// Rounding to the nearest integer, for samples that are already quantised.
    None,
    /// Triangular noise of +-1 step, which makes mean and variance of the error independent of the signal.
    ///
    /// The noise is a function of seed, channel and frame.
    ///
    /// # Source
    /// Lipshitz, Wannamaker and Vanderkooy, "Quantization and Dither: A Theoretical Survey" (JAES 40(5), 1992).
    Triangular(Random),
}

/// Format of a file to write.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriteSpec {
    /// Samples per second.
    pub rate: u32,
    /// Interleaved channels.
    pub channels: usize,
    /// Format of the stored samples.
    pub format: WriteFormat,
    /// Dither of integer samples; unused for floats.
    pub dither: Dither,
    /// Channel mask; `None` for the standard speakers of 1 to 8 channels, and no speakers for more.
    pub channel_mask: Option<u32>,
}

impl WriteSpec {
    /// A file with dither of seed 0 and the standard speakers.
    #[must_use]
    pub fn new(rate: u32, channels: usize, format: WriteFormat) -> Self {
        let dither = Dither::Triangular(Random::new(0, "dither"));
        Self { rate, channels, format, dither, channel_mask: None }
    }
}

/// Statistics of a written file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrittenInfo {
    /// Samples per second.
    pub rate: u32,
    /// Frames.
    pub frames: u64,
    /// Largest magnitude before clipping.
    pub peak: f32,
    /// Root mean square of all samples before clipping.
    pub rms: f64,
    /// Number of samples outside of +-1, which integer formats clip.
    pub clipped: u64,
}

/// Writes interleaved floats as a WAV file.
///
/// [`AudioWriter::finish`] writes the lengths into the header. The header of an unfinished file states no length.
pub struct AudioWriter<W> {
    sink: W,
    spec: WriteSpec,
    riff_limit: u64,
    frames: u64,
    peak: f32,
    sum_squares: f64,
    clipped: u64,
    bytes: Vec<u8>,
    /// Offset of the size in the header of the `data` chunk.
    data_size_at: u64,
    fact_at: Option<u64>,
}

impl<W: Write + Seek> Stateful for AudioWriter<W> {
    /// The samples written so far are in the sink; a resumed run continues with the same sink.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        archive_position(&mut self.sink, archive)?;
        self.frames.archive_state(archive)?;
        self.peak.archive_state(archive)?;
        self.sum_squares.archive_state(archive)?;
        self.clipped.archive_state(archive)
    }
}

impl<W: Write + Seek> AudioWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// [`AudioError::WriteSpec`] for rates or channel counts that do not fit a WAV header.
    pub fn new(sink: W, spec: WriteSpec) -> Result<Self, AudioError> {
        Self::with_riff_limit(sink, spec, RIFF_LIMIT)
    }

    /// [`AudioWriter::new`] with another size from which the file becomes RF64.
    ///
    /// # Errors
    /// As [`AudioWriter::new`].
    pub fn with_riff_limit(sink: W, spec: WriteSpec, riff_limit: u64) -> Result<Self, AudioError> {
        let invalid = |what, found, wanted| Err(AudioError::WriteSpec { what, found, wanted });
        let frame_bytes = spec.format.bytes() as usize * spec.channels;
        if spec.channels == 0 || frame_bytes > usize::from(u16::MAX) {
            return invalid("channels", spec.channels as u64, "1 to 65535 bytes per frame fit a WAV header");
        }
        if spec.rate == 0 || u64::from(spec.rate) * frame_bytes as u64 > u64::from(u32::MAX) {
            return invalid("rate", u64::from(spec.rate), "1 to 2^32 bytes per second fit a WAV header");
        }
        let bytes = Vec::with_capacity(BLOCK * spec.format.bytes() as usize);
        let mut writer = Self {
            sink,
            spec,
            riff_limit: riff_limit.min(RIFF_LIMIT),
            frames: 0,
            peak: 0.0,
            sum_squares: 0.0,
            clipped: 0,
            bytes,
            data_size_at: 0,
            fact_at: None,
        };
        writer.write_header()?;
        Ok(writer)
    }

    fn write_header(&mut self) -> Result<(), AudioError> {
        let spec = self.spec;
        let float = spec.format == WriteFormat::Float32;
        let sample_bytes = spec.format.bytes();
        let frame_bytes = sample_bytes * spec.channels as u32;
        let extensible =
            spec.channels > 2 || spec.format == WriteFormat::Pcm24 || spec.channel_mask.is_some();
        let tag: u16 = if float { 3 } else { 1 };

        let mut h = Vec::with_capacity(128);
        h.extend(b"RIFF\xFF\xFF\xFF\xFFWAVEJUNK");
        h.extend(DS64.to_le_bytes());
        h.extend([0; DS64 as usize]);
        h.extend(b"fmt ");
        h.extend((if extensible { 40_u32 } else { 16 }).to_le_bytes());
        h.extend((if extensible { 0xFFFE } else { tag }).to_le_bytes());
        h.extend((spec.channels as u16).to_le_bytes());
        h.extend(spec.rate.to_le_bytes());
        h.extend((spec.rate * frame_bytes).to_le_bytes());
        h.extend((frame_bytes as u16).to_le_bytes());
        h.extend((8 * sample_bytes as u16).to_le_bytes());
        if extensible {
            h.extend(22_u16.to_le_bytes());
            h.extend((8 * sample_bytes as u16).to_le_bytes());
            h.extend(spec.channel_mask.unwrap_or_else(|| standard_mask(spec.channels)).to_le_bytes());
            h.extend(tag.to_le_bytes());
            // The rest of every KSDATAFORMAT_SUBTYPE identifier.
            h.extend([0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0, 0x38, 0x9B, 0x71]);
        }
        if float {
            h.extend(b"fact\x04\0\0\0");
            self.fact_at = Some(h.len() as u64);
            h.extend([0xFF; 4]);
        }
        h.extend(b"data");
        self.data_size_at = h.len() as u64;
        h.extend([0xFF; 4]);
        self.sink.write_all(&h)?;
        Ok(())
    }

    /// Appends frames.
    ///
    /// # Shapes
    /// `samples`: interleaved, any integer number of frames.
    ///
    /// # Errors
    /// [`AudioError::NotFinite`] before anything of this call is written, [`AudioError::PartialFrame`] and
    /// [`AudioError::Io`].
    pub fn write(&mut self, samples: &[f32]) -> Result<(), AudioError> {
        let channels = self.spec.channels;
        if !samples.len().is_multiple_of(channels) {
            return Err(AudioError::PartialFrame { len: samples.len(), channels });
        }
        check_finite(samples, channels, self.frames)?;
        let (mut frame, mut channel) = (self.frames, 0);
        for block in samples.chunks(BLOCK) {
            self.bytes.clear();
            for &x in block {
                self.peak = self.peak.max(x.abs());
                self.sum_squares += f64::from(x) * f64::from(x);
                self.clipped += u64::from(x.abs() > 1.0);
                self.push(x, frame, channel);
                channel += 1;
                if channel == channels {
                    (frame, channel) = (frame + 1, 0);
                }
            }
            self.sink.write_all(&self.bytes)?;
        }
        self.frames = frame;
        Ok(())
    }

    fn push(&mut self, x: f32, frame: u64, channel: usize) {
        let full = match self.spec.format {
            WriteFormat::Pcm16 => 32_768.0,
            WriteFormat::Pcm24 => 8_388_608.0,
            WriteFormat::Float32 => return self.bytes.extend(x.to_le_bytes()),
        };
        let noise = match self.spec.dither {
            Dither::None => 0.0,
            Dither::Triangular(random) => {
                let w = random.words(channel as u32, frame, 0);
                (f64::from(w[0]) + f64::from(w[1])) / 4_294_967_296.0 - 1.0
            }
        };
        let step = (f64::from(x) * full + noise).round_ties_even().clamp(-full, full - 1.0) as i32;
        self.bytes.extend(&step.to_le_bytes()[..self.spec.format.bytes() as usize]);
    }

    /// Writes the lengths into the header and returns the statistics of the file.
    ///
    /// # Errors
    /// [`AudioError::Io`].
    pub fn finish(mut self) -> Result<WrittenInfo, AudioError> {
        let data = self.frames * u64::from(self.spec.format.bytes()) * self.spec.channels as u64;
        if data % 2 == 1 {
            self.sink.write_all(&[0])?;
        }
        self.write_lengths()
    }

    fn write_lengths(mut self) -> Result<WrittenInfo, AudioError> {
        let data = self.frames * u64::from(self.spec.format.bytes()) * self.spec.channels as u64;
        let data_start = self.data_size_at + 4;
        let riff = data_start + data + data % 2 - 8;
        if riff < self.riff_limit {
            self.patch(4, &(riff as u32).to_le_bytes())?;
            self.patch(self.data_size_at, &(data as u32).to_le_bytes())?;
            if let Some(at) = self.fact_at {
                self.patch(at, &(self.frames as u32).to_le_bytes())?;
            }
        } else {
            // The 32-bit sizes are already -1, which refers readers to the `ds64` chunk.
            self.patch(0, b"RF64")?;
            let mut ds64 = b"ds64".to_vec();
            ds64.extend(DS64.to_le_bytes());
            ds64.extend(riff.to_le_bytes());
            ds64.extend(data.to_le_bytes());
            ds64.extend(self.frames.to_le_bytes());
            self.patch(12, &ds64)?;
        }
        self.sink.seek(SeekFrom::End(0))?;
        self.sink.flush()?;
        let samples = self.frames as f64 * self.spec.channels as f64;
        let rms = if samples > 0.0 { (self.sum_squares / samples).sqrt() } else { 0.0 };
        Ok(WrittenInfo {
            rate: self.spec.rate,
            frames: self.frames,
            peak: self.peak,
            rms,
            clipped: self.clipped,
        })
    }

    /// Ends a file after a write that failed: the header states the whole frames that the sink holds.
    ///
    /// The sink must not hold back bytes, as a buffer does, and must have room for the header that is there already. The levels are
    /// those of all samples that were to be written.
    ///
    /// # Errors
    /// [`AudioError::Io`].
    pub fn finish_cut(mut self) -> Result<WrittenInfo, AudioError> {
        let end = self.sink.seek(SeekFrom::End(0))?;
        let frame_bytes = u64::from(self.spec.format.bytes()) * self.spec.channels as u64;
        let data = end.saturating_sub(self.data_size_at + 4);
        self.frames = data / frame_bytes;
        // A chunk of odd size needs a byte of padding.
        if self.frames * frame_bytes == data && data % 2 == 1 {
            self.frames = self.frames.saturating_sub(1);
        }
        self.write_lengths()
    }

    fn patch(&mut self, at: u64, bytes: &[u8]) -> Result<(), AudioError> {
        self.sink.seek(SeekFrom::Start(at))?;
        self.sink.write_all(bytes)?;
        Ok(())
    }
}

/// Channel masks of the standard layouts: mono, stereo, 3.0, quad, 5.0, 5.1, 6.1 and 7.1.
const fn standard_mask(channels: usize) -> u32 {
    match channels {
        1 => 0x4,
        2 => 0x3,
        3 => 0x7,
        4 => 0x33,
        5 => 0x37,
        6 => 0x3F,
        7 => 0x70F,
        8 => 0x63F,
        _ => 0,
    }
}
