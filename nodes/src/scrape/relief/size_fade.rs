//! Cross-fades between sizes of a surface.

use crate::scrape::force::ramp::RAMP_TIME;
use crate::scrape::force::segment::{CELL, Cell, Segment};
use crate::scrape::path::piece::PathPiece;

/// A size that changes to another one by a cross-fade of [`RAMP_TIME`] seconds between the sounds at both sizes. A
/// gliding size would sweep the positions far from the corner of a surface.
///
/// A third size that is set during a cross-fade follows it; the newest counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeFade {
    from: f64,
    to: f64,
    next: Option<f64>,
    start: i64,
    samples: i64,
}

impl SizeFade {
    /// A constant size.
    #[must_use]
    pub fn new(size: f64, rate: f64) -> Self {
        let samples = (RAMP_TIME * rate).max(1.0) as i64;
        Self { from: size, to: size, next: None, start: i64::MIN / 2, samples }
    }

    /// Starts a cross-fade to another size at a sample.
    pub fn ramp_to(&mut self, size: f64, sample: i64) {
        if let Some(next) = self.next.filter(|_| sample >= self.start + self.samples) {
            (self.from, self.to, self.next, self.start) = (self.to, next, None, self.start + self.samples);
        }
        if sample < self.start + self.samples {
            self.next = (size != self.to).then_some(size);
        } else if size != self.to {
            (self.from, self.to, self.start) = (self.to, size, sample);
        }
    }

    /// Returns the progress from the first size to the second, and from there to the third, 0 to 1.
    fn progress(&self, sample: i64) -> [f64; 2] {
        let fraction = |start: i64| ((sample - start) as f64 / self.samples as f64).clamp(0.0, 1.0);
        [fraction(self.start), if self.next.is_some() { fraction(self.start + self.samples) } else { 0.0 }]
    }

    /// Weights of both sizes and of the third.
    fn weights(&self, sample: i64) -> [f64; 3] {
        let [one, two] = self.progress(sample);
        [1.0 - one, one * (1.0 - two), two]
    }

    /// The size with the largest weight at a sample; of equal ones the newest.
    #[must_use]
    pub fn dominant(&self, sample: i64) -> f64 {
        let [first, second, third] = self.weights(sample);
        match self.next {
            Some(next) if third >= first.max(second) => next,
            _ if second >= first => self.to,
            _ => self.from,
        }
    }

    /// Calls `draw` for each size that sounds over a segment, with the size and the segment as it lies on the surface of size 1.
    pub fn add(&self, segment: &Segment, out: &mut [f32], mut draw: impl FnMut(f64, &Segment, &mut [f32])) {
        let sizes = [Some(self.from), Some(self.to), self.next];
        let weights = |n: usize| self.weights(segment.anchor + n as i64);
        let ends = [weights(segment.from), weights(segment.to.saturating_sub(1))];
        for (k, size) in sizes.into_iter().enumerate() {
            // Weights are straight lines with corners: one that is 0 at both ends may not be in between.
            let silent = ends[0][k] == 0.0 && ends[1][k] == 0.0 && ends[0] == ends[1];
            let Some(size) = size.filter(|_| !silent) else { continue };
            let mut scaled = *segment;
            scaled.piece = resized(&segment.piece, size);
            let mut cell: Cell = [0.0; CELL];
            let made = segment.part(&mut cell);
            draw(size, &scaled, made);
            for (n, (out, x)) in (segment.from..).zip(out.iter_mut().zip(made)) {
                *out += *x * (weights(n)[k] * size) as f32;
            }
        }
    }
}

/// A piece as it lies on a surface of size 1.
fn resized(piece: &PathPiece, size: f64) -> PathPiece {
    let smaller = |c: [[f64; 2]; 4]| c.map(|c| c.map(|x| x / size));
    PathPiece { position: smaller(piece.position), other: piece.other.map(smaller), ..*piece }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_each_other_and_the_newest_counts() {
        let mut size = SizeFade::new(1.0, 1000.0);
        assert_eq!(size.progress(-5), [1.0, 0.0]);
        size.ramp_to(2.0, 100);
        assert_eq!([100, 110, 120].map(|n| size.progress(n)[0]), [0.0, 0.5, 1.0]);
        assert_eq!([100, 109, 110, 500].map(|n| size.dominant(n)), [1.0, 1.0, 2.0, 2.0]);
        size.ramp_to(3.0, 104);
        size.ramp_to(4.0, 110);
        assert_eq!(
            [110, 120, 130, 150].map(|n| size.progress(n)),
            [[0.5, 0.0], [1.0, 0.0], [1.0, 0.5], [1.0, 1.0]]
        );
        assert_eq!([109, 110, 129, 130, 150].map(|n| size.dominant(n)), [1.0, 2.0, 2.0, 4.0, 4.0]);
        size.ramp_to(5.0, 130);
        assert_eq!((size.from, size.to, size.next, size.start), (2.0, 4.0, Some(5.0), 120));
        size.ramp_to(4.0, 135);
        assert_eq!(size.next, None);
        size.ramp_to(7.0, 160);
        assert_eq!((size.from, size.to, size.start), (4.0, 7.0, 160));
    }
}
