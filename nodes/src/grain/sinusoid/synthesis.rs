//! Sinusoids of tracks.

use super::item::TrackPoint;
use super::peaks::SinePeak;
use super::tracks::Track;
use crate::impl_state;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Tracks that are computed together.
const LANES: usize = 8;
/// Duration over which a track that begins with an attack rises, s.
const ATTACK: f64 = 0.002;
/// Share of the sample rate above which a track is silent.
const HIGHEST: f64 = 0.45;

/// A track between two frames: `(a + da n) cos(phase + w n + alpha n^2 + beta n^3)`.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    amplitude: [f64; 2],
    phase: f64,
    /// Differences of the phase from sample to sample: first, second, third order.
    steps: [f64; 3],
}

impl Piece {
    /// A cubic phase with the measured frequencies and phases at both ends.
    ///
    /// # Source
    /// McAulay and Quatieri (IEEE TASSP 34(4), 1986), eqs. 34 to 37.
    fn new(from: SinePeak, to: SinePeak, hop: f64, rate: f64) -> Self {
        let [w0, w1] = [from, to].map(|p| TAU * p.frequency / rate);
        let end = to.phase;
        let turns = (((from.phase + w0 * hop - end) + 0.5 * (w1 - w0) * hop) / TAU).round();
        let d = end - from.phase - w0 * hop + TAU * turns;
        let alpha = 3.0 * d / (hop * hop) - (w1 - w0) / hop;
        let beta = -2.0 * d / hop.powi(3) + (w1 - w0) / (hop * hop);
        Self {
            amplitude: [from.amplitude, to.amplitude],
            phase: from.phase,
            steps: [w0 + alpha + beta, 2.0 * alpha + 6.0 * beta, 6.0 * beta],
        }
    }

    /// A quadratic phase from that of `from` on: the frequency is linear, whatever the phase of `to`.
    fn integrated(from: SinePeak, to: SinePeak, hop: f64, rate: f64) -> Self {
        let [w0, w1] = [from, to].map(|p| TAU * p.frequency / rate);
        let alpha = 0.5 * (w1 - w0) / hop;
        Self {
            amplitude: [from.amplitude, to.amplitude],
            phase: from.phase,
            steps: [w0 + alpha, 2.0 * alpha, 0.0],
        }
    }

    /// Phase at sample `n`.
    fn phase(&self, n: f64) -> f64 {
        let [first, second, third] = self.steps;
        self.phase + n * first + 0.5 * n * (n - 1.0) * second + n * (n - 1.0) * (n - 2.0) / 6.0 * third
    }
}

/// Adds up to [`LANES`] pieces from sample `skip` on. The phases are cubic in the sample index, so that three products of complex numbers a sample give the next
/// sample of each.
fn add_pieces(pieces: &[Piece], skip: usize, out: &mut [f32], hop: f64) {
    let mut z = [[[0.0; LANES]; 2]; 4];
    let (mut amplitude, mut slope) = ([0.0; LANES], [0.0; LANES]);
    for (k, piece) in pieces.iter().enumerate().take(LANES) {
        let [first, second, third] = piece.steps;
        for (z, angle) in z.iter_mut().zip([piece.phase, first, second, third]) {
            (z[0][k], z[1][k]) = (angle.cos(), angle.sin());
        }
        amplitude[k] = piece.amplitude[0];
        slope[k] = (piece.amplitude[1] - piece.amplitude[0]) / hop;
    }
    let advance = |z: &mut [[[f64; LANES]; 2]; 4]| {
        for j in 0..3 {
            let ([.., [re, im]], [[turn_re, turn_im], ..]) = z.split_at_mut(j + 1) else { continue };
            for ((re, im), (c, s)) in re.iter_mut().zip(im.iter_mut()).zip(turn_re.iter().zip(turn_im.iter()))
            {
                (*re, *im) = (*re * c - *im * s, *re * s + *im * c);
            }
        }
    };
    for _ in 0..skip {
        advance(&mut z);
        amplitude.iter_mut().zip(slope).for_each(|(a, slope)| *a += slope);
    }
    for y in out {
        *y += amplitude.iter().zip(&z[0][0]).map(|(a, cosine)| a * cosine).sum::<f64>() as f32;
        advance(&mut z);
        amplitude.iter_mut().zip(slope).for_each(|(a, slope)| *a += slope);
    }
}

