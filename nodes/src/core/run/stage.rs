//! Runs wired nodes in order, window by window: the one engine under the offline run, the live run and single nodes.

pub use super::survey::Survey;
pub use crate::core::ports::{BufferCell, Clock, Cx, InWire, OutWire, Span, Window, max_items};

use super::block_wires::BlockWires;
use super::written::{largest, newly_active, silence_not_finite};
use crate::core::buffer::{AnyBuffer, BoxedBuffer};
use crate::core::fault::Fault;
use crate::core::item::AnyValue;
use crate::core::node::DynNode;
use crate::core::ports::Shared;
use crate::core::silence::Silence;
use crate::core::state::StateArchive;
use crate::core::time::Tick;
use std::cell::RefCell;
use std::time::{Duration, Instant};

/// One node with its wires.
pub struct StageNode {
    /// The node.
    pub node: Box<dyn DynNode>,
    /// Number of the clock that counts its ticks.
    pub clock: usize,
    /// Links per input port.
    pub inputs: Vec<Vec<InWire>>,
    /// Output ports.
    pub outputs: Vec<OutWire>,
    /// Buffers that get a copy of another after each window: from, to, clock.
    pub copies: Vec<(usize, usize, usize)>,
}

/// Time spent in one node.
#[derive(Clone, Copy, Debug, Default)]
pub struct NodeTime {
    /// Wall time in `run`.
    pub time: Duration,
    /// Calls of `run`.
    pub calls: u64,
}

/// A fault, and the index in the stage of the node that raised it.
pub type StageFault = (usize, Fault);

/// Nodes in topological order with the buffers between them.
pub struct Stage {
    buffers: Vec<BufferCell>,
    clocks: Vec<Clock>,
    spans: Vec<Span>,
    nodes: Vec<StageNode>,
    /// For each node that takes blocks, where it reads and writes them.
    blocks: Vec<Option<BlockWires>>,
    spent: Vec<NodeTime>,
    timed: bool,
    poison: bool,
    /// True if no clock has anything to pad in the present window.
    steady: bool,
    /// Buffers whose size depends on the input.
    growing: Vec<usize>,
    /// True if outputs that are not finite are silenced.
    guarded: bool,
    /// The first node with such an output since the last look.
    not_finite: Option<usize>,
    /// For each node, a bit for each of its first 64 outputs that has been active; empty if this is not recorded.
    active: Vec<u64>,
    /// For each node, the largest magnitude in its streams of numbers; empty if this is not recorded.
    peaks: Vec<f32>,
}

impl Stage {
    /// A stage about to run from time zero.
    #[must_use]
    pub fn new(buffers: Vec<Box<dyn AnyBuffer>>, clocks: Vec<Clock>, nodes: Vec<StageNode>) -> Self {
        let begin = |clock: &Clock| {
            let (stop, full) = clock.ends(clock.from);
            Span { from: stop, to: stop, full, first: true }
        };
        let spans = clocks.iter().map(begin).collect();
        let spent = vec![NodeTime::default(); nodes.len()];
        let blocks = nodes.iter().map(|n| BlockWires::of(n, &clocks)).collect();
        let growing = (0..buffers.len()).filter(|&k| buffers[k].grows()).collect();
        let buffers = buffers.into_iter().map(|buffer| RefCell::new(BoxedBuffer::new(buffer))).collect();
        Self {
            buffers,
            clocks,
            spans,
            nodes,
            blocks,
            spent,
            timed: false,
            poison: false,
            steady: false,
            growing,
            guarded: false,
            not_finite: None,
            active: Vec::new(),
            peaks: Vec::new(),
        }
    }

    /// Records from now on which outputs are active.
    pub fn set_activity(&mut self) {
        self.active = vec![0; self.nodes.len()];
    }

    /// The outputs of a node that have been active since [`set_activity`](Self::set_activity), a bit for each of the first 64: a
    /// number that is not 0, an event, or an item of another type.
    #[must_use]
    pub fn activity(&self, node: usize) -> Option<u64> {
        self.active.get(node).copied()
    }

    /// Measures the time in each node from now on.
    pub fn set_timed(&mut self, timed: bool) {
        self.timed = timed;
    }

