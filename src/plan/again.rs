//! A phase laid out anew, when some of what it computes is there already.

use super::{Phase, Plan, PlanOptions};
use crate::diag::Diagnostic;
use crate::graph::Graph;

impl Plan {
    /// Lays out a phase for fewer nodes, in topological order, and with more taps: number, node and port of each.
    ///
    /// `graph` is the planned graph, but that nodes whose outputs come from elsewhere may have no inputs any more. How long
    /// the phase lasts depends on the first `own` taps only, as it did when the graph was planned.
    ///
    /// # Errors
    /// A graph that never ends.
    pub fn again(
        &self,
        graph: &Graph,
        nodes: Vec<usize>,
        taps: &[(usize, (usize, usize))],
        own: usize,
        threads: usize,
    ) -> Result<Phase, Vec<Diagnostic>> {
        let ending = taps.iter().take(own).map(|(_, tap)| *tap).collect();
        let options = PlanOptions { window: self.window, threads, taps: ending, ..PlanOptions::default() };
        Phase::new(graph, &self.shapes, nodes, taps, self.window, &options)
    }
}
