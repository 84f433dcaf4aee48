//! The exact programme for a target in real time: each unit is decided a fixed time after it.

use super::front::{Decisions, Front, Price, Scratch};
use super::path::GlobalParams;
use super::repair::{new_history, substitute};
use super::table::Table;
use crate::impl_state;
use crate::unit::selection::history::History;
use crate::unit::selection::selector::{Choice, NotFinite};

/// Chooses unit by unit from the best path to the latest known unit of the target.
///
/// Committed picks are final, so that a pick may jump where no path does; its distance from the best path shrinks as
/// the lag grows. Units that recur too early are replaced when they are
/// committed.
///
/// # Complexity
/// Time as of [`exact`](super::exact()) for a unit, at most O(m dims + lag); O(m dims + m lag / 8) memory, nearly all of it allocated at the start.
///
/// # Source
/// Forney, "The Viterbi algorithm" (1973), section III on truncated survivors.
#[derive(Debug)]
pub struct FixedLag {
    table: Table,
    params: GlobalParams,
    price: Price,
    front: Front,
    scratch: Scratch,
    decisions: Decisions,
    /// Rows with stored decisions.
    capacity: usize,
    /// Number of known rows.
    rows_read: usize,
    /// Rows that are decided.
    decided: usize,
    history: History,
    replaced: usize,
}
impl_state!(FixedLag { front, decisions, rows_read, decided, history, replaced });

impl FixedLag {
    /// Creates the state before the first unit; each choice reads `lag` units after its own.
    #[must_use]
    pub fn new(table: Table, params: GlobalParams, lag: usize) -> Self {
        let count = table.count();
        Self {
            front: Front::start(count),
            scratch: Scratch::new(count),
            decisions: Decisions::new(count, lag + 1),
            capacity: lag + 1,
            rows_read: 0,
            decided: 0,
            history: new_history(&table, &params),
            replaced: 0,
            price: Price::new(&params),
            table,
            params,
        }
    }

    /// Chooses for the next unit of the target.
    ///
    /// # Shapes
    /// `window`: `[units * dims]`, the unit and the known ones after it, at most as many as the lag.
    ///
    /// # Errors
    /// A feature that is not finite, or no unit at all.
    pub fn choose(&mut self, window: &[f32]) -> Result<Choice, NotFinite> {
        let dims = self.table.dims();
        NotFinite::check(window, dims)?;
        for features in window.chunks_exact(dims).take(self.capacity).skip(self.rows_read - self.decided) {
            self.read_row(features);
        }
        let mut column = self.front.best;
        for row in (self.decided + 1..self.rows_read).rev() {
            column = self.decisions.before(row % self.capacity, column);
        }
        let features = &window[..dims];
        let wanted = column;
        column = substitute(&self.history, &self.table, features, wanted, &self.params);
        self.replaced += usize::from(column != wanted);
        self.history.record(column as u32);
        self.decided += 1;
        let d1 = self.table.distance(features, column);
        Ok(Choice { unit: self.table.unit(column), d1, d2: d1, ..Choice::default() })
    }

    /// Number of units of the best path that recurred too early.
    #[must_use]
    pub fn replaced(&self) -> usize {
        self.replaced
    }

    fn read_row(&mut self, features: &[f32]) {
        let decisions = Some((&mut self.decisions, self.rows_read % self.capacity));
        self.front.advance(&self.table, self.price, features, &[], &mut self.scratch, decisions);
        self.rows_read += 1;
    }
}