    /// Silences streams of numbers that are not finite from now on, each in the window in which its node has written it, so that
    /// no node after it takes them into its state.
    pub fn set_guarded(&mut self, guarded: bool) {
        self.guarded = guarded;
    }

    /// Sets if the windows from now on are late, for all nodes: see [`Node::set_late`](crate::core::node::Node::set_late).
    pub fn set_late(&mut self, late: bool) {
        self.nodes.iter_mut().for_each(|n| n.node.set_late(late));
    }

    /// Takes the index of the first node whose output was silenced since the last call.
    pub fn take_not_finite(&mut self) -> Option<usize> {
        self.not_finite.take()
    }

    /// Replaces a node by another of its type, and returns it.
    pub fn replace(&mut self, index: usize, node: Box<dyn DynNode>) -> Box<dyn DynNode> {
        let old = std::mem::replace(&mut self.nodes[index].node, node);
        self.blocks[index] = BlockWires::of(&self.nodes[index], &self.clocks);
        old
    }

    /// Fills every window with unusable numbers before its node runs, so that a test finds values that were not written.
    pub fn set_poison(&mut self, poison: bool) {
        self.poison = poison;
    }

    /// Time spent per node.
    #[must_use]
    pub fn spent(&self) -> &[NodeTime] {
        &self.spent
    }

    /// Time spent per node; statistics read and clear it.
    pub fn spent_mut(&mut self) -> &mut [NodeTime] {
        &mut self.spent
    }

    /// Lets a node adopt the state of another, both by index; the other is unchanged.
    pub fn adopt(&mut self, from: usize, to: usize) {
        if let Ok([old, new]) = self.nodes.get_disjoint_mut([from, to]) {
            new.node.adopt(&mut *old.node);
        }
    }

    /// Moves every clock to the window that ends at `to`; windows follow each other without gaps.
    pub fn advance(&mut self, to: Tick) {
        self.steady = true;
        for (span, clock) in self.spans.iter_mut().zip(&self.clocks) {
            let (stop, full) = clock.ends(clock.local(to));
            let first = span.first && span.from == span.full;
            *span = Span { from: span.full.min(stop), to: stop, full, first };
            self.steady &= span.steady();
        }
    }

    /// The present window of one clock.
    #[must_use]
    pub fn span(&self, clock: usize) -> Span {
        self.spans[clock]
    }

    /// Runs every node for the present window.
    ///
    /// # Errors
    /// The first fault of a node, or F050 where a buffer of events has outgrown its [`Budget`](crate::core::buffer::Budget); the
    /// stage is of no use afterwards.
    pub fn run(&mut self) -> Result<(), StageFault> {
        let Self {
            buffers,
            spans,
            nodes,
            blocks,
            spent,
            timed,
            poison,
            steady,
            growing,
            guarded,
            not_finite,
            active,
            peaks,
            ..
        } = self;
        // What nodes write is neither checked nor padded.
        let plain = !*guarded && *steady && peaks.is_empty();
        for (k, (stage_node, block)) in nodes.iter_mut().zip(blocks).enumerate() {
            let StageNode { node, clock, inputs, outputs, copies } = stage_node;
            let span = spans[*clock];
            let runs = span.to > span.from;
            let start = (*timed && runs).then(Instant::now);
            match block {
                Some(wires) if runs && !*poison => wires.run(&mut **node, buffers, spans),
                _ if runs => {
                    let shared = Shared { buffers, spans, poison: *poison, closing: false };
                    let cx = Cx { shared: &shared, inputs, outputs, clock: *clock };
                    node.run(&cx).map_err(|fault| (k, fault))?;
                }
                _ => {}
            }
            if let Some(start) = start {
                spent[k].time += start.elapsed();
                spent[k].calls += 1;
            }
            let known = active.get(k).is_none_or(|active| active.count_ones() as usize >= outputs.len());
            if plain && known && copies.is_empty() {
                continue;
            }
            let shared = Shared { buffers, spans, poison: *poison, closing: false };
            let cx = Cx { shared: &shared, inputs, outputs, clock: *clock };
            if runs {
                if *guarded && silence_not_finite(&cx) {
                    not_finite.get_or_insert(k);
                }
                if let Some(active) = active.get_mut(k) {
                    *active |= newly_active(&cx, *active);
                }
                if let Some(peak) = peaks.get_mut(k) {
                    *peak = largest(&cx, *peak);
                }
            }
            if !*steady || !copies.is_empty() {
                complete(&cx, copies);
            }
        }
        match growing.iter().find(|buffer| buffers[**buffer].get_mut().any().overrun()) {
            Some(buffer) => Err(outgrown(nodes, *buffer, buffers[*buffer].get_mut().any().bytes())),
            None => Ok(()),
        }
    }

