//! Nodes that make each output item of the one input item at the same time, as ordinary nodes.

use super::{Class, Each, Node, Summary};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::{Described, OfItem};
use crate::core::ports::{Arity, Cx, In, InKind, Out, OutKind, Port, PortKind, PortSpec, Ports, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::state::StateArchive;
use std::marker::PhantomData;

/// The [`Node`] around an [`Each`].
#[derive(Debug)]
pub struct PerItem<E>(E);

/// The ports of an [`Each`].
#[derive(Debug)]
pub struct EachPorts<E>(PhantomData<E>);

impl<E: Each> Ports for EachPorts<E> {
    type Io<'a> = (In<'a, E::In>, Out<'a, E::Out>);
    const INPUTS: &'static [PortSpec] = &[PortSpec {
        name: E::INPUT.0,
        doc: E::INPUT.1,
        kind: PortKind::Stream(OfItem::<E::In>::INFO),
        arity: Arity::One,
        delayed: false,
    }];
    const OUTPUTS: &'static [PortSpec] = &[PortSpec {
        name: E::OUTPUT.0,
        doc: E::OUTPUT.1,
        kind: PortKind::Stream(OfItem::<E::Out>::INFO),
        arity: Arity::One,
        delayed: false,
    }];

    fn open<'a>(cx: &Cx<'a>) -> Self::Io<'a> {
        (<Stream<E::In> as InKind>::view(cx, 0), <Stream<E::Out> as OutKind>::view(cx, 0))
    }
}

impl<E: Each> Node for PerItem<E> {
    type Params = E::Params;
    type Ports = EachPorts<E>;
    const NAME: &'static str = E::NAME;
    const VERSION: u32 = E::VERSION;
    const CLASS: Class = Class::Audio;

    fn shape(params: &E::Params, shape: &mut Shape<'_, '_, EachPorts<E>>) -> Result<(), Reject> {
        let input = shape.input(Port::<Stream<E::In>>::new(0));
        let format = E::format(params, &input.format)?;
        shape.output(Port::<Stream<E::Out>>::new(0), input.rate, format);
        Ok(())
    }

    fn build(params: &E::Params, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self(E::new(params, &cx.input(Port::<Stream<E::In>>::new(0)).format)))
    }

    fn run(&mut self, (input, mut out): (In<'_, E::In>, Out<'_, E::Out>)) -> Result<(), Fault> {
        let (from, to) = (input.width().max(1), out.width().max(1));
        for (item, out) in input.items().chunks_exact(from).zip(out.items().chunks_exact_mut(to)) {
            self.0.each(item, out);
        }
        Ok(())
    }

    fn finish(&mut self, _: (In<'_, E::In>, Out<'_, E::Out>)) -> Result<Summary, Fault> {
        Ok(self.0.summary())
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.0.archive_state(archive)
    }

    fn trial(rng: &mut Rng) -> (E::Params, MemoryFiles) {
        (E::trial(rng), MemoryFiles::default())
    }
}
