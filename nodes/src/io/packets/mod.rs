//! Packet formats (FLAC, Ogg Vorbis, MP3) with an exact length before the first packet is decoded.
//!
//! `symphonia` decodes. Its own trimming is off, since it cuts an MP3 without a LAME tag at an estimated length. Opening
//! reads all packets once without decoding, which determines the number of frames. Each packet is then placed at its
//! timestamp: gaps and packets that do not decode are silence, overlaps are dropped.
//!
//! `symphonia` 0.6 panics on some malformed headers (integer overflow). Every call into it is guarded, so that a panic is
//! an error or a corrupt packet. A build with `panic = "abort"` has no such guard.
//!
//! Limit: `symphonia` does not count the frames of an Ogg page or MP3 packet that it cannot find, so that later samples
//! move forward in time. If the container states a length, a warning reports the missing frames.

mod demuxer;
mod source;
mod timeline;

use std::io::{self, Seek, SeekFrom};

use symphonia::core::codecs::audio::{AudioDecoder, AudioDecoderOptions};
use symphonia::core::formats::{FormatReader, TrackType};
use symphonia::core::io::{MediaSourceStream, MediaSourceStreamOptions};
use symphonia::core::packet::Packet;
use symphonia::default::get_codecs;

use super::info::{AudioInfo, FileFormat, ReadLimits, SampleFormat};
use super::{AudioError, AudioWarning, ReadSeek};
use demuxer::{PANICKED, codec_error, demux, guarded, next_packet};
use source::Source;
use timeline::{Span, Timeline, last_page_end, mp3_packet_frames, scan, span};

/// An open packet stream.
pub(super) struct Packets<'s> {
    /// `None` only after a failed rewind.
    demuxer: Option<Box<dyn FormatReader + 's>>,
    decoder: Box<dyn AudioDecoder>,
    format: FileFormat,
    track: u32,
    rate: u32,
    channels: usize,
    timeline: Timeline,
    /// Next frame to return.
    position: u64,
    /// End of the packets that the demuxer has returned.
    demuxed: i64,
    /// Missing frames before the decoded ones; a count, so that a large timestamp needs no memory.
    silence: u64,
    /// Samples of the last packet; those from `used` follow `position` and the silence.
    decoded: Vec<f32>,
    used: usize,
    ended: bool,
    corrupt: u64,
    /// Corrupt packets before this frame are already in `corrupt`.
    counted: i64,
}