    /// Finishes all nodes in order, after their streams have ended.
    ///
    /// # Errors
    /// The first fault of a node.
    pub fn finish(&mut self) -> Result<Vec<crate::core::node::Summary>, StageFault> {
        for span in &mut self.spans {
            *span = Span { from: span.to, to: span.to, full: span.to, first: false };
        }
        let shared = Shared { buffers: &self.buffers, spans: &self.spans, poison: false, closing: true };
        let mut summaries = Vec::with_capacity(self.nodes.len());
        for (k, stage_node) in self.nodes.iter_mut().enumerate() {
            let StageNode { node, clock, inputs, outputs, .. } = stage_node;
            let cx = Cx { shared: &shared, inputs, outputs, clock: *clock };
            let mut summary = node.finish(&cx).map_err(|fault| (k, fault))?;
            match node.silence() {
                None => {}
                Some(Silence::Off) => summary.push(("off", true.into())),
                Some(silence) => summary.push(("silent", silence.to_string().into())),
            }
            summaries.push(summary);
        }
        Ok(summaries)
    }

    /// Returns the activity of the nodes since the last survey, and the reasons for which they have given nothing so far. Nothing is allocated or freed here.
    pub fn survey(&mut self, survey: &mut Survey) {
        if let Some(active) = &mut survey.active {
            std::mem::swap(&mut self.active, active);
        }
        if let Some(peaks) = &mut survey.peaks {
            std::mem::swap(&mut self.peaks, peaks);
        }
        for (node, silence) in self.nodes.iter().zip(&mut survey.silence) {
            *silence = node.node.silence();
        }
    }

    /// The output wires of a node, by its index.
    #[must_use]
    pub fn outputs(&self, node: usize) -> &[OutWire] {
        &self.nodes[node].outputs
    }

    /// The value of an output port of a node, by its index.
    #[must_use]
    pub fn value(&self, node: usize, port: usize) -> Option<AnyValue> {
        match self.nodes.get(node)?.outputs.get(port)? {
            OutWire::Value(place) => place.borrow().clone(),
            _ => None,
        }
    }

    /// Copies the present window of a buffer into an empty one of the same type.
    pub fn export(&self, buffer: usize, clock: usize, into: &mut dyn AnyBuffer) {
        let span = self.spans[clock];
        into.restart(span.from);
        if span.to > span.from {
            into.append_from(self.buffers[buffer].borrow().any(), span.from, span.to);
        }
    }

    /// Appends the data that [`Stage::export`] of another stage returned for the same window.
    pub fn import(&self, buffer: usize, clock: usize, from: &dyn AnyBuffer) {
        let span = self.spans[clock];
        let mut buffer = self.buffers[buffer].borrow_mut();
        let buffer = buffer.any_mut();
        if span.to > span.from {
            buffer.append_from(from, span.from, span.to);
        }
        if span.full > span.to {
            buffer.pad_to(span.full);
        }
    }

    /// Copies the history of a buffer of another stage.
    pub fn seed(&mut self, old: &mut Self, from: usize, to: usize) {
        self.buffers[to].get_mut().any_mut().seed(old.buffers[from].get_mut().any());
    }

    /// Moves the end of a buffer to `to` with padding.
    pub fn pad(&mut self, buffer: usize, to: i64) {
        self.buffers[buffer].get_mut().any_mut().pad_to(to);
    }

    /// Changes a buffer.
    pub fn with_buffer_mut<R>(&mut self, buffer: usize, change: impl FnOnce(&mut dyn AnyBuffer) -> R) -> R {
        change(self.buffers[buffer].get_mut().any_mut())
    }

