//! Sinusoids of steady grains, by which their frequencies change and their durations do not.

use super::error::GrainError;
use super::grain::Grain;
use crate::grain::sinusoid::{PeakRules, SinePeak, Track, TrackRules, add_integrated, find_tracks};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Bytes of a point, and of a line beside its points.
const BYTES: [usize; 2] = [8, 16];

/// A track in the rows of a grain.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackLine {
    /// Channel.
    pub channel: u16,
    /// Its first row.
    pub row: u16,
    /// Phase at the first point of the track, rad.
    pub phase: f32,
    /// Cycles from there to its first row: the integral of the frequency, which is linear between rows.
    pub cycles: f64,
    /// Frequency, Hz, and amplitude in each row.
    pub points: Vec<[f32; 2]>,
}

/// The sinusoids of one grain.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrainTracks {
    /// Samples from its first row to its segment.
    pub before: u32,
    /// Number of its rows; 0 without tracks.
    pub rows: u16,
    /// Its tracks.
    pub lines: Vec<TrackLine>,
}

/// The sinusoids of the steady grains of a dictionary.
///
/// Rows are a hop apart, from one row before the stored samples of a grain to one after them. Measured phases are not needed: at the recorded
/// frequency the samples themselves are played, and at any other one the phase is the integral of the frequency from the beginning of the
/// track on, so that neighbours at the same factor join seamlessly.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SteadyTracks {
    /// Samples from one row to the next.
    pub hop: u32,
    /// One for each grain.
    pub grains: Vec<GrainTracks>,
}

/// A track with the cycles from its first point to each.
struct Counted {
    track: Track,
    channel: u16,
    cycles: Vec<f64>,
}

/// Cycles between two points.
fn cycles_between(a: f64, b: f64, hop: f64, rate: f64) -> f64 {
    0.5 * (a + b) * hop / rate
}

impl Counted {
    fn new(track: Track, channel: u16, hop: f64, rate: f64) -> Self {
        let mut sum = 0.0;
        let frequency = |p: &SinePeak| f64::from(p.frequency as f32);
        let between = track.peaks.windows(2).map(|pair| {
            sum += cycles_between(frequency(&pair[0]), frequency(&pair[1]), hop, rate);
            sum
        });
        let cycles = std::iter::once(0.0).chain(between).collect();
        Self { track, channel, cycles }
    }

    /// One behind its last row.
    fn end(&self) -> usize {
        self.track.first + self.track.peaks.len()
    }

    /// Its points from row `first` to row `last`.
    fn line(&self, first: usize, last: usize) -> Option<TrackLine> {
        let own = |row: usize| row.saturating_sub(self.track.first).min(self.track.peaks.len());
        let (from, to) = (own(first), own(last + 1));
        let peaks = self.track.peaks.get(from..to).filter(|peaks| !peaks.is_empty())?;
        Some(TrackLine {
            channel: self.channel,
            row: (self.track.first + from - first) as u16,
            phase: self.track.peaks[0].phase as f32,
            cycles: self.cycles[from],
            points: peaks.iter().map(|p| [p.frequency as f32, p.amplitude as f32]).collect(),
        })
    }
}

/// The sinusoids of grains of one source, in order of time, with up to `margin` samples around each, or as many as its tapers have.
/// `channels` are the samples of the source.
///
/// # Complexity
/// One transform a hop, and O(points).
pub(super) fn tracks_of_grains(
    channels: &[Vec<f32>],
    grains: &[Grain],
    margin: usize,
    rate: f64,
) -> Vec<GrainTracks> {
    let peaks = PeakRules::at_rate(rate);
    let (rules, hop) = (TrackRules::at_rate(rate, peaks.hop), peaks.hop);
    let mut all: Vec<Counted> = channels
        .iter()
        .enumerate()
        .flat_map(|(channel, x)| {
            let tracks = find_tracks(x, peaks, rules, rate);
            tracks.into_iter().map(move |track| Counted::new(track, channel as u16, hop as f64, rate))
        })
        .collect();
    all.sort_by_key(|counted| counted.track.first);
    let highest = channels.first().map_or(0, Vec::len) / hop;
    let (mut next, mut sounding): (usize, Vec<usize>) = (0, Vec::new());
    let of_grain = |grain: &Grain| {
        let (start, end) = (grain.start as usize, grain.start as usize + grain.len as usize);
        let around = |side: usize| margin.max(grain.reach[side].into()).max(grain.taper[side].into());
        let first = start.saturating_sub(around(0)) / hop;
        let last = (end + around(1)).div_ceil(hop).min(highest);
        while all.get(next).is_some_and(|counted| counted.track.first <= last) {
            sounding.push(next);
            next += 1;
        }
        sounding.retain(|k| all[*k].end() > first);
        GrainTracks {
            before: (start - first * hop) as u32,
            rows: (last + 1).saturating_sub(first) as u16,
            lines: sounding.iter().filter_map(|k| all[*k].line(first, last)).collect(),
        }
    };
    grains.iter().map(of_grain).collect()
}

