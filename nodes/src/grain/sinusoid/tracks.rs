//! Continuation of peaks from frame to frame into tracks of sinusoids.

use super::item::TrackPoint;
use super::peaks::SinePeak;
use crate::impl_state;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Rules of the continuation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackRules {
    /// Largest change of frequency from frame to frame: this, Hz, plus `slope` times the frequency.
    pub offset: f64,
    /// Factor of the frequency.
    pub slope: f64,
    /// Shortest track, frames; shorter ones are removed.
    pub min_frames: usize,
    /// Frames for which a track may have no peak.
    pub max_gap: usize,
}

impl TrackRules {
    /// 20 Hz plus 1 %, and at least 20 ms.
    #[must_use]
    pub fn at_rate(rate: f64, hop: usize) -> Self {
        let min_frames = (0.02 * rate / hop.max(1) as f64).ceil() as usize;
        Self { offset: 20.0, slope: 0.01, min_frames, max_gap: 0 }
    }

    /// Frames after which a frame is complete.
    #[must_use]
    pub fn latency(&self) -> usize {
        self.min_frames.max(1) - 1 + self.max_gap
    }

    /// Most tracks at a time, of frames of at most `max_peaks` peaks: tracks with a peak, and tracks in a gap.
    #[must_use]
    pub fn slots(&self, max_peaks: usize) -> usize {
        max_peaks * (1 + self.max_gap)
    }
}

/// A sinusoid over several frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Number of the track, rising with the frame in which it begins.
    pub id: u32,
    /// Its first frame.
    pub first: usize,
    /// Its peak in each frame from the first on.
    pub peaks: Vec<SinePeak>,
}

/// A place for one track at a time.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Slot {
    /// The track, from 1 on; 0 for none.
    track: u32,
    /// Its latest peak.
    latest: SinePeak,
    /// Its frames so far, those of bridged gaps included.
    frames: usize,
    /// Frames without a peak since.
    asleep: usize,
    /// True if it has a peak in this frame.
    taken: bool,
}

/// Joins peaks of successive frames to tracks.
///
/// Peaks are taken in order of falling amplitude; each continues the free track whose frequency is nearest. Tracks without a peak end, peaks
/// without a track begin one. A frame is complete [`latency`](TrackRules::latency) frames later, when its tracks are known to be long enough
/// and its gaps are bridged. Nothing is allocated after the construction.
///
/// # Complexity
/// Peaks times live tracks a frame.
///
/// # Source
/// McAulay and Quatieri, "Speech analysis/synthesis based on a sinusoidal representation" (IEEE TASSP 34(4), 1986), in the greedy form of
/// Serra, "Musical sound modeling with sinusoids plus noise" (1997).
#[derive(Clone, Debug)]
pub struct PartialTracker {
    rules: TrackRules,
    /// Phase from frame to frame at 1 Hz, rad.
    step: f64,
    slots: Vec<Slot>,
    /// The latest frames, by their number modulo their count.
    frames: Vec<Vec<TrackPoint>>,
    /// The next frame.
    frame: usize,
    next_track: u32,
    born: Vec<SinePeak>,
}

impl_state!(PartialTracker { slots, frames, frame, next_track });

impl PartialTracker {
    /// A tracker before the first frame of at most `max_peaks` peaks; frames follow each other by `interval` seconds.
    #[must_use]
    pub fn new(rules: TrackRules, max_peaks: usize, interval: f64) -> Self {
        let slots = rules.slots(max_peaks);
        Self {
            step: TAU * interval,
            slots: vec![Slot::default(); slots],
            frames: vec![vec![TrackPoint::default(); slots]; rules.latency() + 1],
            frame: 0,
            next_track: 1,
            born: Vec::with_capacity(max_peaks),
            rules,
        }
    }

    /// Number of the next frame.
    #[must_use]
    pub fn frame(&self) -> usize {
        self.frame
    }

    /// Takes the peaks of the next frame, the largest first; those of amplitude 0 are none. Returns the frame that is now complete.
    ///
    /// # Shapes
    /// One point for each slot. Before the first frame, all slots are empty.
    pub fn next(&mut self, peaks: &[SinePeak]) -> &[TrackPoint] {
        let (now, count) = (self.frame, self.frames.len());
        self.frames[now % count].fill(TrackPoint::default());
        self.slots.iter_mut().for_each(|slot| slot.taken = false);
        self.born.clear();
        for peak in peaks.iter().filter(|peak| peak.amplitude > 0.0) {
            let limit = self.rules.offset + self.rules.slope * peak.frequency;
            let free = self.slots.iter().enumerate().filter(|(_, slot)| slot.track > 0 && !slot.taken);
            let nearest = free
                .map(|(k, slot)| ((slot.latest.frequency - peak.frequency).abs(), slot.track, k))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            match nearest.filter(|(distance, ..)| *distance < limit) {
                Some((.., k)) => self.resume(k, *peak),
                None => self.born.push(*peak),
            }
        }
        (0..self.slots.len()).for_each(|k| self.rest(k));
        for peak in &self.born {
            let Some(k) = self.slots.iter().position(|slot| slot.track == 0) else { break };
            let track = self.next_track;
            self.slots[k] = Slot { track, latest: *peak, frames: 1, asleep: 0, taken: true };
            self.frames[now % count][k] = TrackPoint { track, peak: *peak };
            self.next_track += 1;
        }
        self.frame += 1;
        &self.frames[self.frame % count]
    }

