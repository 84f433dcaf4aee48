//! Windows of nodes that take blocks, without views of their ports.

use super::stage::{BufferCell, Clock, InWire, OutWire, Span, StageNode};
use crate::core::buffer::BoxedBuffer;
use crate::core::node::DynNode;

/// The buffers and clocks of a node that takes blocks: see [`Node::process_block`](crate::core::node::Node::process_block).
#[derive(Clone, Copy)]
pub(super) struct BlockWires {
    source: usize,
    read: usize,
    target: usize,
    write: usize,
}

impl BlockWires {
    /// The wires of a node that takes blocks if its first input has its only link, and that link and the only output are on one clock.
    pub(super) fn of(node: &StageNode, clocks: &[Clock]) -> Option<Self> {
        let (first, others) = node.inputs.split_first()?;
        let ([link], [output]) = (&first[..], &node.outputs[..]) else { return None };
        let InWire::Stream { buffer: source, clock: read, behind: 0, ahead: 0, delay: 0, .. } = *link else {
            return None;
        };
        let OutWire::Stream { buffer: target, clock: write, .. } = *output else { return None };
        let fits = others.iter().all(Vec::is_empty) && clocks[read] == clocks[write];
        (fits && node.node.takes_blocks()).then_some(Self { source, read, target, write })
    }

    /// Fills one window.
    #[inline(always)]
    pub(super) fn run(&self, node: &mut dyn DynNode, buffers: &mut [BufferCell], spans: &[Span]) {
        let (read, write) = (spans[self.read], spans[self.write]);
        let Ok([source, target]) = buffers.get_disjoint_mut([self.source, self.target]) else { return };
        if let (BoxedBuffer::Samples(source), BoxedBuffer::Samples(target)) =
            (source.get_mut(), target.get_mut())
        {
            let out = target.append((write.to - write.from) as usize);
            node.process_block(source.view(read.from, read.to), out);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::core::buffer::{AnyBuffer, Pad, StreamBuffer};
    use crate::core::fault::Fault;
    use crate::core::item::{Described, OfItem};
    use crate::core::node::DynNode;
    use crate::core::stage::{Clock, Cx, InWire, OutWire, Stage, StageNode};
    use crate::core::time::Rate;
    use std::any::Any;

    /// Writes 1 where it runs, and 2 where it takes a block.
    struct Which(bool);

    impl DynNode for Which {
        fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
            cx.raw_output(0, |buffer, span| {
                let samples = buffer.typed_mut::<StreamBuffer<f32>>().expect("numbers");
                samples.append((span.to - span.from) as usize).fill(1.0);
            });
            Ok(())
        }
        fn takes_blocks(&self) -> bool {
            self.0
        }
        fn process_block(&mut self, input: &[f32], out: &mut [f32]) {
            assert_eq!(input.len(), out.len());
            out.fill(2.0);
        }
        fn as_any_mut(&mut self) -> &mut dyn Any {
            self
        }
    }

    /// The output of a node whose inputs read the buffer of another by `links`; clock 1 is one item behind clock 0.
    fn output(takes_blocks: bool, links: &[&[(usize, usize)]]) -> f32 {
        let rate = Rate::hz(100);
        let node = |takes_blocks, inputs: &[&[(usize, usize)]], buffer| {
            let wire = |&(clock, behind): &(usize, usize)| InWire::Stream {
                buffer: 0,
                clock,
                behind,
                ahead: 0,
                delay: 0,
                width: 1,
                rate,
            };
            StageNode {
                node: Box::new(Which(takes_blocks)) as Box<dyn DynNode>,
                clock: 0,
                inputs: inputs.iter().map(|links| links.iter().map(wire).collect()).collect(),
                outputs: vec![OutWire::Stream { buffer, clock: 0, width: 1, rate }],
                copies: Vec::new(),
            }
        };
        let buffer = || Box::new(StreamBuffer::<f32>::new(1, 8, 2, Pad::Silence)) as Box<dyn AnyBuffer>;
        let clock = |delay| Clock { rate: Some(rate), delay: rate.tick(delay), end: None, from: 0 };
        let nodes = vec![node(false, &[], 0), node(takes_blocks, links, 1)];
        let mut stage = Stage::new(vec![buffer(), buffer()], vec![clock(0), clock(1)], nodes);
        stage.advance(rate.tick(3));
        assert!(stage.run().is_ok());
        let mut out = Vec::new();
        stage.with_buffer(1, |buffer| (OfItem::<f32>::INFO.numbers)(buffer, 0, 3, &mut out));
        assert!(out.iter().all(|x| *x == out[0]), "{out:?}");
        out[0]
    }

    #[test]
    fn a_block_replaces_a_run_where_one_stream_is_read_on_the_clock_of_the_output() {
        assert_eq!(output(true, &[&[(0, 0)], &[]]), 2.0);
        assert_eq!(output(false, &[&[(0, 0)]]), 1.0, "the node takes no blocks");
        assert_eq!(output(true, &[]), 1.0, "no input");
        assert_eq!(output(true, &[&[(0, 0)], &[(0, 0)]]), 1.0, "two inputs");
        assert_eq!(output(true, &[&[], &[(0, 0)]]), 1.0, "the first input has no link");
        assert_eq!(output(true, &[&[(0, 0), (0, 0)]]), 1.0, "two links");
        assert_eq!(output(true, &[&[(0, 1)]]), 1.0, "an item before the window");
        assert_eq!(output(true, &[&[(1, 0)]]), 1.0, "another clock");
    }
}
