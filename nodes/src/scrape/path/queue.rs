//! Queue of pieces of paths that are known before their time.

use super::piece::PathPiece;
use crate::core::time::Tick;
use crate::impl_state;

/// Pieces in the order of their starts; it never grows beyond its room.
#[derive(Clone, Debug)]
pub struct Queue {
    pieces: Vec<(Tick, PathPiece)>,
    room: usize,
    /// Pieces beyond the capacity.
    pub left_out: u64,
}
impl_state!(Queue { pieces, left_out });

impl Queue {
    /// Allocates memory for `room` pieces.
    #[must_use]
    pub fn new(room: usize) -> Self {
        Self { pieces: Vec::with_capacity(room), room, left_out: 0 }
    }

    /// Adds a piece that starts at a time.
    ///
    /// Later pieces of the same path are replaced.
    pub fn push(&mut self, tick: Tick, piece: PathPiece) {
        self.cut(tick, &piece);
        if self.pieces.len() >= self.room {
            self.left_out += 1;
            return;
        }
        let at = self.pieces.partition_point(|(t, _)| *t <= tick);
        self.pieces.insert(at, (tick, piece));
    }

    /// Removes the part of the path of a piece from a time on.
    pub fn cut(&mut self, tick: Tick, piece: &PathPiece) {
        let key = |p: &PathPiece| (p.contact, p.jump);
        self.pieces.retain(|(t, p)| *t < tick || key(p) != key(piece));
    }

    /// Removes the pieces that start before a time.
    pub fn give(&mut self, until: Tick, mut take: impl FnMut(Tick, PathPiece)) {
        let count = self.pieces.partition_point(|(t, _)| *t < until);
        for (tick, piece) in self.pieces.drain(..count) {
            take(tick, piece);
        }
    }

    /// Adopts the content of another one of the same size.
    pub fn take_state(&mut self, old: &Self) {
        if self.room == old.room {
            self.pieces.clone_from(&old.pieces);
            self.left_out = old.left_out;
        }
    }
}
