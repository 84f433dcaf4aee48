//! Segments: the samples of one piece of a path that are computed at once.
//!
//! Time is cut into [`CELL`]s of 64 samples that begin at multiples of 64, whatever the windows. A piece is evaluated from an
//! anchor, which is the first of its samples in a cell: anchored in double precision, small enough from there for single
//! precision, and the same however the samples are cut into calls.

use crate::core::time::{Rate, TICKS_PER_SECOND, Tick};
use crate::scrape::path::piece::{PathPiece, position, shifted};

/// Samples from one anchor to the next.
pub const CELL: usize = 64;

/// One number for each sample from an anchor on.
pub type Cell = [f32; CELL];

/// Samples to compute of one piece of a path, all in one cell.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// The piece.
    pub piece: PathPiece,
    /// Reference sample: the first one of the piece in this cell.
    pub anchor: i64,
    /// First sample to compute, counted from the anchor.
    pub from: usize,
    /// The sample after the last, at most [`CELL`].
    pub to: usize,
    /// Samples per second.
    pub rate: f64,
    /// Position of the anchor in the piece, 0 to 1.
    s: f64,
    /// Step from one sample to the next, as a fraction of the piece.
    step: f64,
}

impl Segment {
    pub(super) fn new(piece: &PathPiece, start: Tick, anchor: i64, rate: Rate) -> Self {
        let duration = piece.duration.max(1) as f64;
        Self {
            piece: *piece,
            anchor,
            from: 0,
            to: 0,
            rate: rate.as_f64(),
            s: (rate.tick(anchor) - start) as f64 / duration,
            step: TICKS_PER_SECOND as f64 / rate.as_f64() / duration,
        }
    }

    /// Polynomial of the position in samples from the anchor, m.
    #[must_use]
    pub fn path(&self) -> [[f64; 2]; 4] {
        shifted(&self.piece.position, self.s, self.step)
    }

    /// The same on the other surface.
    #[must_use]
    pub fn other_path(&self) -> Option<[[f64; 2]; 4]> {
        self.piece.other.as_ref().map(|c| shifted(c, self.s, self.step))
    }

    /// The position `n` samples after the anchor, m.
    #[must_use]
    pub fn position(&self, n: f64) -> [f64; 2] {
        position(&self.piece.position, self.s + n * self.step)
    }

    /// Normal force, at least 0, N.
    pub fn force(&self, out: &mut Cell) {
        let [a, b] = self.piece.force;
        self.line(a, b, out);
        self.part(out).iter_mut().for_each(|f| *f = f.max(0.0));
    }

    /// Amplitude.
    pub fn gain(&self, out: &mut Cell) {
        let [a, b] = self.piece.gain;
        self.line(a, b, out);
    }

    fn line(&self, a: f32, b: f32, out: &mut Cell) {
        let slope = f64::from(b - a);
        let (at, step) = ((f64::from(a) + self.s * slope) as f32, (self.step * slope) as f32);
        for (n, x) in out.iter_mut().enumerate() {
            *x = at + n as f32 * step;
        }
    }

    /// The samples to compute, of one number for each.
    #[must_use]
    pub fn part<'a>(&self, cell: &'a mut Cell) -> &'a mut [f32] {
        cell.get_mut(self.from..self.to).unwrap_or_default()
    }
}
