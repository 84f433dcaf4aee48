//! Peaks of the normalised cross-correlation of one grain.

use super::transform::Blocks;

/// What a correlation is divided by, and when it is 0.
#[derive(Clone, Debug)]
pub struct Normaliser {
    /// Sum of the squares of the samples before each.
    energy: Vec<f64>,
    /// Amplitude below which a window is silent.
    floor: f64,
    /// Norm of the whole recording, which replaces that of each window.
    global: Option<f64>,
}

impl Normaliser {
    /// For a recording. Windows with a root mean square below `floor_db` of its peak, or below -120 dB of full scale, correlate with nothing.
    #[must_use]
    pub fn new(x: &[f32], floor_db: f64, is_global: bool) -> Self {
        let mut energy = Vec::with_capacity(x.len() + 1);
        let mut sum = 0.0;
        energy.push(sum);
        for x in x {
            sum += f64::from(*x).powi(2);
            energy.push(sum);
        }
        let peak = x.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
        let floor = (f64::from(peak) * 10f64.powf(floor_db / 20.0)).max(1e-6);
        Self { energy, floor, global: is_global.then(|| sum.sqrt()) }
    }

    /// Samples of the recording.
    #[must_use]
    pub fn len(&self) -> usize {
        self.energy.len() - 1
    }

    fn window(&self, t: usize, len: usize) -> f64 {
        (self.energy[(t + len).min(self.len())] - self.energy[t.min(self.len())]).max(0.0)
    }

    /// The norm by which a correlation at `t` is divided, beside that of the grain; `None` in silence.
    #[must_use]
    pub fn norm(&self, t: usize, len: usize) -> Option<f64> {
        let norm = self.window(t, len).sqrt();
        let is_loud = norm >= self.floor * (len as f64).sqrt();
        is_loud.then(|| self.global.unwrap_or(norm))
    }

    /// A bound of [`Self::norm`] from below for all windows that begin in `t .. t + count`.
    #[must_use]
    pub fn least(&self, t: usize, count: usize, len: usize) -> f64 {
        if let Some(norm) = self.global {
            return norm;
        }
        let common = if len > count { self.window(t + count, len - count).sqrt() } else { 0.0 };
        common.max(self.floor * (len as f64).sqrt())
    }

    /// The mean square under a window of a grain.
    #[must_use]
    pub fn weighted_power(x: &[f32], window: impl Iterator<Item = f64>) -> f64 {
        let sum: f64 = x.iter().zip(window).map(|(x, w)| (w * f64::from(*x)).powi(2)).sum();
        sum / x.len().max(1) as f64
    }
}

/// The correlation of a grain with part of a recording.
pub struct GrainCorrelation<'a> {
    /// `sum_n x[t + n] g[n]` for `t` from `first` on.
    pub y: &'a [f32],
    pub first: usize,
    /// Samples and norm of the grain.
    pub len: usize,
    pub norm: f64,
    pub normaliser: &'a Normaliser,
    /// Take peaks of the magnitude.
    pub absolute: bool,
    /// The transforms that computed `y`, whose rounding errors count as if they raised each value; none if it is exact.
    pub blocks: Option<&'a Blocks>,
}

/// Rounding error of a correlation by transforms, relative to the norms of its block and of the grain.
const ROUNDING: f64 = 1e-6;

/// Outputs that are skipped together.
const BLOCK: usize = 64;

