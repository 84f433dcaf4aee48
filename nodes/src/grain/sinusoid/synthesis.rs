//! Sinusoids of tracks.

use super::peaks::SinePeak;
use super::tracks::Track;
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
        let end = if to.phase.is_nan() { from.phase + 0.5 * (w0 + w1) * hop } else { to.phase };
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

    /// Phase at sample `n`.
    fn phase(&self, n: f64) -> f64 {
        let [first, second, third] = self.steps;
        self.phase + n * first + 0.5 * n * (n - 1.0) * second + n * (n - 1.0) * (n - 2.0) / 6.0 * third
    }
}

/// Adds up to [`LANES`] pieces. The phases are cubic in the sample index, so that three products of complex numbers a sample give the next
/// sample of each.
fn add_pieces(pieces: &[Piece], out: &mut [f32], hop: f64) {
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
    for y in out {
        *y += amplitude.iter().zip(&z[0][0]).map(|(a, cosine)| a * cosine).sum::<f64>() as f32;
        for j in 0..3 {
            let ([.., [re, im]], [[turn_re, turn_im], ..]) = z.split_at_mut(j + 1) else { continue };
            for ((re, im), (c, s)) in re.iter_mut().zip(im.iter_mut()).zip(turn_re.iter().zip(turn_im.iter()))
            {
                (*re, *im) = (*re * c - *im * s, *re * s + *im * c);
            }
        }
        amplitude.iter_mut().zip(slope).for_each(|(a, slope)| *a += slope);
    }
}

/// The frame before the first one of a track, or after the last: the same frequency at amplitude 0.
fn silent(peak: SinePeak, hop: f64, rate: f64) -> SinePeak {
    SinePeak { amplitude: 0.0, phase: peak.phase + TAU * peak.frequency / rate * hop, ..peak }
}

/// First attack that a track begins with: one within reach of the window of its first frame, before which it is silent.
fn attack_of(track: &Track, attacks: &[usize], hop: usize, half_window: usize) -> Option<usize> {
    let first = track.first * hop;
    attacks.iter().copied().find(|o| *o + hop > first && *o < first + half_window)
}

/// Adds the sinusoids of tracks, whose frame `k` is at sample `k hop`.
///
/// A track fades in and out over one hop. A track that begins around one of the `attacks` is silent before it and rises within 2 ms: the
/// window would spread it `half_window` samples ahead.
///
/// # Complexity
/// O(samples) for each sounding track.
///
/// # Source
/// McAulay and Quatieri (IEEE TASSP 34(4), 1986), section IV.
pub fn add_tracks(
    tracks: &[Track],
    attacks: &[usize],
    [hop, half_window]: [usize; 2],
    rate: f64,
    out: &mut [f32],
) {
    let step = hop as f64;
    let frames = out.len().div_ceil(hop.max(1));
    // Pieces of each hop, and those that begin with an attack.
    let mut by_hop: Vec<Vec<Piece>> = vec![Vec::new(); frames + 1];
    for track in tracks {
        let [Some(first), Some(last)] = [track.peaks.first(), track.peaks.last()] else { continue };
        let mut peaks = track.peaks.clone();
        let mut phase = first.phase;
        for k in 0..peaks.len() {
            if peaks[k].phase.is_nan() {
                let w = |p: &SinePeak| TAU * p.frequency / rate;
                peaks[k].phase = phase + 0.5 * step * (w(&peaks[k - 1]) + w(&peaks[k]));
            }
            phase = peaks[k].phase;
            if peaks[k].frequency > HIGHEST * rate {
                peaks[k].amplitude = 0.0;
            }
        }
        let end = silent(*last, step, rate);
        let begin =
            SinePeak { amplitude: 0.0, phase: first.phase - TAU * first.frequency / rate * step, ..*first };
        let attack = attack_of(track, attacks, hop, half_window);
        let all = std::iter::once(begin).chain(peaks).chain(std::iter::once(end)).collect::<Vec<_>>();
        for (k, pair) in all.windows(2).enumerate() {
            let Some(frame) = (track.first + k).checked_sub(1).filter(|frame| *frame < frames) else {
                continue;
            };
            let piece = Piece::new(pair[0], pair[1], step, rate);
            match attack.filter(|o| *o + (ATTACK * rate) as usize > frame * hop) {
                Some(o) => add_after_attack(&piece, frame * hop, o, hop, rate, out),
                None => by_hop[frame].push(piece),
            }
        }
    }
    for (out, pieces) in out.chunks_mut(hop.max(1)).zip(&by_hop) {
        pieces.chunks(LANES).for_each(|pieces| add_pieces(pieces, out, step));
    }
}

/// Adds a piece with its part before an attack silent.
fn add_after_attack(piece: &Piece, from: usize, attack: usize, hop: usize, rate: f64, out: &mut [f32]) {
    let ramp = (ATTACK * rate).max(1.0);
    for (n, y) in out.iter_mut().skip(from).take(hop).enumerate() {
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