    /// Reads a buffer.
    pub fn with_buffer<R>(&self, buffer: usize, read: impl FnOnce(&dyn AnyBuffer) -> R) -> R {
        read(self.buffers[buffer].borrow().any())
    }

    /// Bytes in all buffers.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.buffers.iter().map(|t| t.borrow().any().bytes()).sum()
    }

    /// Continues another stage: takes nodes and buffers, each by its index there and its index here.
    ///
    /// The node that is replaced goes to the other stage, to be dropped with it. Nothing is
    /// allocated or freed.
    pub fn take_over(&mut self, old: &mut Self, nodes: &[(usize, usize)], buffers: &[(usize, usize)]) {
        for &(from, to) in nodes {
            std::mem::swap(&mut self.nodes[to].node, &mut old.nodes[from].node);
            self.blocks[to] = BlockWires::of(&self.nodes[to], &self.clocks);
            old.blocks[from] = BlockWires::of(&old.nodes[from], &old.clocks);
            self.spent[to] = old.spent[from];
        }
        for &(from, to) in buffers {
            self.buffers[to].get_mut().any_mut().take_over(old.buffers[from].get_mut().any_mut());
        }
    }

    /// Saves everything that the next window depends on, or restores it into a stage of the same plan that has not run yet.
    ///
    /// # Errors
    /// The fault of the node, or [`None`] and that of a buffer, which cannot be saved or does not fit.
    pub fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), (Option<usize>, Fault)> {
        let whole = |fault| (None, fault);
        archive.each(&mut self.spans).map_err(whole)?;
        archive.each(&mut self.active).map_err(whole)?;
        for buffer in &mut self.buffers {
            buffer.get_mut().any_mut().archive_state(archive).map_err(whole)?;
        }
        let mut nodes = self.nodes.iter_mut().enumerate();
        nodes.try_for_each(|(k, n)| n.node.archive_state(archive).map_err(|fault| (Some(k), fault)))
    }

    /// The nodes, for a reload.
    pub fn nodes_mut(&mut self) -> &mut [StageNode] {
        &mut self.nodes
    }
}

/// Error for a buffer of events beyond the memory limit, at its writer or else at a reader.
#[cold]
fn outgrown(nodes: &[StageNode], buffer: usize, bytes: usize) -> StageFault {
    let of = |link: &InWire| matches!(link, InWire::Events { buffer: t, .. } if *t == buffer);
    let writes = |n: &StageNode| {
        n.outputs.iter().any(|o| matches!(o, OutWire::Events { buffer: t, .. } if *t == buffer))
    };
    let reads = |n: &StageNode| n.inputs.iter().flatten().any(of);
    let place = nodes.iter().position(writes).or_else(|| nodes.iter().position(reads));
    let message = format!("an event buffer has grown to {bytes} bytes, and the memory limit allows no more");
    (
        place.unwrap_or(0),
        Fault::new("F050", message).help("allow more with --memory, or use a shorter --window"),
    )
}

/// Pads the output of a node, and copies it to buffers with another pad rule.
#[inline(never)]
fn complete(cx: &Cx<'_>, copies: &[(usize, usize, usize)]) {
    for wire in cx.outputs {
        match wire {
            OutWire::Stream { buffer, clock, .. } | OutWire::Events { buffer, clock } => {
                settle(&cx.shared.buffers[*buffer], cx.span(*clock));
            }
            OutWire::Value(_) => {}
        }
    }
    for &(from, to, clock) in copies {
        let span = cx.span(clock);
        let source = cx.shared.buffers[from].borrow();
        let mut copy = cx.shared.buffers[to].borrow_mut();
        let copy = copy.any_mut();
        if span.to > span.from {
            copy.append_from(source.any(), span.from, span.to);
        }
        if span.full > span.to {
            copy.pad_to(span.full);
        }
    }
}

/// Continues an ended stream by its pad rule, and fills in the padding that a held start waits for.
fn settle(buffer: &BufferCell, span: Span) {
    if !span.steady() {
        let mut buffer = buffer.borrow_mut();
        let buffer = buffer.any_mut();
        buffer.settle();
        if span.full > span.to {
            buffer.pad_to(span.full);
        }
    }
}
