//! The straight pieces that curves are made of.

/// A straight piece of a curve, in the pixels of the image or of one of its repetitions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePiece {
    /// Its number.
    pub number: u32,
    /// Point of the isophotes at the beginning of the segment that this piece is a part of.
    pub point: u32,
    /// Index of the part, and number of parts.
    pub part: [u16; 2],
    /// Both ends of the piece.
    pub ends: [[f64; 2]; 2],
}

/// A piece as the cells store it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub number: u32,
    pub point: u32,
    pub part: [u16; 2],
    pub ends: [[f32; 2]; 2],
    /// True if the cell before it, along x and along y, has it too.
    pub again: [bool; 2],
}

/// Gradient along a piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinearGradient {
    /// Gradient at the start of its segment, and its change up to the end.
    pub start: [f64; 2],
    pub step: [f64; 2],
    /// Fraction of the segment that the piece covers.
    pub part: f64,
    pub parts: f64,
}

impl LinearGradient {
    /// The gradient `along` from 0 to 1 of the piece.
    #[inline(always)]
    pub fn at(&self, along: f64) -> [f64; 2] {
        let t = (self.part + along) / self.parts;
        let t = if t > 0.0 { t } else { 0.0 };
        let t = if t < 1.0 { t } else { 1.0 };
        [self.start[0] + t * self.step[0], self.start[1] + t * self.step[1]]
    }
}

impl Entry {
    /// The piece, in a repetition of the image.
    #[inline(always)]
    pub fn piece(&self, shift: [f64; 2]) -> CurvePiece {
        let Self { number, point, part, .. } = *self;
        let [a, b] = self.ends;
        let at = |p: [f32; 2]| [f64::from(p[0]) + shift[0], f64::from(p[1]) + shift[1]];
        CurvePiece { number, point, part, ends: [at(a), at(b)] }
    }
}

/// The side of a line on which a position lies, by its sign: 0 on the line.
#[inline(always)]
pub(in crate::scrape) fn across([a, b]: &[[f64; 2]; 2], p: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_point_of_a_curve_is_crossed_once() {
        // Two pieces that meet on the chord's line.
        let chord = [[0.0, 1.0], [2.0, 1.0]];
        let crosses = |ends: [[f64; 2]; 2]| {
            let [a, b] = ends.map(|p| across(&chord, p));
            let [c, d] = chord.map(|p| across(&ends, p));
            (a >= 0.0) != (b >= 0.0) && (c >= 0.0) != (d >= 0.0)
        };
        for tilt in [-0.5, 0.0, 0.7] {
            let (low, middle, high) = ([1.0 - tilt, 0.0], [1.0, 1.0], [1.0 + tilt, 2.0]);
            assert!(crosses([low, middle]) != crosses([middle, high]), "{tilt}");
        }
        // A corner that only touches it is crossed twice or not at all.
        let touch = [[[0.5, 2.0], [1.0, 1.0]], [[1.0, 1.0], [1.5, 2.0]]];
        assert_eq!(crosses(touch[0]), crosses(touch[1]));
    }
}
