//! Makes what runs in the callback, and what runs ahead of it, from a plan.

use super::callback::Act;
use super::crew::{Gang, Pace};
use super::link::{self, Receiver, Sender};
use super::meter::Histogram;
use super::sink::Sink;
use crate::diag::Diagnostic;
use crate::plan::{Export, Import, LivePlan, PlanNode, Region, What};
use crate::run::{self, Site, Values};
use foley_nodes::core::buffer::Budget;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::stage::{Cx, Stage};
use foley_nodes::dsp::Dropout;
use std::any::Any;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Seconds from sound to silence where none arrives.
const RAMP: f64 = 0.005;

/// Stands where a node will be that plays elsewhere until the swap.
pub struct Empty;

impl DynNode for Empty {
    fn run(&mut self, _: &Cx<'_>) -> Result<(), Fault> {
        Err(Fault::new("F099", "a node was not moved: a defect in foley"))
    }
    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// What a layout is made of.
pub struct Layout<'a> {
    /// What is laid out.
    pub plan: &'a LivePlan,
    /// Ids of its nodes.
    pub ids: &'a [String],
    /// Where its nodes are built.
    pub site: Site<'a>,
    /// Its values.
    pub values: &'a Values,
    /// Nodes that are new, as far as they have been built already.
    pub built: HashMap<usize, Box<dyn DynNode>>,
    /// Where nodes that go on were before.
    pub moved: &'a HashMap<usize, usize>,
    /// How windows follow each other.
    pub pace: Pace,
    /// Whether the time in each node is measured.
    pub metered: bool,
}

impl Layout<'_> {
    fn make(&mut self, job: What) -> Result<Box<dyn DynNode>, Diagnostic> {
        match job {
            What::Node(n) if self.moved.contains_key(&n) => Ok(Box::new(Empty)),
            What::Node(n) => match self.built.remove(&n) {
                Some(node) => Ok(node),
                None => self.site.build(n, self.values),
            },
            What::Tap(k) => {
                let link = &self.plan.heard[k].link;
                let width = self.site.shapes[link.node].outputs[link.port].as_ref().map_or(1, |s| s.width);
                Ok(Box::new(Sink::new(width, self.pace.quantum, self.ramp())))
            }
        }
    }

    /// Frames from sound to silence where none arrives.
    fn ramp(&self) -> usize {
        (self.pace.rate.as_f64() * RAMP) as usize
    }

    /// Makes all parts, which begin with window `window`.
    ///
    /// # Errors
    /// The faults of all nodes that could not be built.
    pub fn parts(
        mut self,
        window: u64,
        times: &mut BTreeMap<String, Arc<Histogram>>,
    ) -> Result<(Act, Vec<Gang>), Vec<Diagnostic>> {
        let mut errors = Vec::new();
        let mut stages = Vec::new();
        let budget = Budget::new(self.plan.limit.saturating_sub(self.plan.bytes));
        for region in &self.plan.regions {
            let values = self.values;
            match run::assemble(region, values, &budget, |job| self.make(job)) {
                Ok(mut stage) => {
                    stage.set_timed(self.metered);
                    stages.push(stage);
                }
                Err(e) => errors.extend(e),
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let mut timed = |region: &Region| -> Vec<Arc<Histogram>> {
            let id = |job| match job {
                What::Node(n) => self.ids[n].clone(),
                What::Tap(k) => format!("~heard {k}"),
            };
            let of = |node: &PlanNode| Arc::clone(times.entry(id(node.job)).or_default());
            if self.metered { region.nodes.iter().map(of).collect() } else { Vec::new() }
        };
        let callback = self.plan.callback();
        let mut links: Vec<Option<Receiver>> = callback.imports.iter().map(|_| None).collect();
        let act_stage = stages.pop();
        let mut gangs = Vec::new();
        for ((region, plan), stage) in self.plan.ahead().iter().enumerate().zip(stages) {
            let mut senders = Vec::new();
            for export in &plan.exports {
                let to = callback.imports.iter().position(|i| i.link == export.link);
                let Some(to) = to else { continue };
                let (sender, receiver) = self.link(&stage, plan, export, &callback.imports[to]);
                senders.push(sender);
                links[to] = Some(receiver);
            }
            let times = timed(plan);
            gangs.push(Gang { region, stage, links: senders, window, times, failed: false, fault: None });
        }
        let is_sink = |node: &PlanNode| matches!(node.job, What::Tap(_));
        let sinks = (0..callback.nodes.len()).filter(|&k| is_sink(&callback.nodes[k])).collect();
        let Some(stage) = act_stage else { return Err(Vec::new()) };
        let times = timed(callback);
        Ok((Act { stage, links: links.into_iter().flatten().collect(), sinks, times }, gangs))
    }

    fn link(&self, stage: &Stage, plan: &Region, export: &Export, import: &Import) -> (Sender, Receiver) {
        let (node, port) = plan.origins[export.buffer];
        let stream = self.site.shapes[node].outputs[port].as_ref().filter(|s| s.item.wave);
        let bridge = stream.map(|s| Dropout::new(s.width, self.ramp()));
        let (from, to) = ((export.buffer, export.clock), (import.buffer, import.clock));
        link::link(self.pace.depth as usize + 2, from, to, bridge, || {
            stage.with_buffer(export.buffer, |buffer| buffer.sibling(export.items))
        })
    }
}