impl GrainCorrelation<'_> {
    /// Returns the value whose peaks are taken.
    fn value(&self, y: f32) -> f32 {
        if self.absolute { y.abs() } else { y }
    }

    /// Normalised correlation at a sample of the recording; 0 in silence and outside.
    #[must_use]
    pub fn at(&self, t: usize) -> f64 {
        let Some(y) = t.checked_sub(self.first).and_then(|k| self.y.get(k)) else { return 0.0 };
        if self.norm <= 0.0 {
            return 0.0;
        }
        self.normaliser.norm(t, self.len).map_or(0.0, |norm| f64::from(self.value(*y)) / (norm * self.norm))
    }

    /// Rounding error of `y` at a sample of the recording, relative to the norm of the grain.
    fn noise(&self, t: usize) -> f64 {
        self.blocks.map_or(0.0, |blocks| ROUNDING * f64::from(blocks.norm_at(t - self.first)))
    }

    /// Rounding error of the normalised correlation at a sample.
    #[must_use]
    pub fn error(&self, t: usize) -> f64 {
        self.normaliser.norm(t, self.len).map_or(0.0, |norm| self.noise(t) / norm)
    }

    /// Returns true if `t` is a local maximum: strict to the left, not exceeded to the right; ends count.
    fn is_maximum(&self, t: usize, c: f64) -> bool {
        let left = t.checked_sub(1).is_none_or(|t| t < self.first || c > self.at(t));
        left && c >= self.at(t + 1)
    }

    /// Visits all local maxima in `range` whose correlation, raised by its rounding error, reaches `least`, which is a function of the sample.
    pub fn maxima(
        &self,
        range: std::ops::Range<usize>,
        least: impl Fn(usize) -> f64,
        mut visit: impl FnMut(usize, f64),
    ) {
        let mut t = range.start;
        while t < range.end {
            let count = BLOCK.min(range.end - t);
            let from = t - self.first;
            let part = self.y.get(from..(from + count).min(self.y.len())).unwrap_or_default();
            let top = if self.absolute {
                part.iter().fold(0.0_f32, |top, y| top.max(y.abs()))
            } else {
                part.iter().fold(0.0_f32, |top, y| top.max(*y))
            };
            let wanted = least(t).min(least(t + count - 1));
            let noise = self.noise(t).max(self.noise(t + count - 1));
            let bound = (wanted * self.normaliser.least(t, count, self.len) - noise) * self.norm;
            if f64::from(top) >= bound && top > 0.0 {
                for t in t..t + part.len() {
                    let c = self.at(t);
                    if c > 0.0 && c + self.error(t) >= least(t) && self.is_maximum(t, c) {
                        visit(t, c);
                    }
                }
            }
            t += count;
        }
    }

    /// Returns true if the greedy choice by falling correlation takes the local maximum at `t`: none that it takes before, within `apart`
    /// samples, is greater (or equal and earlier).
    #[must_use]
    pub fn is_taken(&self, t: usize, c: f64, apart: usize) -> bool {
        let range = t.saturating_sub(apart).max(self.first)..(t + apart + 1).min(self.first + self.y.len());
        let mut greater = Vec::new();
        self.maxima(
            range,
            |_| c,
            |u, d| {
                if d > c || (d == c && u < t) {
                    greater.push((u, d));
                }
            },
        );
        greater.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        !greater.into_iter().any(|(u, d)| self.is_taken(u, d, apart))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    fn norm(x: &[f32]) -> f64 {
        x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
    }

    /// All correlations by the definition, and the greedy choice over them.
    fn greedy(x: &[f32], g: &[f32], apart: usize, least: f64) -> Vec<(usize, f64)> {
        let c: Vec<f64> = (0..=x.len() - g.len())
            .map(|t| {
                let dot: f64 = x[t..].iter().zip(g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                dot / (norm(g) * norm(&x[t..t + g.len()]))
            })
            .collect();
        let is_maximum = |t: usize| (t == 0 || c[t] > c[t - 1]) && (t + 1 == c.len() || c[t] >= c[t + 1]);
        let mut maxima: Vec<usize> = (0..c.len()).filter(|t| c[*t] >= least && is_maximum(*t)).collect();
        maxima.sort_by(|a, b| c[*b].total_cmp(&c[*a]).then(a.cmp(b)));
        let mut taken: Vec<usize> = Vec::new();
        for t in maxima {
            if taken.iter().all(|u| u.abs_diff(t) > apart) {
                taken.push(t);
            }
        }
        taken.sort_unstable();
        taken.into_iter().map(|t| (t, c[t])).collect()
    }

    #[test]
    fn taken_maxima_are_those_of_the_greedy_choice() {
        let mut rng = Rng::new(9);
        for trial in 0..20 {
            let n = 700 + rng.below(500);
            let x: Vec<f32> =
                (0..n).map(|k| ((0.11 * k as f64).sin() + rng.between(-0.7, 0.7)) as f32).collect();
            let len = 20 + rng.below(150);
            let from = rng.below(n - len);
            let g = x[from..from + len].to_vec();
            let y: Vec<f32> = (0..=n - len)
                .map(|t| {
                    x[t..].iter().zip(&g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>() as f32
                })
                .collect();
            let normaliser = Normaliser::new(&x, -70.0, false);
            let all = GrainCorrelation {
                y: &y,
                first: 0,
                len,
                norm: norm(&g),
                normaliser: &normaliser,
                absolute: false,
                blocks: None,
            };
            let apart = if trial % 2 == 0 { len / 2 } else { 3 };
            let mut found = Vec::new();
            all.maxima(
                0..y.len(),
                |_| 0.1,
                |t, c| {
                    if all.is_taken(t, c, apart) {
                        found.push((t, c));
                    }
                },
            );
            let want = greedy(&x, &g, apart, 0.1);
            assert_eq!(
                found.iter().map(|p| p.0).collect::<Vec<_>>(),
                want.iter().map(|p| p.0).collect::<Vec<_>>()
            );
            assert!(found.iter().zip(&want).all(|(a, b)| (a.1 - b.1).abs() < 1e-6 && a.1 <= 1.0 + 1e-6));
            assert!(found.iter().any(|(t, c)| *t == from && *c > 0.999));
        }
    }

    #[test]
    fn silence_correlates_with_nothing() {
        let x = [vec![0.5_f32, -0.5, 0.5, -0.5], vec![1e-9; 40]].concat();
        let normaliser = Normaliser::new(&x, -70.0, false);
        assert!(normaliser.norm(0, 4).is_some() && normaliser.norm(20, 4).is_none());
        assert!(Normaliser::new(&[0.0; 50], -70.0, false).norm(0, 4).is_none());
    }
}
