//! The timeline of a packet stream: frames of each packet, and the length of the stream.

use std::io::{Read, Seek, SeekFrom};

use symphonia::core::formats::FormatReader;
use symphonia::core::packet::Packet;

use super::demuxer::{End, next_packet};
use crate::io::{AudioError, FileFormat};

/// Maximum size of an Ogg page: header, 255 segment lengths and 255 segments of 255 bytes.
const MAX_OGG_PAGE: u64 = 65_307;

/// Length of a stream by the timestamps of all its packets.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Timeline {
    /// Timestamp of frame 0.
    pub(super) origin: i64,
    pub(super) frames: u64,
    /// True if the file has packets of another stream.
    pub(super) has_other_stream: bool,
    /// True if another stream with its own headers follows the last packet.
    pub(super) is_chained: bool,
}

/// Frames of a packet on the timeline.
pub(super) struct Span {
    /// First frame; negative within the encoder delay.
    pub(super) start: i64,
    pub(super) frames: u64,
}

/// Reads all packets without decoding; returns the timeline and the number of packets.
pub(super) fn scan(
    demuxer: &mut dyn FormatReader,
    track: u32,
    format: FileFormat,
    rate: u32,
) -> (Timeline, u64) {
    let mut timeline = Timeline::default();
    let mut end = 0_i64;
    let mut packets = 0;
    let mut first = true;
    loop {
        let packet = match next_packet(demuxer, track) {
            Ok(packet) => packet,
            Err(end) => {
                timeline.is_chained = end == End::Chained;
                break;
            }
        };
        if first {
            let trim = if format == FileFormat::Ogg { packet.trim_start.get() } else { 0 };
            timeline.origin = packet.pts.get().saturating_add_unsigned(trim).max(0);
            first = false;
        }
        let span = span(&packet, format, rate, timeline.origin);
        // Packets of padding only are after the end and have no length.
        if span.frames > 0 {
            end = end.max(span.start.saturating_add_unsigned(span.frames));
        }
        packets += 1;
    }
    timeline.has_other_stream = demuxer.tracks().len() > 1;
    timeline.frames = end.max(0) as u64;
    (timeline, packets)
}

/// Frames of a packet relative to `origin`.
pub(super) fn span(packet: &Packet, format: FileFormat, rate: u32, origin: i64) -> Span {
    let start = packet.pts.get().saturating_sub(origin);
    let frames = match format {
        FileFormat::Mp3 => mp3_packet_frames(rate),
        // The last page of an Ogg file shortens its last packet.
        _ => packet.dur.get().saturating_add(packet.trim_start.get()),
    };
    Span { start, frames }
}

/// Frames of a layer III packet: two granules at 32 kHz and above (MPEG-1), one below.
pub(super) const fn mp3_packet_frames(rate: u32) -> u64 {
    if rate >= 32_000 { 1152 } else { 576 }
}

/// End position in the last page of an Ogg file, if that page is complete and marked as the last.
pub(super) fn last_page_end(
    source: &mut (impl Read + Seek),
    start: u64,
    len: u64,
) -> Result<Option<i64>, AudioError> {
    source.seek(SeekFrom::Start(start.max(len.saturating_sub(MAX_OGG_PAGE))))?;
    let mut tail = Vec::new();
    source.by_ref().take(MAX_OGG_PAGE).read_to_end(&mut tail)?;
    let Some(offset) = tail.windows(4).rposition(|w| w == b"OggS") else { return Ok(None) };
    let page = &tail[offset..];
    let Some(&[flags, a, b, c, d, e, f, g, h]) = page.get(5..14) else { return Ok(None) };
    let segments = page.get(26).map_or(0, |&n| usize::from(n));
    let Some(table) = page.get(27..27 + segments) else { return Ok(None) };
    let body: usize = table.iter().map(|&n| usize::from(n)).sum();
    let complete = flags & 4 != 0 && page.len() >= 27 + segments + body;
    Ok(complete.then_some(i64::from_le_bytes([a, b, c, d, e, f, g, h])))
}
