use super::*;
use crate::core::buffer::{AnyBuffer, Pad, StreamBuffer};
use crate::core::files::MemoryOutputs;
use crate::core::item::{Channels, Described, OfItem, StreamShape};
use crate::core::node::{DynNode, NodeType};
use crate::core::params::AnyParams;
use crate::core::ports::OutKind;
use crate::core::random::Random;
use crate::core::shape::{LinkShape, RawShape};
use crate::core::stage::{Clock, Cx, InWire, OutWire, Stage, StageNode};
use crate::core::standalone::{Feed, Standalone};
use crate::core::time::Rate;
use crate::dsp::nodes::{MixNode, MixParams};
use std::any::Any;

fn feedback(channels: u16) -> Standalone {
    let params = FeedbackParams { delay: 0.03, gain: 0.5, tail: 0.02 };
    let returned = Feed::stream::<f32>(Rate::hz(100), Channels(1), vec![1.0, 2.0, 3.0, 4.0]);
    let silent = vec![0.0; 4 * usize::from(channels)];
    let standalone = Standalone::new::<FeedbackNode>(params).feed(FeedbackPorts::audio.index(), returned);
    standalone.input(FeedbackPorts::like, Rate::hz(100), Channels(channels), silent)
}

#[test]
fn returned_audio_is_delayed_and_lasts_for_the_tail() {
    let out = feedback(1).run().unwrap().stream(FeedbackPorts::out);
    assert_eq!(out, [0.0, 0.0, 0.0, 0.5, 1.0, 1.5]);
}

#[test]
fn returned_audio_must_have_the_format_of_like() {
    assert_eq!(feedback(2).shape().unwrap_err().field.as_deref(), Some("audio"));
}

/// An impulse at item 0.
struct Impulse;

impl DynNode for Impulse {
    fn run(&mut self, cx: &Cx<'_>) -> Result<(), Fault> {
        let mut out = <Stream<f32> as OutKind>::view(cx, 0);
        let first = out.first();
        out.items().iter_mut().zip(first..).for_each(|(x, n)| *x = if n == 0 { 1.0 } else { 0.0 });
        Ok(())
    }
    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// `Mix(inputs: [impulse, echo])` with `echo: Feedback(audio: mix)`, with a delay of three samples.
fn echoes(window: i64) -> Vec<f32> {
    let rate = Rate::hz(100);
    let stream = || LinkShape::Stream(StreamShape::new::<f32>(rate, Channels(1), None));
    let build = |ty: NodeType, params: &dyn AnyParams, links: &[Vec<LinkShape>]| {
        let shape = ty.shape(params, RawShape::new(links, 1, &MemoryFiles::default())).unwrap();
        let random = Random::new(1, "loop");
        let (files, outputs) = (&MemoryFiles::default(), &MemoryOutputs::default());
        let window = rate.tick(window);
        ty.build(
            params,
            &Build {
                random,
                links,
                shape: &shape,
                window,
                files,
                outputs,
                inputs: &crate::core::input::NoInputs,
                monitor: &crate::core::computation::unmonitored,
                partial: &crate::core::computation::NotStored,
                background: &crate::core::computation::foreground(),
            },
        )
        .unwrap()
    };
    let params = FeedbackParams { delay: 0.03, gain: 0.5, tail: 0.0 };
    let echo = build(NodeType::of::<FeedbackNode>("dsp"), &params, &[vec![], vec![stream()]]);
    let params = MixParams { gains: Vec::new() };
    let mix = build(NodeType::of::<MixNode>("dsp"), &params, &[vec![stream(), stream()]]);
    let read =
        |buffer, delay| InWire::Stream { buffer, clock: 0, behind: 0, ahead: 0, delay, width: 1, rate };
    let node = |node, inputs, buffer| StageNode {
        node,
        clock: 1,
        inputs,
        outputs: vec![OutWire::Stream { buffer, clock: 0, width: 1, rate }],
        copies: Vec::new(),
    };
    let nodes = vec![
        node(Box::new(Impulse) as Box<dyn DynNode>, vec![], 0),
        node(echo, vec![vec![read(2, 3)], vec![read(0, 0)]], 1),
        node(mix, vec![vec![read(0, 0), read(1, 0)]], 2),
    ];
    let buffer = || Box::new(StreamBuffer::<f32>::new(1, 20, 3, Pad::Silence)) as Box<dyn AnyBuffer>;
    let clock = |rate| Clock { rate, delay: 0, end: None, from: 0 };
    let clocks = vec![clock(Some(rate)), clock(None)];
    let mut stage = Stage::new(vec![buffer(), buffer(), buffer()], clocks, nodes);
    for k in 1..=12 / window {
        stage.advance(rate.tick(k * window));
        stage.run().unwrap();
    }
    let mut out = Vec::new();
    stage.with_buffer(2, |buffer| (OfItem::<f32>::INFO.numbers)(buffer, 0, 12, &mut out));
    out
}

#[test]
fn echoes_are_at_multiples_of_the_delay_and_halve() {
    let expected = [1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.25, 0.0, 0.0, 0.125, 0.0, 0.0];
    for window in [1, 2, 3] {
        assert_eq!(echoes(window), expected, "windows of {window}");
    }
}
