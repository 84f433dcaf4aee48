//! Packet formats (FLAC, Ogg Vorbis, MP3) on a timeline of frames that is exact before the first one is decoded.
//!
//! Decoding is by `symphonia`; its own trimming is off, because for MP3 without a LAME tag it cuts at an *estimated*
//! length. Opening walks all packets once without decoding and so knows how many frames there are. Every packet is
//! then laid down at its timestamp: gaps and packets that do not decode are silence, overlaps are dropped.
//!
//! `symphonia` 0.6 still panics on some broken headers (sums that overflow); every call into it is guarded, so that a panic
//! is an error or a corrupt packet like any other. A build with `panic = "abort"` loses that guard.
//!
//! Limit: `symphonia` numbers on after an Ogg page or an MP3 packet whose frame it cannot find at all, so what follows
//! moves forward in time; where the container states a length, a warning says that frames are missing.

use std::io::{self, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;

use symphonia::core::codecs::audio::{AudioDecoder, AudioDecoderOptions};
use symphonia::core::errors::Error as CodecError;
use symphonia::core::formats::{FormatOptions, FormatReader, TrackType};
use symphonia::core::io::{MediaSource, MediaSourceStream, MediaSourceStreamOptions};
use symphonia::core::packet::Packet;
use symphonia::default::{formats, get_codecs};

use super::audio::{AudioInfo, FileFormat, ReadLimits, SampleFormat};
use super::{AudioError, AudioWarning};
use crate::core::files::ReadSeek;

/// Errors in a row after which a stream counts as ended.
const MAX_ERRORS: u32 = 256;
/// Header, 255 segment lengths and 255 segments of 255 bytes.
const LARGEST_OGG_PAGE: u64 = 65_307;

/// The part of a source from `start` on, shared with `symphonia`.
///
/// `symphonia` wants a `Sync` source and never shares it: the mutex is there for the type and never locked.
struct Source<'s> {
    inner: Mutex<Box<dyn ReadSeek + 's>>,
    start: u64,
    len: u64,
}

impl<'s> Source<'s> {
    fn inner(&mut self) -> &mut (dyn ReadSeek + 's) {
        self.inner.get_mut().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Read for Source<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.inner().read(out)
    }
}

impl Seek for Source<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let start = self.start;
        let to = match to {
            SeekFrom::Start(at) => SeekFrom::Start(start.saturating_add(at)),
            relative => relative,
        };
        Ok(self.inner().seek(to)?.saturating_sub(start))
    }
}

impl MediaSource for Source<'_> {
    fn is_seekable(&self) -> bool {
        true
    }

    fn byte_len(&self) -> Option<u64> {
        Some(self.len)
    }
}

/// What the walk over all packets found.
#[derive(Clone, Copy, Debug, Default)]
struct Timeline {
    /// Timestamp of frame 0.
    origin: i64,
    frames: u64,
    /// Packets of another stream were there.
    extra: bool,
    /// Another stream begins behind the last packet, with headers of its own.
    chained: bool,
}

/// A packet's place on the timeline.
struct Place {
    /// May lie before 0: encoder delay.
    start: i64,
    frames: u64,
}

/// An open packet stream.
pub(super) struct Packets<'s> {
    /// Gone only if a rewind failed.
    demuxer: Option<Box<dyn FormatReader + 's>>,
    decoder: Box<dyn AudioDecoder>,
    format: FileFormat,
    track: u32,
    rate: u32,
    channels: usize,
    timeline: Timeline,
    /// Next frame to be given out.
    position: u64,
    /// Next frame that the demuxer may give.
    walked: i64,
    /// Missing frames before the decoded ones: a count, so that a far timestamp costs no memory.
    silence: u64,
    /// Decoded samples from `used` on belong to `position` and the silence on.
    decoded: Vec<f32>,
    used: usize,
    ended: bool,
    corrupt: u64,
    /// Frames before this one have been looked at for corrupt packets: reading them again counts nothing twice.
    counted: i64,
}