/// Adds sinusoids between two frames a hop apart, from sample `skip` after the first one on: frequency and amplitude are linear, and the phase is
/// that of the first frame and the integral of the frequency. A sinusoid above the highest frequency at a frame is silent there.
pub(crate) fn add_integrated(
    ends: impl Iterator<Item = [SinePeak; 2]>,
    [hop, skip]: [usize; 2],
    rate: f64,
    out: &mut [f32],
) {
    let step = hop as f64;
    let (mut pieces, mut count) = ([Piece::default(); LANES], 0);
    for pair in ends {
        let [from, to] = pair.map(|peak| limited(peak, HIGHEST * rate));
        pieces[count] = Piece::integrated(from, to, step, rate);
        count += 1;
        if count == LANES {
            add_pieces(&pieces, skip, out, step);
            count = 0;
        }
    }
    if count > 0 {
        add_pieces(&pieces[..count], skip, out, step);
    }
}

/// A point below a highest frequency, or a silent one at it.
fn limited(peak: SinePeak, highest: f64) -> SinePeak {
    if peak.frequency > highest { SinePeak { frequency: highest, amplitude: 0.0, ..peak } } else { peak }
}

/// The frame before the first one of a track, or after the last: the same frequency at amplitude 0.
fn silent(peak: SinePeak, hop: f64, rate: f64) -> SinePeak {
    SinePeak { amplitude: 0.0, phase: peak.phase + TAU * peak.frequency / rate * hop, ..peak }
}

/// First attack that a track begins with: one within reach of the window of its first frame, before which it is silent.
fn attack_of(first: usize, attacks: &[usize], hop: usize, half_window: usize) -> Option<usize> {
    attacks.iter().copied().find(|o| *o + hop > first && *o < first + half_window)
}

/// State of a slot of tracks from frame to frame.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct SlotState {
    /// The track.
    track: u32,
    /// Its phase, if it is integrated and not measured.
    phase: Option<f64>,
    /// The attack that it begins with.
    attack: Option<usize>,
}

/// Adds the sinusoids of tracks, frame by frame.
///
/// A track fades in and out over one hop, and so do the parts of it above 0.45 times the sample rate. At a ratio of 1 phases are cubic and
/// reach those that were measured. Other ratios multiply the frequencies: from then on the phase of a track is the integral of its frequency, which is
/// linear within a hop.
///
/// A track that begins around an attack is silent before it and rises within 2 ms: the window would spread it by half a window before the attack.
///
/// # Complexity
/// O(samples) for each sounding track.
///
/// # Source
/// McAulay and Quatieri (IEEE TASSP 34(4), 1986), section IV.
#[derive(Clone, Debug)]
pub struct TrackSynthesis {
    hop: usize,
    half_window: usize,
    rate: f64,
    slots: Vec<SlotState>,
    /// Pieces of a hop with their tracks, and the attacks that they begin with.
    pieces: Vec<(u32, Piece, Option<usize>)>,
    /// Pieces without an attack.
    plain: Vec<Piece>,
}

impl_state!(TrackSynthesis { slots });

impl TrackSynthesis {
    /// Creates a synthesis of `slots` slots at a rate in Hz.
    #[must_use]
    pub fn new(slots: usize, [hop, half_window]: [usize; 2], rate: f64) -> Self {
        Self {
            hop: hop.max(1),
            half_window,
            rate,
            slots: vec![SlotState::default(); slots],
            pieces: Vec::with_capacity(2 * slots),
            plain: Vec::with_capacity(2 * slots),
        }
    }

