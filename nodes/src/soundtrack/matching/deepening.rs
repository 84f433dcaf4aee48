//! Iterative deepening: windows are left out by distances of piecewise means.

use super::dtw::squared_distance;
use super::pattern::{Grid, Pattern, Scratch};
use super::windows::Windows;
use crate::core::random::Rng;
use crate::statistics::normal::normal_quantile;

/// Windows of the motion from which the errors are estimated.
const TRAINING: usize = 256;
/// Piecewise means of the first level; each further one has twice as many.
const COARSEST: usize = 4;

/// Means over `count` consecutive pieces of frames of `channels` numbers, which differ by at most a frame in length.
fn piecewise_means(x: &[f32], channels: usize, count: usize, out: &mut Vec<f32>) {
    let frames = x.len() / channels;
    out.clear();
    for piece in 0..count {
        let (from, to) = (piece * frames / count, (piece + 1) * frames / count);
        out.extend((0..channels).map(|c| {
            let sum: f64 = (from..to).map(|k| f64::from(x[k * channels + c])).sum();
            (sum / (to - from) as f64) as f32
        }));
    }
}

/// A number of piecewise means.
struct Level {
    /// Means of the query.
    query: Vec<f32>,
    /// Means, and means that one may be off.
    count: usize,
    radius: usize,
    /// Squared distance of the means above which a window is left out.
    most: f64,
}

/// Levels of piecewise means from coarse to fine, with the errors of their distances.
///
/// The distance of `m` means, times `sqrt(n / m)` for `n` frames, estimates the distance `D` of dynamic time warping, and is no bound of it. Its error
/// is taken as normal, with mean and deviation learnt from windows of the motion. A window whose distance is below the limit with a probability less
/// than the tolerance is left out.
///
/// # Source
/// Chu, Keogh, Hart and Pazzani, "Iterative deepening dynamic time warping for time series" (SDM 2002).
pub struct Deepening {
    levels: Vec<Level>,
    channels: usize,
    /// Frames of the query.
    frames: usize,
}

impl Deepening {
    /// Estimates the errors of each level from windows of the motion.
    ///
    /// # Complexity
    /// Some hundred comparisons.
    pub fn learn(pattern: &Pattern, motion: &Windows<'_>, grids: &[Grid], tolerance: f64) -> Self {
        let counts =
            std::iter::successors(Some(COARSEST), |m| Some(2 * m)).take_while(|m| *m < pattern.frames);
        let levels = counts.map(|count| {
            let mut means = Vec::new();
            piecewise_means(&pattern.values, pattern.channels, count, &mut means);
            let radius = (pattern.rules.radius * count as f64).ceil() as usize;
            Level { query: means, count, radius, most: f64::INFINITY }
        });
        let mut own = Self { levels: levels.collect(), channels: pattern.channels, frames: pattern.frames };
        let (mut scratch, mut rng) = (Scratch::default(), Rng::new(0));
        let mut errors = vec![Vec::new(); own.levels.len()];
        for _ in 0..TRAINING {
            let grid = &grids[rng.below(grids.len())];
            let start = rng.below(motion.starts(grid));
            if motion.normalise(grid, start, &mut scratch) {
                let exact = pattern.distance(grid, motion.window(grid, start), &mut scratch, f64::INFINITY);
                let exact = exact.map_or(f64::INFINITY, f64::sqrt);
                for (level, errors) in own.levels.iter().zip(&mut errors) {
                    let estimate = own.estimate(level, &mut scratch, f64::INFINITY);
                    errors.extend(estimate.map(|e| exact - e.sqrt()).filter(|e| e.is_finite()));
                }
            }
        }
        for (level, errors) in own.levels.iter_mut().zip(&errors).filter(|(_, errors)| errors.len() > 1) {
            let n = errors.len() as f64;
            let mean = errors.iter().sum::<f64>() / n;
            let deviation = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            // The probability that the distance, estimate plus error, is within the limit is the tolerance here.
            let estimate = pattern.most.sqrt() - mean - deviation * normal_quantile(tolerance);
            level.most = estimate.max(0.0).powi(2);
        }
        own
    }

    /// The square of a level's estimate of the distance of the window of `scratch`, if it is at most `most`.
    fn estimate(&self, level: &Level, scratch: &mut Scratch, most: f64) -> Option<f64> {
        let Scratch { window, pieces, rows, .. } = scratch;
        piecewise_means(window, self.channels, level.count, pieces);
        let scale = self.frames as f64 / level.count as f64;
        squared_distance(&level.query, pieces, self.channels, level.radius, most / scale, rows)
            .map(|squared| scale * squared)
    }

    /// True if no level leaves out the window that was last written to `scratch`.
    pub fn passes(&self, scratch: &mut Scratch) -> bool {
        self.levels.iter().all(|level| self.estimate(level, scratch, level.most).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_pieces_of_nearly_equal_length() {
        let mut out = Vec::new();
        // Two channels of five frames.
        piecewise_means(&[0.0, 1.0, 2.0, 1.0, 4.0, 1.0, 6.0, 1.0, 8.0, 1.0], 2, 2, &mut out);
        assert_eq!(out, [1.0, 1.0, 6.0, 1.0]);
    }
}