impl<'s> Packets<'s> {
    pub fn open(
        mut source: Box<dyn ReadSeek + 's>,
        start: u64,
        len: u64,
        format: FileFormat,
        limits: &ReadLimits,
    ) -> Result<(AudioInfo, Self), AudioError> {
        let last_page = if format == FileFormat::Ogg { last_page(&mut source, start, len)? } else { None };
        source.seek(SeekFrom::Start(start))?;
        let source = Source { inner: Mutex::new(source), start, len: len - start };
        let stream = MediaSourceStream::new(Box::new(source), MediaSourceStreamOptions::default());
        let mut demuxer = demux(format, stream)?;
        let broken =
            |what: &str| AudioError::Malformed { format: format.name(), at: start, what: what.into() };
        let track = demuxer
            .default_track(TrackType::Audio)
            .ok_or_else(|| broken("it holds no audio stream"))?
            .clone();
        let params = track.codec_params.as_ref().and_then(|p| p.audio());
        let params = params.ok_or_else(|| broken("its codec parameters are missing"))?;
        let rate = params.sample_rate.filter(|&r| r > 0).ok_or_else(|| broken("its rate is missing"))?;
        let channels = params.channels.as_ref().map_or(0, |c| c.count());
        if channels == 0 {
            return Err(broken("its number of channels is missing"));
        }
        limits.check(rate, channels, 0)?;
        let options = AudioDecoderOptions::default().gapless(false);
        let decoder =
            get_codecs().make_audio_decoder(params, &options).map_err(|e| codec_error(format, e))?;
        let sample_format = match (format, params.bits_per_sample) {
            (FileFormat::Flac, Some(bits)) => SampleFormat::Int { bits: bits as u16 },
            _ => SampleFormat::Lossy,
        };

        let (mut timeline, blocks) = walk(&mut *demuxer, track.id, format, rate);
        let mut warnings = Vec::new();
        // Without a LAME tag `symphonia` estimates the length of an MP3 from its first frames: no promise to check.
        let tagged = format != FileFormat::Mp3 || track.delay.is_some();
        let promised = match last_page {
            Some(_) if timeline.chained => None,
            Some(granule) => Some(granule.saturating_sub_unsigned(timeline.origin as u64).max(0) as u64),
            None => track.num_frames.filter(|&n| n > 0 && tagged && format != FileFormat::Ogg),
        };
        if format == FileFormat::Mp3 && track.delay.is_some() {
            let block = mp3_block(rate);
            let gaps = u64::from(track.delay.unwrap_or(0)) + u64::from(track.padding.unwrap_or(0));
            // A stream that was cut short has lost its padding with its last packets.
            if promised.is_some_and(|n| blocks * block >= n + gaps) {
                timeline.frames = timeline.frames.saturating_sub(u64::from(track.padding.unwrap_or(0)));
            }
        }
        let frames = timeline.frames;
        if let Some(header_frames) = promised.filter(|&n| n != frames) {
            warnings.push(AudioWarning::LengthDiffers { header_frames, frames, rate });
        }
        if format == FileFormat::Ogg && last_page.is_none() {
            warnings.push(AudioWarning::NoEnd);
        }
        if timeline.extra {
            warnings.push(AudioWarning::ExtraStream);
        }
        if timeline.chained {
            warnings.push(AudioWarning::Chained { frames, rate });
        }
        limits.check(rate, channels, frames)?;
        let info = AudioInfo { format, rate, channels, frames, sample_format, channel_mask: None, warnings };
        let mut packets = Self {
            demuxer: Some(demuxer),
            decoder,
            format,
            track: track.id,
            rate,
            channels,
            timeline,
            position: 0,
            walked: i64::MIN,
            silence: 0,
            decoded: Vec::new(),
            used: 0,
            ended: false,
            corrupt: 0,
            counted: i64::MIN,
        };
        packets.rewind()?;
        Ok((info, packets))
    }

    pub fn report_corrupt(&self, warnings: &mut Vec<AudioWarning>) {
        if self.corrupt == 0 {
            return;
        }
        let packets = self.corrupt;
        match warnings.iter_mut().find(|w| matches!(w, AudioWarning::CorruptPackets { .. })) {
            Some(AudioWarning::CorruptPackets { packets: known }) => *known = (*known).max(packets),
            _ => warnings.push(AudioWarning::CorruptPackets { packets }),
        }
    }

    /// Fills `out`; the caller asks for no frame behind the end.
    pub fn read(&mut self, mut out: &mut [f32]) {
        while !out.is_empty() {
            if self.silence == 0 && self.used == self.decoded.len() {
                self.refill(0);
            }
            if self.silence > 0 {
                let frames = self.silence.min((out.len() / self.channels) as u64);
                let (now, later) = out.split_at_mut(frames as usize * self.channels);
                now.fill(0.0);
                self.silence -= frames;
                self.position += frames;
                out = later;
                continue;
            }
            let n = (self.decoded.len() - self.used).min(out.len());
            if n == 0 {
                // The stream ended early on this walk: the promise of the first walk is kept with silence.
                out.fill(0.0);
                self.position += (out.len() / self.channels) as u64;
                return;
            }
            let (now, later) = out.split_at_mut(n);
            now.copy_from_slice(&self.decoded[self.used..self.used + n]);
            self.used += n;
            self.position += (n / self.channels) as u64;
            out = later;
        }
    }

