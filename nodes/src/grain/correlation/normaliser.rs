//! The normaliser of correlations: the norm under each window of a recording.

use crate::dsp::db_to_linear;
use fearless_simd::{Level, dispatch};

/// Number of outputs that are skipped, or normalised, together.
pub const BLOCK: usize = 64;

/// Norms by which correlations are divided, and the floor below which a correlation is 0.
#[derive(Clone, Debug)]
pub struct Normaliser {
    /// Sum of the squares of the samples before each.
    energy: Vec<f64>,
    /// Amplitude below which a window is silent.
    floor: f64,
    /// Norm of the whole recording, which replaces that of each window.
    global: Option<f64>,
    level: Level,
}

impl Normaliser {
    /// Creates the norms of a recording. Windows with a root mean square below `floor_db` of its peak, or below -120 dB of full scale, have no correlation.
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
        let floor = (f64::from(peak) * db_to_linear(floor_db)).max(1e-6);
        Self { energy, floor, global: is_global.then(|| sum.sqrt()), level: Level::new() }
    }

    /// Samples of the recording.
    #[must_use]
    pub fn len(&self) -> usize {
        self.energy.len() - 1
    }

    fn window(&self, t: usize, len: usize) -> f64 {
        (self.energy[(t + len).min(self.len())] - self.energy[t.min(self.len())]).max(0.0)
    }

    /// Energy of the samples that all windows have that begin in `t .. t + count`.
    fn common(&self, t: usize, count: usize, len: usize) -> f64 {
        if len > count { self.window(t + count, len - count) } else { 0.0 }
    }

    /// The norm by which a correlation at `t` is divided, beside that of the grain; `None` in silence.
    #[must_use]
    pub fn norm(&self, t: usize, len: usize) -> Option<f64> {
        let norm = self.window(t, len).sqrt();
        let is_loud = norm >= self.floor * (len as f64).sqrt();
        is_loud.then(|| self.global.unwrap_or(norm))
    }

    /// Divides correlations by the norms of windows of `len` samples, of which the first begins at `t`, and of the grain; they are 0 in
    /// silence, and magnitudes if `absolute`. No window ends after the recording.
    ///
    /// # Shapes
    /// `y`, `c`: the same number of windows.
    pub fn normalise(&self, t: usize, (len, norm): (usize, f64), absolute: bool, y: &[f32], c: &mut [f32]) {
        let before = &self.energy[t..t + y.len()];
        let after = &self.energy[t + len..t + len + y.len()];
        let floor = self.floor * (len as f64).sqrt();
        dispatch!(self.level, _simd => divide([before, after], floor, self.global, (norm, absolute), y, c));
    }

    /// A bound of [`Self::norm`] from below for all windows that begin in `t .. t + count`.
    #[must_use]
    pub fn least(&self, t: usize, count: usize, len: usize) -> f64 {
        if let Some(norm) = self.global {
            return norm;
        }
        self.common(t, count, len).sqrt().max(self.floor * (len as f64).sqrt())
    }

    /// As [`Self::least`], found in parts of `count`, since the bound is tighter for few windows.
    #[must_use]
    pub fn least_of(&self, t: usize, count: usize, len: usize) -> f64 {
        if let Some(norm) = self.global {
            return norm;
        }
        let parts = (t..t + count).step_by(BLOCK).map(|t| self.common(t, BLOCK, len));
        parts.fold(f64::INFINITY, f64::min).sqrt().max(self.floor * (len as f64).sqrt())
    }

    /// The mean square under a window of a grain.
    #[must_use]
    pub fn weighted_power(x: &[f32], window: impl Iterator<Item = f64>) -> f64 {
        let sum: f64 = x.iter().zip(window).map(|(x, w)| (w * f64::from(*x)).powi(2)).sum();
        sum / x.len().max(1) as f64
    }
}

/// Correlations `y` divided by the norms of their windows, whose energies are differences of sums; all instruction sets compute the same bits.
#[inline(always)]
fn divide(
    [before, after]: [&[f64]; 2],
    floor: f64,
    global: Option<f64>,
    (grain, absolute): (f64, bool),
    y: &[f32],
    c: &mut [f32],
) {
    for (((c, y), before), after) in c.iter_mut().zip(y).zip(before).zip(after) {
        let norm = (after - before).max(0.0).sqrt();
        let y = if absolute { y.abs() } else { *y };
        let value = f64::from(y) / (global.unwrap_or(norm) * grain);
        *c = if norm >= floor { value as f32 } else { 0.0 };
    }
}
