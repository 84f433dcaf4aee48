//! Probes of one output of a graph: figures, the first items, and a drawing.
//!
//! A [`Probe`] observes the output while the graph runs, and holds statistics instead of the data.

mod columns;
mod events;
mod sound;
mod text;
mod value;

pub use columns::{ColumnFigures, Row, StreamFigures};
pub use events::{EventFigures, FieldFigures, Intervals};
pub use sound::{ChannelFigures, SoundReport};
pub use text::{db, figure};
pub use value::{ValueFigures, abridged};

use crate::run::Observer;
use columns::StreamProbe;
use events::EventProbe;
use foley_nodes::core::item::{AnyValue, StreamShape};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::time::Tick;
use serde::Serialize;
use serde_json::Value;
use sound::SoundProbe;

/// Settings of a probe.
#[derive(Clone, Debug)]
pub struct ProbeOptions {
    /// The output, `NODE.PORT`: the title of its drawing.
    pub output: String,
    /// Items that are shown.
    pub first: usize,
    /// Start of the time that is measured, ticks.
    pub from: Tick,
    /// Its end, ticks.
    pub to: Tick,
}

/// Measures one output.
#[derive(Debug)]
pub struct Probe {
    options: ProbeOptions,
    state: State,
}

#[derive(Debug)]
enum State {
    Nothing,
    Sound(Box<SoundProbe>),
    Stream(Box<StreamProbe>),
    Events(Box<EventProbe>),
    Value(AnyValue),
}

/// Figures of an output.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Figures {
    /// Nothing came: the run ended before.
    Nothing,
    /// Audio.
    Sound(Box<SoundReport>),
    /// Another stream of numbers.
    Stream(StreamFigures),
    /// Events.
    Events(EventFigures),
    /// A value.
    Value(ValueFigures),
}

impl Probe {
    /// A probe to which nothing has come.
    #[must_use]
    pub fn new(options: ProbeOptions) -> Self {
        Self { options, state: State::Nothing }
    }

    /// Figures of all that has come.
    #[must_use]
    pub fn figures(&self) -> Figures {
        match &self.state {
            State::Nothing => Figures::Nothing,
            State::Sound(sound) => Figures::Sound(Box::new(sound.report())),
            State::Stream(stream) => Figures::Stream(stream.figures()),
            State::Events(events) => Figures::Events(events.figures()),
            State::Value(value) => Figures::Value(ValueFigures::of(value)),
        }
    }

    /// A drawing as SVG; `None` for a value whose type has none.
    #[must_use]
    pub fn svg(&self) -> Option<String> {
        match &self.state {
            State::Nothing => None,
            State::Sound(sound) => Some(sound.draw()),
            State::Stream(stream) => Some(stream.draw()),
            State::Events(events) => Some(events.draw(&self.options.output)),
            State::Value(value) => (value.kind().plot)(value),
        }
    }
}

impl Figures {
    /// Readable lines about `output`, with the `first` items of lists.
    #[must_use]
    pub fn text(&self, output: &str, first: usize) -> String {
        match self {
            Self::Nothing => format!("{output}: nothing came\n"),
            Self::Sound(sound) => sound.text(output),
            Self::Stream(stream) => stream.text(output),
            Self::Events(events) => events.text(output),
            Self::Value(value) => value.text(output, first),
        }
    }
}

impl Observer for Probe {
    fn begin(&mut self, kind: PortKind, shape: Option<&StreamShape>) {
        self.state = match (kind, shape) {
            (PortKind::Stream(item), Some(shape)) if item.wave => {
                State::Sound(Box::new(SoundProbe::new(shape, &self.options)))
            }
            (PortKind::Stream(_), Some(shape)) => {
                State::Stream(Box::new(StreamProbe::new(shape, &self.options)))
            }
            (PortKind::Events(event), _) => {
                State::Events(Box::new(EventProbe::new(event.name, self.options.first)))
            }
            _ => State::Nothing,
        };
    }

    fn numbers(&mut self, first: i64, numbers: &[f32]) {
        match &mut self.state {
            State::Sound(sound) => sound.push(first, numbers),
            State::Stream(stream) => stream.push(first, numbers),
            State::Nothing | State::Events(_) | State::Value(_) => {}
        }
    }

    fn events(&mut self, events: &[(Tick, Value)]) {
        let ProbeOptions { from, to, .. } = self.options;
        if let State::Events(all) = &mut self.state {
            events
                .iter()
                .filter(|(at, _)| (from..to).contains(at))
                .for_each(|(at, event)| all.push(*at, event));
        }
    }

    fn value(&mut self, value: &AnyValue) {
        self.state = State::Value(value.clone());
    }
}

/// The numbers of the items `[from, to)` of a block that begins with item `first`, and the first of these items.
fn within(first: i64, numbers: &[f32], width: usize, from: i64, to: i64) -> (i64, &[f32]) {
    let items = (numbers.len() / width.max(1)) as i64;
    let start = (from - first).clamp(0, items);
    let end = (to - first).clamp(start, items);
    (first + start, &numbers[start as usize * width..end as usize * width])
}