    pub fn seek(&mut self, frame: u64) -> Result<(), AudioError> {
        if frame == self.position {
            return Ok(());
        }
        // What a packet's samples depend on: FLAC on itself; Vorbis on the block before (at most 8192 frames);
        // MP3 on up to 511 bytes of earlier packets (under 48 of the smallest) and two filter banks.
        let memory = match self.format {
            FileFormat::Mp3 => 64 * 1152,
            FileFormat::Ogg => 32_768,
            _ => 0,
        };
        let from = frame.saturating_sub(memory);
        if self.walked > from as i64 {
            self.rewind()?;
        }
        self.reset_decoder();
        self.position = frame;
        self.refill(from);
        Ok(())
    }

    fn reset_decoder(&mut self) {
        let decoder = &mut self.decoder;
        // A decoder that cannot even reset fails on its next packet.
        let _ = guarded(|| decoder.reset());
    }

    /// Starts the demuxer over.
    fn rewind(&mut self) -> Result<(), AudioError> {
        let lost = || AudioError::Io(io::Error::other("the stream was lost by an earlier failure"));
        let mut stream = self.demuxer.take().ok_or_else(lost)?.into_inner();
        stream.seek(SeekFrom::Start(0))?;
        self.demuxer = Some(demux(self.format, stream)?);
        self.reset_decoder();
        self.walked = i64::MIN;
        self.ended = false;
        Ok(())
    }

    /// Decodes until samples for `position` are there or the stream ends; packets that end before `from` are skipped.
    fn refill(&mut self, from: u64) {
        self.silence = 0;
        self.decoded.clear();
        self.used = 0;
        while self.decoded.is_empty() && !self.ended {
            let Some(Ok(packet)) = self.demuxer.as_mut().map(|d| next_packet(&mut **d, self.track)) else {
                self.ended = true;
                return;
            };
            let place = place(&packet, self.format, self.rate, self.timeline.origin);
            let end = place.start.saturating_add_unsigned(place.frames);
            let gap = place.start > self.walked.max(0);
            self.walked = self.walked.max(end);
            if end > from as i64 || from == 0 {
                self.lay_down(&packet, &place, gap);
            }
        }
    }

    /// Decodes one packet and keeps what lies at and behind `position`, with silence before it where packets are missing.
    fn lay_down(&mut self, packet: &Packet, place: &Place, gap: bool) {
        let position = self.position as i64;
        let channels = self.channels;
        let decoder = &mut self.decoder;
        let decoded = guarded(|| decoder.decode(packet)).unwrap_or(Err(PANICKED));
        let good = match decoded {
            Ok(audio) if audio.num_planes() == channels && audio.spec().rate() == self.rate => {
                audio.copy_to_vec_interleaved(&mut self.decoded);
                true
            }
            _ => false,
        };
        if !good {
            self.decoded.clear();
        }
        if place.start >= self.counted {
            self.corrupt += u64::from(!good) + u64::from(gap);
            self.counted = place.start.saturating_add_unsigned(place.frames);
        }
        let end = place.start.saturating_add_unsigned(place.frames).min(self.timeline.frames as i64);
        if end <= position {
            self.decoded.clear();
            return;
        }
        let block = (end - place.start).max(0) as usize;
        self.decoded.resize(block * channels, 0.0);
        if place.start < position {
            self.decoded.drain(..(position - place.start) as usize * channels);
        } else {
            self.silence = (place.start - position) as u64;
        }
    }
}

fn demux<'s>(
    format: FileFormat,
    stream: MediaSourceStream<'s>,
) -> Result<Box<dyn FormatReader + 's>, AudioError> {
    let options = FormatOptions::default();
    let open = || -> Result<Box<dyn FormatReader + 's>, CodecError> {
        Ok(match format {
            FileFormat::Flac => Box::new(formats::FlacReader::try_new(stream, options)?),
            FileFormat::Ogg => Box::new(formats::OggReader::try_new(stream, options)?),
            _ => Box::new(formats::MpaReader::try_new(stream, options)?),
        })
    };
    guarded(open).unwrap_or(Err(PANICKED)).map_err(|e| codec_error(format, e))
}

const PANICKED: CodecError = CodecError::DecodeError("it breaks its decoder");

