//! Random trials of registered nodes: compatible parameters, files and inputs.
#![allow(dead_code)]

use foley_nodes::core::fault::Fault;
use foley_nodes::core::files::MemoryFiles;
use foley_nodes::core::item::{Channels, Described, ItemType, OfItem};
use foley_nodes::core::node::NodeType;
use foley_nodes::core::params::AnyParams;
use foley_nodes::core::ports::{Arity, PortKind};
use foley_nodes::core::random::Rng;
use foley_nodes::core::shape::{LinkShape, NodeShape};
use foley_nodes::core::standalone::{Feed, Standalone, StandaloneRun};
use foley_nodes::core::time::{Rate, TICKS_PER_SECOND, Tick};
use foley_nodes::registry::all;
use std::fmt;
use std::sync::Arc;

/// Largest number of attempts to find a trial that a node accepts.
const TRIES: u64 = 2000;
/// Trials that are drawn at most until as many are accepted as are wanted: nodes with several streams need the same rate and vertices.
const MOST: u64 = 4 * TRIES;
/// Largest number of items of a stream in a trial.
const MAX_ITEMS: i64 = 6000;
/// Time at which endless nodes are stopped.
const UNTIL: Tick = TICKS_PER_SECOND / 2;

/// Content of audio inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Noise.
    Random,
    /// Zeros.
    Silence,
    /// A constant.
    Constant,
    /// Full scale with random signs.
    FullScale,
    /// The smallest denormal numbers.
    Denormal,
    /// Values that a control can send: any number within 1e9, most often an end of the range or 0.
    Control,
}

impl Level {
    fn sample(self, rng: &mut Rng) -> f32 {
        match self {
            Self::Random => rng.between(-1.0, 1.0) as f32,
            Self::Silence => 0.0,
            Self::Constant => 0.7,
            Self::FullScale => [-1.0, 1.0][rng.below(2)],
            Self::Denormal => f32::from_bits(1 + rng.below(8) as u32),
            Self::Control => {
                let any = 10.0_f64.powf(rng.between(-12.0, 9.0)) as f32;
                [1e9, -1e9, 1e9, 0.0, 1.0, any, -any][rng.below(7)]
            }
        }
    }
}

/// One node with parameters and inputs that it accepts.
pub struct Trial {
    node: usize,
    number: u64,
    params: Box<dyn AnyParams>,
    files: MemoryFiles,
    feeds: Vec<Vec<Feed>>,
    end: Tick,
    /// Seed of its randomness.
    pub seed: u64,
}

impl fmt::Debug for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let links: Vec<_> = self.feeds.iter().flatten().map(Feed::shape).collect();
        write!(f, "{} (trial {}), {:?}, {links:?}", self.ty().name, self.number, self.params)
    }
}

/// Returns trials that a node accepts.
///
/// # Panics
/// If the node accepts too few trials.
pub fn accepted(node: usize, level: Level, wanted: usize) -> Vec<Trial> {
    let mut trials = Vec::new();
    let mut reasons = Vec::new();
    for number in 0..MOST {
        if trials.len() == wanted {
            return trials;
        }
        match Trial::new(node, number, level) {
            Ok(trial) => trials.push(trial),
            Err(reason) => reasons.push(reason),
        }
    }
    let name = all()[node].name;
    panic!(
        "`{name}` accepts only {} of {MOST} trials; the last reason is: {:?}",
        trials.len(),
        reasons.last()
    )
}

/// Returns all trials that a node accepts, possibly few.
pub fn possible(node: usize, level: Level) -> impl Iterator<Item = Trial> {
    (0..TRIES).filter_map(move |number| Trial::new(node, number, level).ok())
}

fn audio(rng: &mut Rng, rate: Rate, channels: Channels, items: i64, level: Level) -> Feed {
    let count = items as usize * usize::from(channels.0);
    Feed::stream::<f32>(rate, channels, (0..count).map(|_| level.sample(rng)).collect())
}