    /// Continues the track of a slot with a peak of this frame; frequency and level are linear over a gap, phases follow the frequency.
    fn resume(&mut self, k: usize, to: SinePeak) {
        let (now, count) = (self.frame, self.frames.len());
        let Slot { track, latest: from, asleep, .. } = self.slots[k];
        let mut before = from;
        for j in 1..=asleep {
            let part = j as f64 / (asleep + 1) as f64;
            let level = (1.0 - part) * from.amplitude.max(1e-12).ln() + part * to.amplitude.max(1e-12).ln();
            let frequency = from.frequency + part * (to.frequency - from.frequency);
            let phase = before.phase + 0.5 * self.step * (before.frequency + frequency);
            before = SinePeak { frequency, amplitude: level.exp(), phase };
            self.frames[(now - asleep - 1 + j) % count][k] = TrackPoint { track, peak: before };
        }
        self.frames[now % count][k] = TrackPoint { track, peak: to };
        let slot = &mut self.slots[k];
        *slot = Slot { latest: to, frames: slot.frames + asleep + 1, asleep: 0, taken: true, ..*slot };
    }

    /// Counts a frame without a peak of the track in a slot: the track ends after too many, and is removed if it was too short.
    fn rest(&mut self, k: usize) {
        let (now, count) = (self.frame, self.frames.len());
        let slot = &mut self.slots[k];
        if slot.track == 0 || slot.taken {
            return;
        }
        slot.asleep += 1;
        if slot.asleep <= self.rules.max_gap {
            return;
        }
        if slot.frames < self.rules.min_frames {
            let end = now - slot.asleep;
            (end + 1 - slot.frames..=end)
                .for_each(|frame| self.frames[frame % count][k] = TrackPoint::default());
        }
        *slot = Slot::default();
    }
}

/// Collects the tracks of complete frames.
#[derive(Clone, Debug, Default)]
pub(super) struct TrackList {
    tracks: Vec<Track>,
    /// The track in each slot.
    open: Vec<Option<usize>>,
}

impl TrackList {
    /// Adds a frame.
    pub(super) fn add(&mut self, frame: usize, points: &[TrackPoint]) {
        self.open.resize(points.len(), None);
        for (open, point) in self.open.iter_mut().zip(points) {
            let Some(id) = point.track.checked_sub(1) else {
                *open = None;
                continue;
            };
            let at = match *open {
                Some(at) if self.tracks[at].id == id => at,
                _ => {
                    self.tracks.push(Track { id, first: frame, peaks: Vec::new() });
                    self.tracks.len() - 1
                }
            };
            *open = Some(at);
            self.tracks[at].peaks.push(point.peak);
        }
    }

    /// The tracks in the order of their numbers.
    pub(super) fn finish(mut self) -> Vec<Track> {
        self.tracks.sort_by_key(|track| track.id);
        self.tracks
    }
}

/// Joins the peaks of all frames to tracks.
pub(super) fn tracks_of(
    frames: impl IntoIterator<Item = Vec<SinePeak>>,
    mut tracker: PartialTracker,
) -> Vec<Track> {
    let (latency, mut list) = (tracker.rules.latency(), TrackList::default());
    let mut add = |peaks: &[SinePeak]| {
        let now = tracker.frame();
        let points = tracker.next(peaks);
        if let Some(frame) = now.checked_sub(latency) {
            list.add(frame, points);
        }
    };
    frames.into_iter().for_each(|peaks| add(&peaks));
    (0..latency).for_each(|_| add(&[]));
    list.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peak(frequency: f64, amplitude: f64) -> SinePeak {
        SinePeak { frequency, amplitude, phase: 0.0 }
    }

    fn tracks(frames: &[Vec<SinePeak>], rules: TrackRules) -> Vec<Track> {
        tracks_of(frames.iter().cloned(), PartialTracker::new(rules, 4, 256.0 / 44_100.0))
    }

    const RULES: TrackRules = TrackRules { offset: 20.0, slope: 0.01, min_frames: 4, max_gap: 0 };

    #[test]
    fn chirps_that_cross_between_frames_stay_two_tracks_and_a_blip_is_removed() {
        let frames: Vec<Vec<SinePeak>> = (0..40)
            .map(|k| {
                let mut peaks =
                    vec![peak(1000.0 + 12.0 * k as f64, 0.9), peak(3000.0 - 12.0 * k as f64, 0.5)];
                if (10..12).contains(&k) {
                    peaks.push(peak(6000.0, 0.1));
                }
                peaks
            })
            .collect();
        let found = tracks(&frames, RULES);
        assert_eq!(found.iter().map(|t| (t.id, t.peaks.len())).collect::<Vec<_>>(), [(0, 40), (1, 40)]);
        assert!((found[0].peaks[39].frequency - 1468.0).abs() < 1e-9);
    }

    #[test]
    fn a_gap_is_bridged_linearly_and_ends_a_track_without_leave() {
        let frames: Vec<Vec<SinePeak>> =
            (0..20).map(|k| if k == 9 { Vec::new() } else { vec![peak(500.0 + k as f64, 0.1)] }).collect();
        assert_eq!(tracks(&frames, RULES).len(), 2);
        let found = tracks(&frames, TrackRules { max_gap: 1, ..RULES });
        assert!(found.len() == 1 && found[0].peaks.len() == 20);
        assert!((found[0].peaks[9].frequency - 509.0).abs() < 1e-9);
    }

    #[test]
    fn of_two_tracks_at_one_distance_the_older_goes_on() {
        let frames = [vec![peak(990.0, 0.5), peak(1010.0, 0.4)], vec![peak(1000.0, 0.5)]];
        let found = tracks(&frames, TrackRules { min_frames: 1, ..RULES });
        assert_eq!(found.iter().map(|t| t.peaks.len()).collect::<Vec<_>>(), [2, 1]);
    }
}
