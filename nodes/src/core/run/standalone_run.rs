//! The run of one node.

use crate::core::buffer::{EventBuffer, StreamBuffer};
use crate::core::fault::Fault;
use crate::core::item::{AnyValue, Event, Item};
use crate::core::node::{DynNode, Summary};
use crate::core::ports::{Events, Port, PortKind, PortSpec, Stream};
use crate::core::stage::{OutWire, Stage};
use crate::core::state::{StateArchive, Stateful};
use crate::core::time::Tick;

/// A node that is running, or has run.
pub struct StandaloneRun {
    stage: Stage,
    specs: &'static [PortSpec],
    at: usize,
    window: Tick,
    now: Tick,
    until: Tick,
    outputs: Option<Vec<OutWire>>,
    /// Summary of the node.
    pub summary: Summary,
}

impl StandaloneRun {
    /// A run of the node `at` of a stage, in windows of one length until a time of the stage.
    pub(super) fn new(
        stage: Stage,
        specs: &'static [PortSpec],
        at: usize,
        window: Tick,
        until: Tick,
    ) -> Self {
        Self { stage, specs, at, window, now: 0, until, outputs: None, summary: Summary::new() }
    }

    /// A run of a node of values, which is done.
    pub(super) fn done(specs: &'static [PortSpec], outputs: Vec<OutWire>, summary: Summary) -> Self {
        let stage = Stage::new(Vec::new(), Vec::new(), Vec::new());
        Self { outputs: Some(outputs), summary, ..Self::new(stage, specs, 0, 1, 0) }
    }

    /// Runs one window; false once there is nothing left.
    ///
    /// # Errors
    /// As [`Node::run`](crate::core::node::Node::run).
    pub fn step(&mut self) -> Result<bool, Fault> {
        if self.now >= self.until {
            return Ok(false);
        }
        self.now = (self.now + self.window).min(self.until);
        self.stage.advance(self.now);
        self.stage.run().map_err(|(_, fault)| fault)?;
        Ok(true)
    }

    /// Saves how far it is.
    ///
    /// # Errors
    /// As [`Node::archive_state`](crate::core::node::Node::archive_state).
    pub fn save(&mut self) -> Result<Vec<u8>, Fault> {
        let mut bytes = Vec::new();
        self.archive_state(&mut StateArchive::save(&mut bytes))?;
        Ok(bytes)
    }

    /// Resumes a saved run of the same node over the same inputs; this one must not have run yet.
    ///
    /// # Errors
    /// As [`Node::archive_state`](crate::core::node::Node::archive_state).
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.archive_state(&mut StateArchive::restore(bytes))
    }

    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        Stateful::archive_state(&mut self.now, archive)?;
        self.stage.archive_state(archive).map_err(|(_, fault)| fault)
    }

    /// The node itself, to be retuned or to adopt another.
    pub fn node(&mut self) -> &mut dyn DynNode {
        &mut *self.stage.nodes_mut()[self.at].node
    }

    /// Ends the run.
    ///
    /// # Errors
    /// As [`Node::finish`](crate::core::node::Node::finish).
    pub fn finish(&mut self) -> Result<(), Fault> {
        if self.outputs.is_none() {
            let mut all = self.stage.finish().map_err(|(_, fault)| fault)?;
            self.summary = all.pop().unwrap_or_default();
        }
        Ok(())
    }

    fn wires(&self) -> &[OutWire] {
        match &self.outputs {
            Some(outputs) => outputs,
            None => self.stage.outputs(self.at),
        }
    }

    /// Returns true if no output has been active so far; see [`Stage::activity`].
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.stage.activity(self.at) == Some(0)
    }

    /// Returns the items of a stream output so far.
    #[must_use]
    pub fn stream<T: Item>(&self, port: Port<Stream<T>>) -> Vec<T::Elem> {
        let OutWire::Stream { buffer, .. } = &self.wires()[port.index()] else { return Vec::new() };
        self.stage.with_buffer(*buffer, |buffer| {
            let typed = buffer.typed::<StreamBuffer<T::Elem>>();
            typed.map(|typed| typed.view(0, buffer.end()).to_vec()).unwrap_or_default()
        })
    }

    /// The numbers of a stream output of any type, and true if all of them are finite.
    #[must_use]
    pub fn numbers(&self, port: usize) -> (Vec<f32>, bool) {
        let (Some(OutWire::Stream { buffer, .. }), Some(PortKind::Stream(item))) =
            (self.wires().get(port), self.specs.get(port).map(|spec| spec.kind))
        else {
            return (Vec::new(), true);
        };
        self.stage.with_buffer(*buffer, |buffer| {
            let mut out = Vec::new();
            (item.numbers)(buffer, 0, buffer.end(), &mut out);
            (out, (item.finite)(buffer, 0, buffer.end()))
        })
    }

    /// All events that an output has produced so far.
    #[must_use]
    pub fn events<T: Event>(&self, port: Port<Events<T>>) -> Vec<(Tick, T)> {
        let OutWire::Events { buffer, .. } = &self.wires()[port.index()] else { return Vec::new() };
        self.stage.with_buffer(*buffer, |buffer| {
            let typed = buffer.typed::<EventBuffer<T>>();
            typed.map(|typed| typed.view(Tick::MIN, Tick::MAX).to_vec()).unwrap_or_default()
        })
    }

    /// All events of an output so far, of any type.
    #[must_use]
    pub fn events_json(&self, port: usize) -> Vec<(Tick, serde_json::Value)> {
        match (self.wires().get(port), self.specs.get(port).map(|spec| spec.kind)) {
            (Some(OutWire::Events { buffer, .. }), Some(PortKind::Events(event))) => {
                self.stage.with_buffer(*buffer, |buffer| (event.json)(buffer, Tick::MIN, Tick::MAX))
            }
            _ => Vec::new(),
        }
    }

    /// The value at an output, by its number.
    #[must_use]
    pub fn value(&self, port: usize) -> Option<AnyValue> {
        match self.wires().get(port)? {
            OutWire::Value(place) => place.borrow().clone(),
            _ => None,
        }
    }
}
