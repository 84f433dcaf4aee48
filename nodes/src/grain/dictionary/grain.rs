//! One grain.

use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A grain: a piece of a recording, with tapers that overlap those of its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grain {
    /// Index of its source.
    pub source: u32,
    /// First sample of its segment in the source.
    pub start: u64,
    /// Samples of its segment.
    pub len: u32,
    /// Samples that the windowed grain has before and after its segment.
    pub reach: [u16; 2],
    /// Samples of its tapers.
    pub taper: [u16; 2],
    /// Factor of the windowed grain that gives it the mean square of its segment if its tapers lie inside, else 1.
    pub gain: f32,
    /// Mean square of the windowed grain, channels averaged.
    pub power: f32,
    /// Centroid of its spectrum, Hz.
    pub centroid: f32,
    /// Index of the run that contains it.
    pub run: u32,
    /// First sample of its segment in the run.
    pub position: u32,
}

impl Grain {
    /// Samples of the windowed grain.
    #[must_use]
    pub fn window_len(&self) -> usize {
        self.len as usize + usize::from(self.reach[0]) + usize::from(self.reach[1])
    }

    /// First sample of the windowed grain in its source.
    #[must_use]
    pub fn window_start(&self) -> u64 {
        self.start - u64::from(self.reach[0])
    }

    /// The windowed grain in its run.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        let start = (self.position as usize).saturating_sub(self.reach[0].into());
        start..start + self.window_len()
    }
}
