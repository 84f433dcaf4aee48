//! Counts of the picks of a channel, for the summary of a run.

use serde::{Deserialize, Serialize};

use super::picks::Pick;
use crate::core::node::Summary;

/// Minimum share of units without a near enough match that is reported.
const MAX_FALLBACK_SHARE: f64 = 0.2;

/// Counts of the picks of a channel.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Counts {
    picks: u64,
    fallbacks: u64,
    /// Searches that were abandoned.
    pub cut: u64,
    runs: u64,
    sum_d1: f64,
    last: Option<i32>,
}

impl Counts {
    /// The pick where nothing is chosen: the last unit, inaudible.
    pub fn inactive_pick(&self) -> Pick {
        Pick { unit: self.last.unwrap_or(0), asleep: true, ..Pick::default() }
    }

    pub fn record(&mut self, pick: &Pick) {
        self.picks += 1;
        self.fallbacks += u64::from(pick.fallback);
        self.runs += u64::from(self.last.is_some_and(|last| last + 1 == pick.unit));
        self.sum_d1 += f64::from(pick.d1);
        self.last = Some(pick.unit);
    }

    /// Units that were chosen for.
    pub fn picked(channels: impl Iterator<Item = Self>) -> u64 {
        channels.map(|c| c.picks).sum()
    }

    /// The counters of all channels, for the report, and a warning if many units had no near enough match.
    pub fn summary(channels: impl Iterator<Item = Self> + Clone, d_max: f64) -> Summary {
        let sum = |get: fn(&Self) -> f64| channels.clone().map(|c| get(&c)).sum::<f64>();
        let picks = sum(|c| c.picks as f64);
        let share = |x: f64| if picks > 0.0 { x / picks } else { 0.0 };
        let fallbacks = share(sum(|c| c.fallbacks as f64));
        let mut summary: Summary = vec![
            ("picks", (picks as u64).into()),
            ("fallback_share", fallbacks.into()),
            ("run_share", share(sum(|c| c.runs as f64)).into()),
            ("mean_d1", share(sum(|c| c.sum_d1)).into()),
        ];
        if fallbacks > MAX_FALLBACK_SHARE {
            let text = format!(
                "{:.0} % of the units have no unit of the database within `d_max` {d_max}: add recordings of the missing sounds, mark \
                 correspondences or change them, or raise `d_max` (SelectionReport lists these units)",
                100.0 * fallbacks
            );
            summary.push(("warning", text.into()));
        }
        summary
    }
}
