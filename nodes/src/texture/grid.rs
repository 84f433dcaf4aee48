//! Numbers on a grid, and its continuation beyond the border.

use serde::{Deserialize, Serialize};

/// Numbers on a grid, row by row from the top left. Pixel centres lie at integers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` numbers.
    pub samples: Vec<f32>,
}

/// Continuation of an image beyond its border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wrap {
    /// Periodic repetition: tiles.
    #[default]
    Repeat,
    /// Reflection; border pixels appear twice.
    Mirror,
    /// Repetition of the border pixel.
    Clamp,
}

impl Grid {
    /// A grid of the values of a function of column and row.
    #[must_use]
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> f32) -> Self {
        let samples =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| f(x, y)).collect();
        Self { width, height, samples }
    }

    /// Row `y` of the continued image.
    pub(super) fn row(&self, y: i64, wrap: Wrap) -> &[f32] {
        let y = wrap.index(y, self.height);
        self.samples.get(y * self.width..(y + 1) * self.width).unwrap_or_default()
    }
}

impl Wrap {
    /// Index in a row of `len` pixels (at least 1) of pixel `at` of the continued row.
    #[must_use]
    pub fn index(self, at: i64, len: usize) -> usize {
        let n = len.max(1) as i64;
        (match self {
            Self::Repeat => at.rem_euclid(n),
            Self::Mirror => {
                let at = at.rem_euclid(2 * n);
                at.min(2 * n - 1 - at)
            }
            Self::Clamp => at.clamp(0, n - 1),
        }) as usize
    }
}

/// The value of rank `fraction` (0 to 1) among all values; 0 if there are none.
pub(super) fn percentile(values: impl Iterator<Item = f32>, fraction: f64) -> f32 {
    let mut values: Vec<f32> = values.collect();
    let rank = ((values.len() as f64 - 1.0) * fraction).round().max(0.0) as usize;
    if rank >= values.len() {
        return 0.0;
    }
    *values.select_nth_unstable_by(rank, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_continue_beyond_their_ends() {
        let row = |wrap: Wrap| (-4..7).map(|at| wrap.index(at, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    }

    #[test]
    fn percentiles_are_values_of_their_rank() {
        let values = || (0..1001).map(|k| ((k * 10) % 1001) as f32);
        assert_eq!(percentile(values(), 0.999), 999.0);
        assert_eq!(percentile(values(), 0.0), 0.0);
        assert_eq!(percentile(std::iter::empty(), 0.5), 0.0);
    }
}
