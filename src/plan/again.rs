//! A phase laid out anew, when some of what it computes is there already.

use super::layout::{self, Parts};
use super::{Phase, Plan, PlanOptions, Region, Resume, TapPlan, schedule};
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
        let delays = schedule::delays(graph, &self.shapes, &nodes, self.window, &Resume::default());
        let duration = schedule::duration(graph, &self.shapes, &nodes, &delays, &options)?;
        let place = |&(tap, (node, port)): &(usize, (usize, usize))| TapPlan {
            tap,
            node,
            port,
            delay: delays.of[node] + self.shapes[node].lag,
            from: 0,
        };
        let taps: Vec<TapPlan> = taps.iter().map(place).collect();
        let (shapes, window) = (&self.shapes[..], self.window);
        let parts = Parts { graph, shapes, nodes: &nodes, delays: &delays, taps: &taps, duration, window };
        let regions = layout::regions(&parts, &layout::cut(&parts, threads, options.worth));
        let bytes = regions.iter().map(Region::bytes).sum();
        let windows = (duration as u64).div_ceil(self.window as u64);
        Ok(Phase { regions, nodes, windows, delays, duration, bytes })
    }
}
