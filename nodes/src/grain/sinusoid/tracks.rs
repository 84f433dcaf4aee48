//! Continuation of peaks from frame to frame into tracks of sinusoids.

use super::peaks::SinePeak;
use serde::{Deserialize, Serialize};

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

/// A track that may go on.
#[derive(Clone, Debug)]
struct Live {
    track: Track,
    /// Frames without a peak.
    asleep: usize,
}

/// Joins peaks of successive frames to tracks.
///
/// Peaks are taken in order of falling amplitude; each continues the free track whose frequency is nearest. Tracks without a peak end, peaks
/// without a track begin one.
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
    live: Vec<Live>,
    frame: usize,
    next_id: u32,
    taken: Vec<bool>,
}

impl PartialTracker {
    /// A tracker before the first frame.
    #[must_use]
    pub fn new(rules: TrackRules) -> Self {
        Self { rules, live: Vec::new(), frame: 0, next_id: 0, taken: Vec::new() }
    }

    /// Takes the peaks of the next frame, the largest first, and appends the tracks that have ended to `ended`.
    pub fn next(&mut self, peaks: &[SinePeak], ended: &mut Vec<Track>) {
        let Self { rules, live, frame, next_id, taken } = self;
        taken.clear();
        taken.resize(live.len(), false);
        let mut born = Vec::new();
        for peak in peaks {
            let limit = rules.offset + rules.slope * peak.frequency;
            let distance =
                |l: &Live| l.track.peaks.last().map_or(f64::MAX, |p| (p.frequency - peak.frequency).abs());
            let free = live
                .iter()
                .enumerate()
                .filter(|(k, _)| !taken[*k])
                .map(|(k, l)| (distance(l), l.track.id, k));
            match free.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).filter(|(d, ..)| *d < limit) {
                Some((_, _, k)) => {
                    taken[k] = true;
                    let Live { track, asleep } = &mut live[k];
                    bridge(track, *peak, std::mem::take(asleep));
                    track.peaks.push(*peak);
                }
                None => {
                    born.push(Live {
                        track: Track { id: *next_id, first: *frame, peaks: vec![*peak] },
                        asleep: 0,
                    });
                    *next_id += 1;
                }
            }
        }
        let mut k = 0;
        live.retain_mut(|l| {
            let has_peak = taken[k];
            k += 1;
            l.asleep += usize::from(!has_peak);
            let lives = l.asleep <= rules.max_gap;
            if !lives && l.track.peaks.len() >= rules.min_frames {
                ended.push(std::mem::take(&mut l.track));
            }
            lives
        });
        live.extend(born);
        *frame += 1;
    }

    /// Ends all tracks.
    pub fn finish(&mut self, ended: &mut Vec<Track>) {
        let long = self.live.drain(..).map(|l| l.track).filter(|t| t.peaks.len() >= self.rules.min_frames);
        ended.extend(long);
    }
}

/// Fills a gap of frames: frequency and level are linear, phases follow the frequency.
fn bridge(track: &mut Track, to: SinePeak, frames: usize) {
    let Some(from) = track.peaks.last().copied() else { return };
    for k in 1..=frames {
        let part = k as f64 / (frames + 1) as f64;
        let level = (1.0 - part) * from.amplitude.max(1e-12).ln() + part * to.amplitude.max(1e-12).ln();
        let frequency = from.frequency + part * (to.frequency - from.frequency);
        // Cubic phases between measured frames bridge what the phases of the gap leave open.
        track.peaks.push(SinePeak { frequency, amplitude: level.exp(), phase: f64::NAN });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peak(frequency: f64, amplitude: f64) -> SinePeak {
        SinePeak { frequency, amplitude, phase: 0.0 }
    }

    fn tracks(frames: &[Vec<SinePeak>], rules: TrackRules) -> Vec<Track> {
        let (mut tracker, mut ended) = (PartialTracker::new(rules), Vec::new());
        frames.iter().for_each(|peaks| tracker.next(peaks, &mut ended));
        tracker.finish(&mut ended);
        ended.sort_by_key(|t| t.id);
        ended
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
