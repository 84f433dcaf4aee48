//! Options of a plan.

use foley_nodes::core::time::{TICKS_PER_SECOND, Tick};

/// Settings of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanOptions {
    /// Length of one window, ticks.
    pub window: Tick,
    /// Threads that compute.
    pub threads: usize,
    /// Time at which an endless graph is stopped.
    pub until: Option<Tick>,
    /// Minimum compute time of a region per window, ns: with less, the cost of passing windows on exceeds the gain.
    pub min_region_ns: f64,
    /// Maximum bytes of all buffers.
    pub memory: usize,
    /// Outputs to write to files: node and port.
    pub taps: Vec<(usize, usize)>,
    /// Outputs that are observed where their nodes run anyway: no node runs for them, and no phase takes longer. Their numbers follow those of
    /// the taps.
    pub observed: Vec<(usize, usize)>,
}

/// The default window, 20 ms: long enough to pay for passing it on, short enough to stay in the processor's cache.
pub const WINDOW: Tick = TICKS_PER_SECOND / 50;

impl Default for PlanOptions {
    fn default() -> Self {
        Self {
            window: WINDOW,
            threads: 1,
            min_region_ns: 200_000.0,
            until: None,
            memory: 4 << 30,
            taps: Vec::new(),
            observed: Vec::new(),
        }
    }
}
