//! Interpolation between the samples of a noise profile.

use std::f64::consts::{FRAC_PI_2, PI};

/// Samples that one reading weighs.
pub(super) const TAPS: usize = 32;
/// Number of positions between two samples for which weights are stored.
pub(super) const PHASES: usize = 1024;

/// Weights of the samples at one stored position, and their change up to the next one.
pub(super) type Row = [[f32; TAPS]; 2];

/// Interpolation between the samples of a noise profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseInterp {
    /// A sinc of 32 taps under a squared cosine.
    Sinc32,
    /// Straight lines.
    Linear,
    /// Cubic through the samples.
    Catmull,
    /// Cubic B-spline.
    Bspline3,
}

impl NoiseInterp {
    /// Weight of a sample at a distance.
    pub(super) fn weight(self, x: f64) -> f64 {
        let d = x.abs();
        match self {
            Self::Sinc32 => {
                let sinc = if x == 0.0 { 1.0 } else { libm::sin(PI * x) / (PI * x) };
                let reach = TAPS as f64 / 2.0;
                if d >= reach { 0.0 } else { sinc * libm::cos(FRAC_PI_2 * x / reach).powi(2) }
            }
            Self::Linear => (1.0 - d).max(0.0),
            Self::Catmull if d < 1.0 => 1.0 + d * d * (1.5 * d - 2.5),
            Self::Catmull if d < 2.0 => 2.0 + d * (-4.0 + d * (2.5 - 0.5 * d)),
            Self::Bspline3 if d < 1.0 => 2.0 / 3.0 + d * d * (0.5 * d - 1.0),
            Self::Bspline3 if d < 2.0 => (2.0 - d).powi(3) / 6.0,
            Self::Catmull | Self::Bspline3 => 0.0,
        }
    }
}

/// Weights at all stored positions.
pub(super) fn weights(interp: NoiseInterp) -> Vec<Row> {
    let taps = |phase: usize| -> [f32; TAPS] {
        let position = phase as f64 / PHASES as f64;
        std::array::from_fn(|t| interp.weight(t as f64 - (TAPS / 2 - 1) as f64 - position) as f32)
    };
    let row = |phase: usize| {
        let (here, next) = (taps(phase), taps(phase + 1));
        [here, std::array::from_fn(|t| next[t] - here[t])]
    };
    // A position just below a sample may round up to it.
    (0..=PHASES).map(row).collect()
}