impl<'s> Packets<'s> {
    /// Opens a stream and determines its length.
    pub fn open(
        mut source: Box<dyn ReadSeek + 's>,
        start: u64,
        len: u64,
        format: FileFormat,
        limits: &ReadLimits,
    ) -> Result<(AudioInfo, Self), AudioError> {
        let last_page =
            if format == FileFormat::Ogg { last_page_end(&mut source, start, len)? } else { None };
        source.seek(SeekFrom::Start(start))?;
        let source = Source::new(source, start, len);
        let stream = MediaSourceStream::new(Box::new(source), MediaSourceStreamOptions::default());
        let mut demuxer = demux(format, stream)?;
        let malformed =
            |what: &str| AudioError::Malformed { format: format.name(), at: start, what: what.into() };
        let track = demuxer
            .default_track(TrackType::Audio)
            .ok_or_else(|| malformed("it has no audio stream"))?
            .clone();
        let params = track.codec_params.as_ref().and_then(|p| p.audio());
        let params = params.ok_or_else(|| malformed("its codec parameters are missing"))?;
        let rate = params.sample_rate.filter(|&r| r > 0).ok_or_else(|| malformed("its rate is missing"))?;
        let channels = params.channels.as_ref().map_or(0, |c| c.count());
        if channels == 0 {
            return Err(malformed("its number of channels is missing"));
        }
        limits.check(rate, channels, 0)?;
        let options = AudioDecoderOptions::default().gapless(false);
        let decoder =
            get_codecs().make_audio_decoder(params, &options).map_err(|e| codec_error(format, e))?;
        let sample_format = match (format, params.bits_per_sample) {
            (FileFormat::Flac, Some(bits)) => SampleFormat::Int { bits: bits as u16 },
            _ => SampleFormat::Lossy,
        };

        let (mut timeline, packet_count) = scan(&mut *demuxer, track.id, format, rate);
        let mut warnings = Vec::new();
        // Without a LAME tag `symphonia` estimates the length of an MP3 from its first frames: such a length is not checked.
        let tagged = format != FileFormat::Mp3 || track.delay.is_some();
        let stated = match last_page {
            Some(_) if timeline.is_chained => None,
            Some(granule) => Some(granule.saturating_sub_unsigned(timeline.origin as u64).max(0) as u64),
            None => track.num_frames.filter(|&n| n > 0 && tagged && format != FileFormat::Ogg),
        };
        if format == FileFormat::Mp3 && track.delay.is_some() {
            let packet_frames = mp3_packet_frames(rate);
            let trimmed = u64::from(track.delay.unwrap_or(0)) + u64::from(track.padding.unwrap_or(0));
            // A truncated stream has lost its padding with its last packets.
            if stated.is_some_and(|n| packet_count * packet_frames >= n + trimmed) {
                timeline.frames = timeline.frames.saturating_sub(u64::from(track.padding.unwrap_or(0)));
            }
        }
        let frames = timeline.frames;
        if let Some(header_frames) = stated.filter(|&n| n != frames) {
            warnings.push(AudioWarning::LengthDiffers { header_frames, frames, rate });
        }
        if format == FileFormat::Ogg && last_page.is_none() {
            warnings.push(AudioWarning::NoEnd);
        }
        if timeline.has_other_stream {
            warnings.push(AudioWarning::ExtraStream);
        }
        if timeline.is_chained {
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
            demuxed: i64::MIN,
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

    /// Adds or updates the warning of corrupt packets.
    pub fn report_corrupt(&self, warnings: &mut Vec<AudioWarning>) {
        if self.corrupt == 0 {
            return;
        }
        let packets = self.corrupt;
        match warnings.iter_mut().find(|w| matches!(w, AudioWarning::CorruptPackets { .. })) {
            Some(AudioWarning::CorruptPackets { packets: reported }) => *reported = (*reported).max(packets),
            _ => warnings.push(AudioWarning::CorruptPackets { packets }),
        }
    }

    /// Fills `out`; the caller requests no frame after the end.
    pub fn read(&mut self, mut out: &mut [f32]) {
        while !out.is_empty() {
            if self.silence == 0 && self.used == self.decoded.len() {
                self.refill(0);
            }
            if self.silence > 0 {
                let frames = self.silence.min((out.len() / self.channels) as u64);
                let (head, tail) = out.split_at_mut(frames as usize * self.channels);
                head.fill(0.0);
                self.silence -= frames;
                self.position += frames;
                out = tail;
                continue;
            }
            let n = (self.decoded.len() - self.used).min(out.len());
            if n == 0 {
                // The stream ended earlier than in the scan: silence fills the length of the scan.
                out.fill(0.0);
                self.position += (out.len() / self.channels) as u64;
                return;
            }
            let (head, tail) = out.split_at_mut(n);
            head.copy_from_slice(&self.decoded[self.used..self.used + n]);
            self.used += n;
            self.position += (n / self.channels) as u64;
            out = tail;
        }
    }

    /// Moves to a frame and restores the decoder state for it.
    pub fn seek(&mut self, frame: u64) -> Result<(), AudioError> {
        if frame == self.position {
            return Ok(());
        }
        // Frames that the samples of a packet depend on. FLAC: none before the packet. Vorbis: the previous block (at
        // most 8192 frames). MP3: up to 511 bytes of earlier packets (under 48 of the smallest) and two filter banks.
        let history = match self.format {
            FileFormat::Mp3 => 64 * 1152,
            FileFormat::Ogg => 32_768,
            _ => 0,
        };
        let from = frame.saturating_sub(history);
        if self.demuxed > from as i64 {
            self.rewind()?;
        }
        self.reset_decoder();
        self.position = frame;
        self.refill(from);
        Ok(())
    }

    fn reset_decoder(&mut self) {
        let decoder = &mut self.decoder;
        // A decoder whose reset panics fails on its next packet.
        let _ = guarded(|| decoder.reset());
    }

    /// Restarts the demuxer at the start of the stream.
    fn rewind(&mut self) -> Result<(), AudioError> {
        let no_stream = || AudioError::Io(io::Error::other("an earlier failure closed the stream"));
        let mut stream = self.demuxer.take().ok_or_else(no_stream)?.into_inner();
        stream.seek(SeekFrom::Start(0))?;
        self.demuxer = Some(demux(self.format, stream)?);
        self.reset_decoder();
        self.demuxed = i64::MIN;
        self.ended = false;
        Ok(())
    }

    /// Decodes until there are samples for `position` or the stream ends; skips packets that end before `from`.
    fn refill(&mut self, from: u64) {
        self.silence = 0;
        self.decoded.clear();
        self.used = 0;
        while self.decoded.is_empty() && !self.ended {
            let Some(Ok(packet)) = self.demuxer.as_mut().map(|d| next_packet(&mut **d, self.track)) else {
                self.ended = true;
                return;
            };
            let span = span(&packet, self.format, self.rate, self.timeline.origin);
            let end = span.start.saturating_add_unsigned(span.frames);
            let gap = span.start > self.demuxed.max(0);
            self.demuxed = self.demuxed.max(end);
            if end > from as i64 || from == 0 {
                self.decode_packet(&packet, &span, gap);
            }
        }
    }

    /// Decodes one packet and stores the samples from `position`, with silence before them for missing packets.
    fn decode_packet(&mut self, packet: &Packet, span: &Span, gap: bool) {
        let position = self.position as i64;
        let channels = self.channels;
        let decoder = &mut self.decoder;
        let decoded = guarded(|| decoder.decode(packet)).unwrap_or(Err(PANICKED));
        let is_valid = match decoded {
            Ok(audio) if audio.num_planes() == channels && audio.spec().rate() == self.rate => {
                audio.copy_to_vec_interleaved(&mut self.decoded);
                true
            }
            _ => false,
        };
        if !is_valid {
            self.decoded.clear();
        }
        if span.start >= self.counted {
            self.corrupt += u64::from(!is_valid) + u64::from(gap);
            self.counted = span.start.saturating_add_unsigned(span.frames);
        }
        let end = span.start.saturating_add_unsigned(span.frames).min(self.timeline.frames as i64);
        if end <= position {
            self.decoded.clear();
            return;
        }
        let frames = (end - span.start).max(0) as usize;
        self.decoded.resize(frames * channels, 0.0);
        if span.start < position {
            self.decoded.drain(..(position - span.start) as usize * channels);
        } else {
            self.silence = (span.start - position) as u64;
        }
    }
}
