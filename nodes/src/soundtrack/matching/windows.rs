//! The windows of a motion: their frames, their sums, and what normalises them.

use super::pattern::{Grid, Normalisation, Scratch, normaliser};
use crate::soundtrack::motion::MotionCurve;

/// The windows of a motion.
pub struct Windows<'a> {
    curve: &'a MotionCurve,
    normalisation: Normalisation,
    /// Sums of values and of squares before each frame, by channel.
    sums: Vec<[f64; 2]>,
    /// Frames in gaps before each frame.
    gaps: Vec<u32>,
}

impl<'a> Windows<'a> {
    /// The windows of a valid motion.
    ///
    /// # Complexity
    /// O(numbers of the motion).
    pub fn new(curve: &'a MotionCurve, normalisation: Normalisation) -> Self {
        let channels = curve.channels;
        let mut sums = vec![[0.0; 2]; channels];
        for (k, x) in curve.values.iter().enumerate() {
            let [sum, squares] = sums[k];
            sums.push([sum + f64::from(*x), squares + f64::from(*x).powi(2)]);
        }
        let mut gaps = vec![0; curve.frames() + 1];
        for (from, to) in &curve.gaps {
            gaps.get_mut(from + 1..=*to).into_iter().for_each(|gap| gap.fill(1));
        }
        let mut total = 0;
        gaps.iter_mut().for_each(|g| {
            total += *g;
            *g = total;
        });
        Self { curve, normalisation, sums, gaps }
    }

    /// The number of windows of a length.
    pub fn starts(&self, grid: &Grid) -> usize {
        self.curve.frames() + 1 - grid.len
    }

    /// The frames of a window.
    pub fn window(&self, grid: &Grid, start: usize) -> &[f32] {
        &self.curve.values[start * self.curve.channels..(start + grid.len) * self.curve.channels]
    }

    /// Finds the normalisation of each channel of a window; returns false if the window has a gap.
    pub fn normalise(&self, grid: &Grid, start: usize, scratch: &mut Scratch) -> bool {
        let channels = self.curve.channels;
        scratch.normal.clear();
        scratch.normal.extend(
            (0..channels).map(|c| normaliser(self.normalisation, self.sums(grid, start, c), grid.len as f64)),
        );
        self.gaps[start + grid.len] == self.gaps[start]
    }

    /// Sums of the values and of the squares of a channel of a window.
    pub fn sums(&self, grid: &Grid, start: usize, channel: usize) -> [f64; 2] {
        let at = |frame: usize| self.sums[frame * self.curve.channels + channel];
        let (a, b) = (at(start), at(start + grid.len));
        [b[0] - a[0], b[1] - a[1]]
    }
}