    /// A point at a ratio; above the highest frequency it is silent.
    fn scaled(&self, peak: SinePeak, ratio: f64) -> SinePeak {
        let scaled = limited(SinePeak { frequency: ratio * peak.frequency, ..peak }, HIGHEST * self.rate);
        // Measured phases need the measured frequency.
        if ratio == 1.0 { SinePeak { frequency: peak.frequency, ..scaled } } else { scaled }
    }

    /// Adds the samples between two frames, the first of which has number `frame`, to up to one hop. `ratios` are those at both frames.
    ///
    /// # Shapes
    /// `from` and `to` have a point for each slot.
    pub fn add(
        &mut self,
        frame: usize,
        [from, to]: [&[TrackPoint]; 2],
        ratios: [f64; 2],
        attacks: &[usize],
        out: &mut [f32],
    ) {
        self.pieces.clear();
        for (k, (from, to)) in from.iter().zip(to).enumerate() {
            if from.track > 0 {
                if self.slots[k].track != from.track {
                    let begins = frame == 0;
                    let attack = attack_of(0, attacks, self.hop, self.half_window).filter(|_| begins);
                    self.slots[k] = SlotState { track: from.track, phase: None, attack };
                }
                let next = (to.track == from.track).then_some(to.peak);
                self.go_on(k, from.peak, next, ratios);
            }
            if to.track > 0 && to.track != from.track {
                self.begin(k, *to, frame, ratios[1], attacks);
            }
        }
        self.pieces.sort_unstable_by_key(|piece| piece.0);
        let (from, rise) = (frame * self.hop, (ATTACK * self.rate) as usize);
        self.plain.clear();
        for (_, piece, attack) in &self.pieces {
            match attack.filter(|o| *o + rise > from) {
                Some(o) => add_after_attack(piece, from, o, self.hop, self.rate, out),
                None => self.plain.push(*piece),
            }
        }
        let step = self.hop as f64;
        self.plain.chunks(LANES).for_each(|pieces| add_pieces(pieces, 0, out, step));
    }

    /// Continues the track of a slot to its next point, or fades it out.
    fn go_on(&mut self, k: usize, from: SinePeak, to: Option<SinePeak>, ratios: [f64; 2]) {
        let SlotState { track, phase, attack } = self.slots[k];
        let step = self.hop as f64;
        let start = self.scaled(SinePeak { phase: phase.unwrap_or(from.phase), ..from }, ratios[0]);
        let piece = if phase.is_none() && ratios == [1.0, 1.0] {
            let end = to.map_or_else(|| silent(from, step, self.rate), |to| self.scaled(to, 1.0));
            Piece::new(start, end, step, self.rate)
        } else {
            let end = to.map_or(SinePeak { amplitude: 0.0, ..start }, |to| self.scaled(to, ratios[1]));
            let piece = Piece::integrated(start, end, step, self.rate);
            self.slots[k].phase = Some(piece.phase(step).rem_euclid(TAU));
            piece
        };
        self.pieces.push((track, piece, attack));
    }

    /// Fades in a track whose first point is at the frame after `frame`.
    fn begin(&mut self, k: usize, to: TrackPoint, frame: usize, ratio: f64, attacks: &[usize]) {
        let step = self.hop as f64;
        let attack = attack_of((frame + 1) * self.hop, attacks, self.hop, self.half_window);
        self.slots[k] = SlotState { track: to.track, phase: None, attack };
        let end = self.scaled(to.peak, ratio);
        let frequency = if ratio == 1.0 { to.peak.frequency } else { end.frequency };
        let phase = end.phase - TAU * frequency / self.rate * step;
        let start = SinePeak { frequency, amplitude: 0.0, phase };
        let piece = if ratio == 1.0 {
            Piece::new(start, end, step, self.rate)
        } else {
            Piece::integrated(start, end, step, self.rate)
        };
        self.pieces.push((to.track, piece, attack));
    }
}