impl TrackLine {
    /// The sinusoid at row `row` and at the next one, at `factor` times its frequency. A track that begins or ends within the grain fades over a hop.
    fn ends(&self, row: usize, factor: f64, [hop, rate]: [f64; 2]) -> Option<[SinePeak; 2]> {
        let at = |k: usize| self.points.get(k).map(|[f, a]| [f64::from(*f), f64::from(*a)]);
        let peak = |[f, amplitude]: [f64; 2], cycles: f64| SinePeak {
            frequency: factor * f,
            amplitude,
            phase: f64::from(self.phase) + TAU * (factor * cycles).fract(),
        };
        let first = usize::from(self.row);
        if row + 1 == first {
            let [f, amplitude] = at(0)?;
            let before = self.cycles - cycles_between(f, f, hop, rate);
            return Some([peak([f, 0.0], before), peak([f, amplitude], self.cycles)]);
        }
        let own = row.checked_sub(first)?;
        let from = at(own)?;
        let to = at(own + 1).unwrap_or([from[0], 0.0]);
        let pairs = self.points.windows(2).take(own);
        let passed = pairs.map(|p| cycles_between(p[0][0].into(), p[1][0].into(), hop, rate)).sum::<f64>();
        let next = cycles_between(from[0], to[0], hop, rate);
        Some([peak(from, self.cycles + passed), peak(to, self.cycles + passed + next)])
    }
}

impl SteadyTracks {
    /// Returns true if a grain has tracks.
    #[must_use]
    pub fn has(&self, grain: u32) -> bool {
        self.grains.get(grain as usize).is_some_and(|tracks| tracks.rows > 0)
    }

    /// Adds the sinusoids of one channel of a grain, at `factor` times their frequencies, from sample `at` of its run on. Parts above 0.45 times the
    /// rate are silent. Blocks of any length give the same samples; nothing is allocated.
    ///
    /// # Complexity
    /// O(samples) for each sounding track, and for each hop up to its beginning.
    pub(in crate::grain) fn add(
        &self,
        (index, grain): (u32, &Grain),
        channel: usize,
        [factor, rate]: [f64; 2],
        at: i64,
        out: &mut [f32],
    ) {
        let Some(tracks) = self.grains.get(index as usize) else { return };
        let hop = self.hop.max(1) as usize;
        let mut first = at + i64::from(tracks.before) - i64::from(grain.position);
        let mut rest = out;
        while !rest.is_empty() {
            let (row, skip) = (first.div_euclid(hop as i64), first.rem_euclid(hop as i64) as usize);
            let (now, later) = rest.split_at_mut((hop - skip).min(rest.len()));
            if row >= 0 && row + 1 < i64::from(tracks.rows) {
                let of_channel = tracks.lines.iter().filter(|line| usize::from(line.channel) == channel);
                let ends = of_channel.filter_map(|line| line.ends(row as usize, factor, [hop as f64, rate]));
                add_integrated(ends, [hop, skip], rate, now);
            }
            (first, rest) = (first + now.len() as i64, later);
        }
    }

    /// Bytes of the tracks of a grain.
    #[must_use]
    pub fn bytes_of(&self, grain: usize) -> usize {
        let lines = self.grains.get(grain).map_or(&[][..], |tracks| &tracks.lines);
        lines.iter().map(|line| BYTES[0] * line.points.len() + BYTES[1]).sum()
    }

    /// The tracks of the grains for which `retained` is true.
    pub(super) fn subset(&self, retained: impl Fn(usize) -> bool) -> Self {
        let grains = self.grains.iter().enumerate().filter(|(k, _)| retained(*k));
        Self { hop: self.hop, grains: grains.map(|(_, tracks)| tracks.clone()).collect() }
    }

    /// Checks what the type does not enforce, for a dictionary of a rate whose grains have these numbers of channels.
    ///
    /// # Errors
    /// The first thing found.
    pub(super) fn validate(
        &self,
        rate: f64,
        channels: impl ExactSizeIterator<Item = usize>,
    ) -> Result<(), GrainError> {
        let (found, wanted) = (self.grains.len(), channels.len());
        if found != wanted {
            return Err(GrainError::Length { what: "grains with tracks", found, wanted });
        }
        // More than a second would be no row of what is heard.
        if self.hop == 0 || f64::from(self.hop) > rate {
            let found = self.hop as usize;
            return Err(GrainError::Length { what: "samples from row to row", found, wanted: 1 });
        }
        for (k, (channels, tracks)) in channels.zip(&self.grains).enumerate() {
            for line in &tracks.lines {
                let rows = usize::from(line.row) + line.points.len();
                if line.points.is_empty() || rows > usize::from(tracks.rows) {
                    return Err(GrainError::Grain { grain: k, field: "row of a track", found: rows as u64 });
                }
                if usize::from(line.channel) >= channels {
                    let found = line.channel.into();
                    return Err(GrainError::Grain { grain: k, field: "channel of a track", found });
                }
                let is_finite = line.points.iter().flatten().all(|x| x.is_finite());
                if !(is_finite && line.phase.is_finite() && line.cycles.is_finite()) {
                    return Err(GrainError::NotFinite { what: "track of grain", index: k });
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
