//! What comes into a graph from outside while it plays.

use super::time::Tick;

/// Most numbers of one message.
pub const MOST: usize = 24;

/// One message: up to [`MOST`] numbers, whose meaning the node that reads them knows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Message {
    numbers: [f64; MOST],
    len: usize,
}

impl Message {
    /// A message of these numbers; `None` where they are too many or one is not finite.
    #[must_use]
    pub fn new(numbers: &[f64]) -> Option<Self> {
        let mut message = Self { numbers: [0.0; MOST], len: numbers.len() };
        let fits = numbers.len() <= MOST && numbers.iter().all(|x| x.is_finite());
        fits.then(|| {
            message.numbers[..numbers.len()].copy_from_slice(numbers);
            message
        })
    }

    /// The numbers.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers[..self.len]
    }
}

/// What a node reads messages from.
pub trait Inbox: Send {
    /// Takes the earliest message before a tick, if one is there; never waits, allocates or locks.
    fn next(&mut self, before: Tick) -> Option<(Tick, Message)>;
}

/// Where messages come from.
pub trait Inputs: Send + Sync {
    /// Starts to collect the messages of a channel; `None` where nothing ever comes, as in an offline run.
    fn open(&self, channel: &str) -> Option<Box<dyn Inbox>>;
}

/// Nothing comes in.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoInputs;

impl Inputs for NoInputs {
    fn open(&self, _: &str) -> Option<Box<dyn Inbox>> {
        None
    }
}