/// Adds the sinusoids of tracks in the order of their numbers, whose frame `k` is at sample `k hop`, as [`TrackSynthesis`] does.
///
/// # Complexity
/// O(samples) for each sounding track.
pub fn add_tracks(
    tracks: &[Track],
    attacks: &[usize],
    [hop, half_window]: [usize; 2],
    rate: f64,
    out: &mut [f32],
) {
    let hop = hop.max(1);
    // The tracks in each slot, one after the other; a slot is free after the frame in which a track fades out.
    let mut slots: Vec<Vec<&Track>> = Vec::new();
    let end = |track: &Track| track.first + track.peaks.len();
    for track in tracks.iter().filter(|track| !track.peaks.is_empty()) {
        let is_free = |slot: &Vec<&Track>| slot.last().is_none_or(|last| end(last) < track.first);
        match slots.iter().position(is_free) {
            Some(k) => slots[k].push(track),
            None => slots.push(vec![track]),
        }
    }
    let mut synthesis = TrackSynthesis::new(slots.len(), [hop, half_window], rate);
    let mut next = vec![0; slots.len()];
    let mut points = |frame: usize, points: &mut Vec<TrackPoint>| {
        points.clear();
        points.extend(slots.iter().zip(&mut next).map(|(slot, next)| {
            *next += usize::from(slot.get(*next).is_some_and(|track| end(track) <= frame));
            let point = slot.get(*next).and_then(|track| {
                let peak = *track.peaks.get(frame.checked_sub(track.first)?)?;
                Some(TrackPoint { track: track.id + 1, peak })
            });
            point.unwrap_or_default()
        }));
    };
    let (mut from, mut to) = (Vec::new(), Vec::new());
    points(0, &mut from);
    for (frame, out) in out.chunks_mut(hop).enumerate() {
        points(frame + 1, &mut to);
        synthesis.add(frame, [&from, &to], [1.0, 1.0], attacks, out);
        std::mem::swap(&mut from, &mut to);
    }
}

/// Adds a piece from sample `from` on, with its part before an attack silent.
fn add_after_attack(piece: &Piece, from: usize, attack: usize, hop: usize, rate: f64, out: &mut [f32]) {
    let ramp = (ATTACK * rate).max(1.0);
    for (n, y) in out.iter_mut().take(hop).enumerate() {
        let since = (from + n) as f64 - attack as f64;
        let gain = (since / ramp).clamp(0.0, 1.0);
        let part = n as f64 / hop as f64;
        let amplitude = piece.amplitude[0] + part * (piece.amplitude[1] - piece.amplitude[0]);
        *y += (gain * amplitude * piece.phase(n as f64).cos()) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_complex_numbers_equal_the_cosines() {
        let peak = |frequency: f64, amplitude: f64, phase: f64| SinePeak { frequency, amplitude, phase };
        let tracks: Vec<Track> = (0..11)
            .map(|k| {
                let f = 200.0 + 431.0 * k as f64;
                let peaks = (0..6).map(|j| peak(f + 3.0 * j as f64, 0.1, (k * j) as f64)).collect();
                Track { id: k, first: 2, peaks }
            })
            .collect();
        let (rate, hop) = (44_100.0, 256);
        let mut got = vec![0.0; 2500];
        add_tracks(&tracks, &[], [hop, 1023], rate, &mut got);
        let mut want = vec![0.0_f64; 2500];
        for track in &tracks {
            let (first, last) = (track.peaks[0], track.peaks[5]);
            let w = |p: SinePeak| TAU * p.frequency / rate * hop as f64;
            let mut all = vec![peak(first.frequency, 0.0, first.phase - w(first))];
            all.extend(&track.peaks);
            all.push(peak(last.frequency, 0.0, last.phase + w(last)));
            for (k, pair) in all.windows(2).enumerate() {
                let piece = Piece::new(pair[0], pair[1], hop as f64, rate);
                for n in 0..hop {
                    let a =
                        pair[0].amplitude + (pair[1].amplitude - pair[0].amplitude) * n as f64 / hop as f64;
                    if let Some(y) = want.get_mut((1 + k) * hop + n) {
                        *y += a * piece.phase(n as f64).cos();
                    }
                }
            }
        }
        assert!(got.iter().zip(&want).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5));
        assert!(got[..256].iter().all(|x| *x == 0.0) && got[260..].iter().any(|x| x.abs() > 0.05));
    }
}