/// Runs code of `symphonia`; `None` if it panics.
fn guarded<T>(call: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(call)).ok()
}

fn codec_error(format: FileFormat, error: CodecError) -> AudioError {
    match error {
        CodecError::IoError(e) if e.kind() != io::ErrorKind::UnexpectedEof => AudioError::Io(e),
        CodecError::Unsupported(what) => AudioError::Unsupported {
            found: format!("this {} file ({what})", format.name()),
            wanted: "FLAC, Vorbis and MPEG layer III are read",
        },
        CodecError::IoError(_) => {
            AudioError::Undecodable { format: format.name(), what: "it ends within its header".into() }
        }
        other => AudioError::Undecodable { format: format.name(), what: other.to_string() },
    }
}

/// Why there is no packet any more.
#[derive(PartialEq)]
enum End {
    /// The source ends, or fails.
    Last,
    /// Another stream follows, with headers of its own.
    Chained,
}

/// The next packet of the track; corrupt stretches are skipped, a failing source is an end.
fn next_packet(demuxer: &mut dyn FormatReader, track: u32) -> Result<Packet, End> {
    let mut errors = 0;
    while errors < MAX_ERRORS {
        match guarded(|| demuxer.next_packet()).ok_or(End::Last)? {
            Ok(Some(packet)) if packet.track_id == track => return Ok(packet),
            Ok(Some(_)) => {}
            Err(CodecError::ResetRequired) => return Err(End::Chained),
            Ok(None) | Err(CodecError::IoError(_)) => return Err(End::Last),
            Err(_) => errors += 1,
        }
    }
    Err(End::Last)
}

/// Walks all packets: where the first frame lies, where the last ends, and how many packets there are.
fn walk(demuxer: &mut dyn FormatReader, track: u32, format: FileFormat, rate: u32) -> (Timeline, u64) {
    let mut timeline = Timeline::default();
    let mut end = 0_i64;
    let mut blocks = 0;
    let mut first = true;
    loop {
        let packet = match next_packet(demuxer, track) {
            Ok(packet) => packet,
            Err(end) => {
                timeline.chained = end == End::Chained;
                break;
            }
        };
        if first {
            let trim = if format == FileFormat::Ogg { packet.trim_start.get() } else { 0 };
            timeline.origin = packet.pts.get().saturating_add_unsigned(trim).max(0);
            first = false;
        }
        let place = place(&packet, format, rate, timeline.origin);
        // Packets of pure padding lie behind the end and have no length.
        if place.frames > 0 {
            end = end.max(place.start.saturating_add_unsigned(place.frames));
        }
        blocks += 1;
    }
    timeline.extra = demuxer.tracks().len() > 1;
    timeline.frames = end.max(0) as u64;
    (timeline, blocks)
}

fn place(packet: &Packet, format: FileFormat, rate: u32, origin: i64) -> Place {
    let start = packet.pts.get().saturating_sub(origin);
    let frames = match format {
        FileFormat::Mp3 => mp3_block(rate),
        // A last page cuts its last packet short.
        _ => packet.dur.get().saturating_add(packet.trim_start.get()),
    };
    Place { start, frames }
}

/// Frames of a layer III packet: two granules at 32 kHz and above (MPEG-1), one below.
const fn mp3_block(rate: u32) -> u64 {
    if rate >= 32_000 { 1152 } else { 576 }
}

/// The end position that the last page of an Ogg file states, if that page is there, complete and marked as the last.
fn last_page(source: &mut (impl Read + Seek), start: u64, len: u64) -> Result<Option<i64>, AudioError> {
    source.seek(SeekFrom::Start(start.max(len.saturating_sub(LARGEST_OGG_PAGE))))?;
    let mut tail = Vec::new();
    source.by_ref().take(LARGEST_OGG_PAGE).read_to_end(&mut tail)?;
    let Some(at) = tail.windows(4).rposition(|w| w == b"OggS") else { return Ok(None) };
    let page = &tail[at..];
    let Some(&[flags, a, b, c, d, e, f, g, h]) = page.get(5..14) else { return Ok(None) };
    let segments = page.get(26).map_or(0, |&n| usize::from(n));
    let Some(table) = page.get(27..27 + segments) else { return Ok(None) };
    let body: usize = table.iter().map(|&n| usize::from(n)).sum();
    let whole = flags & 4 != 0 && page.len() >= 27 + segments + body;
    Ok(whole.then_some(i64::from_le_bytes([a, b, c, d, e, f, g, h])))
}
