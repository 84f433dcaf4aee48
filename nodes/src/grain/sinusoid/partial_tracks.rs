//! The node `PartialTracks`.

use super::item::{FrameFormat, PeakFrames, TrackFrames};
use super::tracks::{PartialTracker, TrackRules};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{archive_state, params, ports};

/// Most points of the frames that are not yet complete.
const MAX_POINTS: usize = 1 << 22;

params! {
    /// Joins the sinusoids of successive frames to tracks.
    ///
    /// Peaks are taken in order of falling amplitude. Each continues the nearest track that no larger peak has taken, of equally near ones the
    /// older, if its frequency changes by less than `offset` plus `slope` times the frequency. The other peaks begin tracks; tracks without a
    /// peak end. Tracks shorter than `min_dur` are removed, so that the output looks ahead by `min_dur` and `max_gap`.
    ///
    /// # Source
    /// McAulay and Quatieri, "Speech analysis/synthesis based on a sinusoidal representation" (IEEE TASSP 34(4), 1986), in the greedy form of
    /// Serra, "Musical sound modeling with sinusoids plus noise" (1997).
    pub struct PartialTracksParams {
        /// Largest change of frequency from frame to frame.
        offset: f64 = 20.0, unit "Hz", range 0.0..=10_000.0;
        /// Factor of the frequency that is added to it.
        slope: f64 = 0.01, unit "", range 0.0..=1.0;
        /// Shortest track.
        min_dur: f64 = 0.02, unit "s", range 0.0..=1.0;
        /// Frames for which a track may have no peak; its frequency and its level are linear over them.
        max_gap: usize = 0, unit "frames", range 0..=16_usize;
        /// Begin tracks at once, without look-ahead: as with `min_dur` and `max_gap` of 0.
        causal: bool = false;
    }
}
ports! {
    /// Ports of `PartialTracks`.
    pub struct PartialTracksPorts / PartialTracksIo {
        in {
            /// The sinusoids of each frame, the largest first.
            peaks: Stream<PeakFrames>,
        }
        out {
            /// The tracks: in each frame a point for each slot. A track stays in its slot and ends where the number of another track follows.
            tracks: Stream<TrackFrames>,
        }
    }
}

/// The node over [`PartialTracker`].
pub struct PartialTracks {
    tracker: PartialTracker,
    latency: i64,
    /// The first frame.
    first: Option<i64>,
}

impl PartialTracksParams {
    fn rules(&self, frames: Rate, hop: usize) -> Result<TrackRules, Reject> {
        let too_fast = || Reject::new("F051", format!("frames of {hop} samples at {frames} are too fast"));
        let rate = frames.times(hop as u64).ok_or_else(too_fast)?;
        let shortest = if self.causal { 0.0 } else { self.min_dur };
        Ok(TrackRules {
            offset: self.offset,
            slope: self.slope,
            min_frames: (shortest * rate.as_f64() / hop as f64).ceil() as usize,
            max_gap: if self.causal { 0 } else { self.max_gap },
        })
    }
}

impl Node for PartialTracks {
    type Params = PartialTracksParams;
    type Ports = PartialTracksPorts;
    const NAME: &'static str = "PartialTracks";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 60.0;

    fn shape(p: &PartialTracksParams, s: &mut Shape<'_, '_, PartialTracksPorts>) -> Result<(), Reject> {
        let peaks = s.input(PartialTracksPorts::peaks);
        let FrameFormat { count, hop, .. } = peaks.format;
        let rules = p.rules(peaks.rate, hop)?;
        let (latency, slots) = (rules.latency(), rules.slots(count));
        if (latency + 1).saturating_mul(slots) > MAX_POINTS {
            let message = format!("{slots} tracks in {latency} frames of look-ahead are too many");
            let help = "reduce `max_gap` or `min_dur`, or the number of peaks";
            return Err(Reject::new("F051", message).at("min_dur").help(help));
        }
        s.lookaround(PartialTracksPorts::peaks, 0, latency);
        s.output(PartialTracksPorts::tracks, peaks.rate, FrameFormat { count: slots, ..peaks.format });
        Ok(())
    }

    fn build(p: &PartialTracksParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let peaks = cx.input(PartialTracksPorts::peaks);
        let FrameFormat { count, hop, .. } = peaks.format;
        let rules = p.rules(peaks.rate, hop)?;
        let rate = peaks.rate.times(hop as u64).unwrap_or(peaks.rate).as_f64();
        let tracker = PartialTracker::new(rules, count, hop as f64 / rate);
        Ok(Self { tracker, latency: rules.latency() as i64, first: None })
    }

    fn run(&mut self, mut io: PartialTracksIo<'_>) -> Result<(), Fault> {
        let (first, slots) = (io.tracks.first(), io.tracks.width());
        for (k, out) in io.tracks.items().chunks_exact_mut(slots).enumerate() {
            let begin = *self.first.get_or_insert(first);
            // The frames up to that which completes this one.
            let last = first + k as i64 + self.latency;
            while begin + (self.tracker.frame() as i64) < last {
                let next = begin + self.tracker.frame() as i64 - first;
                self.tracker.next(io.peaks.item(next as isize));
            }
            out.copy_from_slice(self.tracker.next(io.peaks.item((last - first) as isize)));
        }
        Ok(())
    }

    archive_state!(tracker, first);

    fn trial(rng: &mut Rng) -> (PartialTracksParams, MemoryFiles) {
        let p = PartialTracksParams::trial(rng);
        let params = PartialTracksParams {
            offset: p.offset % 100.0,
            min_dur: rng.between(0.0, 0.1),
            max_gap: p.max_gap % 3,
            ..p
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