/// Returns true for streams of numbers, such as audio and controls.
pub fn is_audio(item: &ItemType) -> bool {
    (item.id)() == (OfItem::<f32>::INFO.id)()
}

/// Creates a stream, with the format of `like` if possible.
fn stream(rng: &mut Rng, item: &ItemType, rate: Rate, like: Option<&Feed>, level: Level) -> Feed {
    // Streams end at different times; some are empty.
    let max_items = if is_audio(item) { 300.0 } else { 60.0 };
    let items = if rng.below(20) == 0 { 0 } else { rng.between(max_items / 10.0, max_items) as i64 };
    let like = like.and_then(|feed| match feed.shape() {
        LinkShape::Stream(shape) if (shape.item.id)() == (item.id)() => Some(shape),
        _ => None,
    });
    if is_audio(item) {
        let channels = like.and_then(|shape| shape.format::<f32>().copied());
        let channels = channels.unwrap_or(Channels(1 + rng.below(3) as u16));
        return audio(rng, rate, channels, items, level);
    }
    let made = like.and_then(|shape| Feed::trial_stream_like(item, rng, shape, items));
    made.unwrap_or_else(|| Feed::trial_stream(item, rng, rate, items))
}

impl Trial {
    fn new(node: usize, number: u64, level: Level) -> Result<Self, String> {
        // FNV-1a of the name, which is the same on all machines: a new node changes no trial of the others.
        let name = all()[node].name.bytes();
        let seed =
            name.fold(0xcbf2_9ce4_8422_2325, |h: u64, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        Self::drawn(node, number, level, Rng::new(seed.wrapping_add(number)))
    }

    fn drawn(node: usize, number: u64, level: Level, mut rng: Rng) -> Result<Self, String> {
        let ty = all().swap_remove(node);
        let (params, files) = (ty.trial)(&mut rng);
        let rates = [
            Rate::hz(40),
            Rate::hz(60),
            Rate::hz(100),
            Rate::hz(1000),
            Rate::hz(403),
            Rate::new(24_000, 1001).expect("a film rate"),
            Rate::new(44_101, 64).expect("a rate without common divisors"),
        ];
        let one_rate = rates[rng.below(rates.len())];
        // Most nodes require inputs of the same format.
        let alike = rng.below(4) > 0;
        let mut feeds: Vec<Vec<Feed>> = Vec::new();
        for port in ty.inputs {
            let count = match port.arity {
                Arity::One => 1,
                Arity::Optional => rng.below(2),
                Arity::Many => 1 + rng.below(3),
            };
            let mut links = Vec::new();
            for _ in 0..count {
                let rate = if alike { one_rate } else { rates[rng.below(rates.len())] };
                let item = |kind: &PortKind, feed: &&Feed| match (kind, feed.shape()) {
                    (PortKind::Stream(item), LinkShape::Stream(shape)) => (item.id)() == (shape.item.id)(),
                    _ => false,
                };
                let like = feeds.iter().flatten().chain(&links).find(|feed| alike && item(&port.kind, feed));
                let feed = match port.kind {
                    PortKind::Stream(item) => stream(&mut rng, item, rate, like, level),
                    PortKind::Events(event) => {
                        let end = (TICKS_PER_SECOND as f64 * rng.between(0.05, 0.5)) as Tick;
                        Feed::trial_events(event, &mut rng, end)
                    }
                    PortKind::Value(data) | PortKind::Fold(data) => Feed::value((data.trial)(&mut rng)),
                };
                links.push(feed);
            }
            feeds.push(links);
        }
        let mut trial = Self { node, number, params, files, feeds, end: 0, seed: number };
        let shape = trial.shape().map_err(|reject| reject.message)?;
        trial.end = shape.end.unwrap_or(UNTIL);
        let rates = shape.outputs.iter().flatten().map(|stream| stream.rate);
        if rates.map(|rate| rate.first_at(trial.end)).any(|items| items > MAX_ITEMS) {
            return Err(format!("{} ticks are too long for a trial", trial.end));
        }
        Ok(trial)
    }

    /// Returns the type of the node.
    pub fn ty(&self) -> Arc<NodeType> {
        all().swap_remove(self.node)
    }

    /// Returns the node with its inputs, ready to run.
    pub fn standalone(&self, window: Tick) -> Standalone {
        let mut standalone = Standalone::of_type(self.ty(), self.params.boxed()).window(window);
        for (port, feeds) in self.feeds.iter().enumerate() {
            for feed in feeds {
                standalone = standalone.feed(port, feed.clone());
            }
        }
        standalone.files = self.files.clone();
        standalone.seed = self.seed;
        standalone.until = UNTIL;
        standalone
    }

    /// Returns the shape that the node declares.
    pub fn shape(&self) -> Result<NodeShape, foley_nodes::core::fault::Reject> {
        self.standalone(1).shape()
    }

    /// Returns true if every required stream of the node has items, and every port of events an event.
    pub fn has_input(&self) -> bool {
        self.feeds.iter().flatten().all(Feed::has_items)
    }

    /// Returns true if a parameter is 0 whose default is not.
    pub fn has_zero(&self) -> bool {
        !self.ty().zeros(&*self.params).is_empty()
    }

    /// Returns the time at which the node ends or is stopped.
    pub fn length(&self) -> Tick {
        self.end
    }

    /// Returns a window longer than the trial.
    pub fn whole_window(&self) -> Tick {
        let ahead = self.feeds.iter().flatten().map(|feed| match feed.shape() {
            LinkShape::Stream(stream) => stream.end.unwrap_or(0),
            LinkShape::Events(end) => end.unwrap_or(0),
            LinkShape::Value(_) => 0,
        });
        2 * self.end + 2 * ahead.max().unwrap_or(0) + TICKS_PER_SECOND
    }

    /// Returns the highest rate at any port; 1 kHz without streams.
    pub fn fastest_rate(&self) -> Rate {
        let outputs = self.shape().map(|shape| shape.outputs).unwrap_or_default();
        let inputs = (0..self.feeds.len()).filter_map(|port| self.input_rate(port));
        let rates = outputs.into_iter().flatten().map(|stream| stream.rate).chain(inputs);
        rates.max_by(|a, b| a.as_f64().total_cmp(&b.as_f64())).unwrap_or(Rate::hz(1000))
    }

    /// Returns the rate of the first link of an input, if it is a stream.
    pub fn input_rate(&self, port: usize) -> Option<Rate> {
        match self.feeds[port].first()?.shape() {
            LinkShape::Stream(stream) => Some(stream.rate),
            _ => None,
        }
    }

    /// Returns the number of items of the first link of an input, if it is a stream.
    pub fn input_items(&self, port: usize) -> Option<i64> {
        match self.feeds[port].first()?.shape() {
            LinkShape::Stream(stream) => stream.end.map(|end| stream.rate.first_at(end)),
            _ => None,
        }
    }

    /// Returns the trial with other numbers in one item of an input stream.
    pub fn varied(&self, port: usize, item: usize, rng: &mut Rng) -> Self {
        let mut feeds = self.feeds.clone();
        feeds[port][0] = feeds[port][0].vary(item, rng).expect("only streams are varied");
        let (params, files) = (self.params.boxed(), self.files.clone());
        Self { feeds, params, files, ..*self }
    }

    /// Returns the parameters.
    pub fn params(&self) -> &dyn AnyParams {
        &*self.params
    }

    /// Returns the inputs with the parameters and files of another trial of the node.
    pub fn with_params(&self, other: &Self) -> Self {
        let (params, files) = (other.params.boxed(), other.files.clone());
        Self { feeds: self.feeds.clone(), params, files, ..*self }
    }

    /// Runs to the end.
    pub fn run(&self, window: Tick) -> Outcome {
        let standalone = self.standalone(window);
        let run = standalone.run().unwrap_or_else(|fault| panic!("{fault}: {self:?}"));
        Outcome::new(&standalone, &run, self)
    }
}

impl Trial {
    /// Runs the first windows in one node, saves its state, and resumes in another node.
    pub fn interrupted(&self, window: Tick, windows: usize) -> Outcome {
        let failed = |fault: Fault| -> ! { panic!("{fault}: {self:?}") };
        let first = self.standalone(window);
        let mut run = first.start().unwrap_or_else(|e| failed(e));
        for _ in 0..windows {
            run.step().unwrap_or_else(|e| failed(e));
        }
        let saved = run.save().unwrap_or_else(|e| failed(e));
        drop(run);
        let mut second = self.standalone(window);
        second.outputs = first.outputs.to_resume();
        let mut run = second.start().unwrap_or_else(|e| failed(e));
        run.restore(&saved).unwrap_or_else(|e| failed(e));
        while run.step().unwrap_or_else(|e| failed(e)) {}
        run.finish().unwrap_or_else(|e| failed(e));
        Outcome::new(&second, &run, self)
    }
}

/// All outputs of a run.
pub struct Outcome {
    streams: Vec<(Option<Rate>, usize, Vec<u32>)>,
    events: Vec<String>,
    values: Vec<Option<[u8; 32]>>,
    file: Option<Vec<u8>>,
    summary: String,
    times: Vec<Vec<(Tick, String)>>,
    /// True if all numbers in streams are finite.
    pub finite: bool,
}

impl Outcome {
    fn new(standalone: &Standalone, run: &StandaloneRun, trial: &Trial) -> Self {
        let ports = 0..trial.ty().outputs.len();
        let shape = trial.shape().expect("an accepted trial has a shape");
        let mut finite = true;
        let streams = ports.clone().map(|port| {
            let (numbers, ok) = run.numbers(port);
            finite &= ok;
            let stream = shape.outputs[port].as_ref();
            let items = stream.map_or(1, |s| s.rate.first_at(trial.end).max(1)) as usize;
            let width = numbers.len() / items;
            (stream.map(|s| s.rate), width, numbers.iter().map(|x| x.to_bits()).collect())
        });
        let streams = streams.collect();
        let times: Vec<Vec<_>> = ports
            .clone()
            .map(|port| run.events_json(port).into_iter().map(|(t, e)| (t, e.to_string())).collect())
            .collect();
        Self {
            streams,
            events: times.iter().map(|events| format!("{events:?}")).collect(),
            values: ports.map(|port| run.value(port).map(|value| value.hash())).collect(),
            file: standalone.outputs.get("trial.out"),
            summary: format!("{:?}", run.summary),
            times,
            finite,
        }
    }

    /// Returns all outputs for comparison.
    pub fn bits(self) -> impl PartialEq {
        (self.streams, self.events, self.values, self.file, self.summary)
    }

    /// Returns the time of the earliest item or event that differs.
    pub fn first_difference(&self, other: &Self) -> Option<Tick> {
        let streams = self.streams.iter().zip(&other.streams).filter_map(|((rate, width, a), (_, _, b))| {
            let at = a.iter().zip(b).position(|(a, b)| a != b)?;
            Some(rate.as_ref()?.tick((at / (*width).max(1)) as i64))
        });
        let events = self.times.iter().zip(&other.times).filter_map(|(a, b)| {
            let at = a
                .iter()
                .zip(b)
                .position(|(a, b)| a != b)
                .or_else(|| (a.len() != b.len()).then_some(a.len().min(b.len())))?;
            a.get(at).into_iter().chain(b.get(at)).map(|(tick, _)| *tick).min()
        });
        streams.chain(events).min()
    }
}
