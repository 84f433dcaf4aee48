//! External inputs of a playing graph.

use super::time::Tick;

/// Maximum number of numbers in a message.
pub const MAX_COUNT: usize = 24;

/// Kind of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MessageKind {
    /// An impact.
    Impact,
    /// A frame of a contact.
    Contact,
    /// A trigger.
    Trigger,
    /// The numbers of a control.
    Control,
}

impl MessageKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Impact, Self::Contact, Self::Trigger, Self::Control];

    /// The kind in one word, as in the address of a message.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Impact => "impact",
            Self::Contact => "contact",
            Self::Trigger => "trigger",
            Self::Control => "control",
        }
    }
}

/// One message: its kind, and up to [`MAX_COUNT`] numbers; the node that reads them defines their meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message {
    kind: MessageKind,
    numbers: [f64; MAX_COUNT],
    len: usize,
}

impl Message {
    /// A message of these numbers; `None` where they are too many or one is not finite.
    #[must_use]
    pub fn new(kind: MessageKind, numbers: &[f64]) -> Option<Self> {
        let mut message = Self { kind, numbers: [0.0; MAX_COUNT], len: numbers.len() };
        let fits = numbers.len() <= MAX_COUNT && numbers.iter().all(|x| x.is_finite());
        fits.then(|| {
            message.numbers[..numbers.len()].copy_from_slice(numbers);
            message
        })
    }

    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> MessageKind {
        self.kind
    }

    /// The numbers.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers[..self.len]
    }
}

/// A queue of messages for a node.
pub trait Inbox: Send {
    /// Takes the earliest message before a tick, if there is one; never waits, allocates or locks.
    fn next(&mut self, before: Tick) -> Option<(Tick, Message)>;
}

/// A queue of frames of a fixed size, such as the positions of a mesh.
pub trait Frames: Send {
    /// Writes the newest frame before a tick and returns its time, if one has come since the last call; older ones are
    /// skipped, and later ones wait. It never waits, allocates or locks.
    ///
    /// # Shapes
    /// `into` has as many numbers as were requested when this was opened.
    fn latest(&mut self, before: Tick, into: &mut [f32]) -> Option<Tick>;
}

/// Takes the levels that a node measures to a display.
pub trait Display: Send {
    /// Sends the peak and the root mean square of a stretch of sound, or drops them if nobody has read the ones before; never
    /// waits, allocates or locks.
    fn show(&mut self, peak: f32, rms: f64);
}

/// Exchange of nodes of a playing graph with the outside: messages and frames, and levels for a display.
pub trait Inputs: Send + Sync {
    /// Starts to collect the messages of a kind on a channel, of which the node reads the first `numbers` numbers; `None` if none can
    /// come, as in an offline run.
    fn open(&self, channel: &str, kind: MessageKind, numbers: usize) -> Option<Box<dyn Inbox>>;

    /// Starts to collect the frames of a channel, of `count` numbers each; `None` if none can come.
    fn open_frames(&self, _channel: &str, _numbers: usize) -> Option<Box<dyn Frames>> {
        None
    }

    /// Opens a display of levels, `rate` of them a second; `None` if there is none, as in an offline run.
    fn open_display(&self, _name: &str, _rate: f64) -> Option<Box<dyn Display>> {
        None
    }
}

/// Inputs without messages.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoInputs;

impl Inputs for NoInputs {
    fn open(&self, _: &str, _: MessageKind, _: usize) -> Option<Box<dyn Inbox>> {
        None
    }
}
