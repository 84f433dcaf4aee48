//! Numbers on a grid, and what lies beyond its border.

use serde::{Deserialize, Serialize};

/// Numbers on a grid, row by row from the top left; pixel centres lie at integers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` numbers.
    pub samples: Vec<f32>,
}

/// What lies beyond the border of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wrap {
    /// The image again: tiles.
    #[default]
    Repeat,
    /// The image mirrored, its border pixel twice.
    Mirror,
    /// The pixel of the border for ever.
    Clamp,
}

impl Grid {
    /// A grid of a function of column and row.
    #[must_use]
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> f32) -> Self {
        let samples =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| f(x, y)).collect();
        Self { width, height, samples }
    }

    /// Row `y` of the endless image.
    pub(super) fn row(&self, y: i64, wrap: Wrap) -> &[f32] {
        let y = wrap.place(y, self.height);
        self.samples.get(y * self.width..(y + 1) * self.width).unwrap_or_default()
    }
}

impl Wrap {
    /// The place inside a row of `len` pixels (at least 1) that place `at` of the endless row shows.
    #[must_use]
    pub fn place(self, at: i64, len: usize) -> usize {
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

/// The value that the part `part` of all values does not exceed, by size.
pub(super) fn percentile(values: impl Iterator<Item = f32>, part: f64) -> f32 {
    let mut values: Vec<f32> = values.collect();
    let at = ((values.len() as f64 - 1.0) * part).round().max(0.0) as usize;
    if at >= values.len() {
        return 0.0;
    }
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_go_on_beyond_their_ends_as_said() {
        let row = |wrap: Wrap| (-4..7).map(|at| wrap.place(at, 3)).collect::<Vec<_>>();
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
