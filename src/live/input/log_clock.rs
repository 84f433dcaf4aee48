//! Times of a log that is sent as if it happened now.

use super::hub::{Hub, Moment};
use foley_nodes::core::time::{Tick, ticks};
use std::time::Duration;

/// Latest time of a log, s.
pub const MAX_LOG: f64 = 1e6;
/// Time by which messages are delivered early, s, so that they are read at their own tick.
const AHEAD: f64 = 0.5;
/// Pause between looks at the clock of the piece.
const POLL: Duration = Duration::from_millis(5);

/// Converts times of a log to ticks of the piece that plays, and waits until they are due.
///
/// The first time of a log is [`AHEAD`] from now, and all others follow by their differences, whenever their lines arrive. A log that is sent
/// before the graph plays begins with it, and one that is sent while another piece begins starts again at the next line.
#[derive(Debug, Default)]
pub struct LogClock {
    /// The first time, and its tick in the piece.
    origin: Option<(f64, Moment)>,
}

impl LogClock {
    /// Returns the tick of a time in seconds, [`AHEAD`] or less before it is due.
    pub fn tick(&mut self, seconds: f64, hub: &Hub) -> Tick {
        loop {
            if let Some(now) = hub.moment() {
                let origin = self.origin.filter(|(_, start)| start.piece == now.piece);
                let begin = now.tick.saturating_add(ticks(AHEAD));
                let (first, start) = origin.unwrap_or((seconds, Moment { tick: begin, ..now }));
                self.origin = Some((first, start));
                let tick = start.tick.saturating_add(ticks(seconds - first));
                if tick <= begin {
                    return tick;
                }
            }
            std::thread::sleep(POLL);
        }
    }
}
