//! Makes the stages of the callback and of the workers from a plan, and links them.

use super::callback::CallbackStage;
use super::device_output::DeviceOutput;
use super::meter::Histogram;
use super::timing::WindowTiming;
use super::window_ring::{RingReceiver, RingSender, ring};
use super::workers::WorkerRegion;
use crate::diag::Diagnostic;
use crate::plan::{Export, Import, LivePlan, PlanNode, Region, Runnable};
use crate::run::{self, BuildSite, Values};
use foley_nodes::core::buffer::Budget;
use foley_nodes::core::fault::Fault;
use foley_nodes::core::node::DynNode;
use foley_nodes::core::stage::{Cx, Stage};
use foley_nodes::dsp::Dropout;
use std::any::Any;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Time of the fade-out at a dropout, s.
const DROPOUT_FADE: f64 = 0.005;

/// Stands for a node that the running graph holds until the swap.
pub struct Placeholder;

impl DynNode for Placeholder {
    fn run(&mut self, _: &Cx<'_>) -> Result<(), Fault> {
        Err(Fault::new("F099", "a node was not transferred: a defect in foley"))
    }
    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// Everything that the stages are made of.
pub struct Assembly<'a> {
    /// The plan.
    pub plan: &'a LivePlan,
    /// Ids of its nodes.
    pub ids: &'a [String],
    /// The site on which its nodes are built.
    pub site: BuildSite<'a>,
    /// Its values.
    pub values: &'a Values,
    /// New nodes that are built already.
    pub built: HashMap<usize, Box<dyn DynNode>>,
    /// Old index of the nodes that continue, by new index.
    pub continued: &'a HashMap<usize, usize>,
    /// The windows.
    pub timing: WindowTiming,
    /// True if the time in each node is measured.
    pub metered: bool,
}

impl Assembly<'_> {
    fn make(&mut self, runnable: Runnable) -> Result<Box<dyn DynNode>, Diagnostic> {
        match runnable {
            Runnable::Node(n) if self.continued.contains_key(&n) => Ok(Box::new(Placeholder)),
            Runnable::Node(n) => match self.built.remove(&n) {
                Some(node) => Ok(node),
                None => self.site.build(n, self.values),
            },
            Runnable::Tap(k) => {
                let link = &self.plan.sinks[k].link;
                let width = self.site.shapes[link.node].outputs[link.port].as_ref().map_or(1, |s| s.width);
                Ok(Box::new(DeviceOutput::new(width, self.timing.quantum, self.fade_frames())))
            }
        }
    }

    /// Frames of the fade-out at a dropout.
    fn fade_frames(&self) -> usize {
        (self.timing.rate.as_f64() * DROPOUT_FADE) as usize
    }

    /// Makes the stages of the callback and of the workers, which begin with window `window`.
    ///
    /// # Errors
    /// The faults of all nodes that could not be built.
    pub fn build(
        mut self,
        window: u64,
        times: &mut BTreeMap<String, Arc<Histogram>>,
    ) -> Result<(CallbackStage, Vec<WorkerRegion>), Vec<Diagnostic>> {
        let mut errors = Vec::new();
        let mut stages = Vec::new();
        let budget = Budget::new(self.plan.limit.saturating_sub(self.plan.bytes));
        for region in &self.plan.regions {
            let values = self.values;
            match run::assemble(region, values, &budget, |runnable| self.make(runnable)) {
                Ok(mut stage) => {
                    stage.set_timed(self.metered);
                    stage.set_guarded(true);
                    stages.push(stage);
                }
                Err(e) => errors.extend(e),
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let mut timed = |region: &Region| -> Vec<Arc<Histogram>> {
            let id = |runnable| match runnable {
                Runnable::Node(n) => self.ids[n].clone(),
                Runnable::Tap(k) => format!("~sink {k}"),
            };
            let of = |node: &PlanNode| Arc::clone(times.entry(id(node.runnable)).or_default());
            if self.metered { region.nodes.iter().map(of).collect() } else { Vec::new() }
        };
        let callback = self.plan.callback_region();
        let mut links: Vec<Option<RingReceiver>> = callback.imports.iter().map(|_| None).collect();
        let callback_stage = stages.pop();
        let mut worker_regions = Vec::new();
        for ((number, region), stage) in self.plan.worker_regions().iter().enumerate().zip(stages) {
            let mut senders = Vec::new();
            for export in &region.exports {
                let to = callback.imports.iter().position(|i| i.link == export.link);
                let Some(to) = to else { continue };
                let (sender, receiver) = self.link(&stage, region, export, &callback.imports[to]);
                senders.push(sender);
                links[to] = Some(receiver);
            }
            let times = timed(region);
            worker_regions.push(WorkerRegion {
                number,
                stage,
                links: senders,
                window,
                times,
                failed: false,
                fault: None,
                late: None,
                not_finite: None,
                next_report: 0,
            });
        }
        let is_output = |node: &PlanNode| matches!(node.runnable, Runnable::Tap(_));
        let outputs = (0..callback.nodes.len()).filter(|&k| is_output(&callback.nodes[k])).collect();
        let Some(stage) = callback_stage else { return Err(Vec::new()) };
        let times = timed(callback);
        let links = links.into_iter().flatten().collect();
        Ok((CallbackStage { stage, links, outputs, times }, worker_regions))
    }

    fn link(
        &self,
        stage: &Stage,
        region: &Region,
        export: &Export,
        import: &Import,
    ) -> (RingSender, RingReceiver) {
        let (node, port) = region.origins[export.buffer];
        let stream = self.site.shapes[node].outputs[port].as_ref().filter(|s| s.item.wave);
        let dropout = stream.map(|s| Dropout::new(s.width, self.fade_frames()));
        let (from, to) = ((export.buffer, export.clock), (import.buffer, import.clock));
        ring(self.timing.depth as usize + 2, from, to, dropout, || {
            stage.with_buffer(export.buffer, |buffer| buffer.sibling(export.items))
        })
    }
}
