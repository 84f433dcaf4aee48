//! The node `LiveControl`, and the linear ramps of its values.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::{Inbox, Message, MessageKind};
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::{Params, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick, ticks};
use crate::{params, ports};

/// Maximum magnitude of a number.
const MAX_NUMBER: f64 = 1e9;
/// Maximum number of values in one message.
const MAX_VALUES: usize = 16;

/// Encodes the numbers of a control; returns `None` if they are too many or not finite.
#[must_use]
pub fn control_to_message(numbers: &[f64]) -> Option<Message> {
    (numbers.len() <= MAX_VALUES).then(|| Message::new(MessageKind::Control, numbers))?
}

params! {
    /// Numbers that come in while the graph plays, such as a position, a speed or a level, as a stream.
    ///
    /// Each message sets all channels; the stream changes to them linearly. Numbers are clamped to the range of `initial`. In an
    /// offline run it stays at `initial`.
    pub struct LiveControlParams {
        /// Name of the channel: messages are sent to `/foley/control/CHANNEL`.
        channel: Text;
        /// Numbers before the first message, one per channel of the stream.
        initial: Vec<f64> = vec![0.0], unit "", range -1.0e9_f64..=1.0e9_f64;
        /// Time in which the stream changes to the numbers of a message.
        glide: f64 = 0.02, unit "s", range 0.0..=60.0;
        /// Items per second.
        rate: Rate = Rate::hz(48_000);
        /// Time to receive messages; None for no limit.
        duration: Option<f64> = None, unit "s", range 0.0..=1.0e6_f64;
    }
}
ports! {
    /// Ports of `LiveControl`.
    pub struct LiveControlPorts / LiveControlIo {
        in {}
        out {
            /// The numbers.
            values: Stream<f32>,
        }
    }
}

/// Linear ramps of several numbers to target values over a fixed number of items.
#[derive(Clone, Debug, PartialEq)]
pub struct Glide {
    start: Vec<f64>,
    target: Vec<f64>,
    items: u64,
    /// Items since the start of the ramps.
    elapsed: u64,
}

impl Glide {
    /// Constant values.
    #[must_use]
    pub fn new(numbers: &[f64], items: u64) -> Self {
        Self { start: numbers.to_vec(), target: numbers.to_vec(), items, elapsed: items }
    }

    /// Starts ramps to other numbers, each clamped to the range of `initial`; the targets of missing numbers do not change.
    pub fn set_targets(&mut self, numbers: &[f64]) {
        for k in 0..self.target.len() {
            self.start[k] = self.value(k);
            if let Some(x) = numbers.get(k) {
                self.target[k] = x.clamp(-MAX_NUMBER, MAX_NUMBER);
            }
        }
        self.elapsed = 0;
    }

    fn value(&self, k: usize) -> f64 {
        if self.elapsed >= self.items {
            self.target[k]
        } else {
            self.start[k] + (self.target[k] - self.start[k]) * (self.elapsed as f64 / self.items as f64)
        }
    }

    /// Writes the next items of all channels.
    pub fn fill(&mut self, out: &mut [f32]) {
        for item in out.chunks_exact_mut(self.target.len().max(1)) {
            self.elapsed = self.elapsed.saturating_add(1);
            for (k, x) in item.iter_mut().enumerate() {
                *x = self.value(k) as f32;
            }
        }
    }
}

/// The node `LiveControl`.
pub struct LiveControl {
    inbox: Option<Box<dyn Inbox>>,
    glide: Glide,
    rate: Rate,
}

impl Node for LiveControl {
    type Params = LiveControlParams;
    type Ports = LiveControlPorts;
    const NAME: &'static str = "LiveControl";
    const CLASS: Class = Class::Audio;

    fn shape(p: &LiveControlParams, s: &mut Shape<'_, '_, LiveControlPorts>) -> Result<(), Reject> {
        if p.initial.is_empty() || p.initial.len() > MAX_VALUES {
            let message =
                format!("`initial` has {} numbers; 1 to {} are needed", p.initial.len(), MAX_VALUES);
            return Err(Reject::new("F051", message).at("initial"));
        }
        s.ends(p.duration.map(ticks));
        s.output(LiveControlPorts::values, p.rate, Channels(p.initial.len() as u16));
        Ok(())
    }

    fn build(p: &LiveControlParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let items = (p.glide * p.rate.as_f64()).round() as u64;
        let inbox = cx.inputs.open(&p.channel.0, MessageKind::Control, p.initial.len());
        Ok(Self { inbox, glide: Glide::new(&p.initial, items), rate: p.rate })
    }

    fn run(&mut self, mut io: LiveControlIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.values.first(), io.values.width().max(1));
        let out = io.values.items();
        let end: Tick = self.rate.tick(first + (out.len() / width) as i64);
        let mut written = 0;
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(end)) {
            let start =
                ((self.rate.first_at(tick) - first).max(0) as usize * width).clamp(written, out.len());
            self.glide.fill(&mut out[written..start]);
            self.glide.set_targets(message.numbers());
            written = start;
        }
        self.glide.fill(&mut out[written..]);
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (LiveControlParams, MemoryFiles) {
        let params = LiveControlParams::trial(rng);
        let (rate, glide) = (Rate::hz(40 + rng.below(900) as u32), rng.between(0.0, 0.1));
        let duration = params.duration.map(|_| rng.between(0.0, 0.5));
        let initial = (0..1 + rng.below(3)).map(|_| rng.between(-1.0, 1.0)).collect();
        (LiveControlParams { rate, glide, duration, initial, ..params }, MemoryFiles::default())
    }

    fn adopt(&mut self, old: &mut Self) {
        if self.glide.target.len() == old.glide.target.len() {
            self.glide.start.copy_from_slice(&old.glide.start);
            self.glide.target.copy_from_slice(&old.glide.target);
            (self.glide.items, self.glide.elapsed) = (old.glide.items, old.glide.elapsed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_beyond_the_range_are_clamped() {
        let mut glide = Glide::new(&[0.0, 1.0], 2);
        glide.set_targets(&[1e39, -1e300]);
        let mut out = [0.0; 6];
        glide.fill(&mut out);
        assert_eq!(out[4..], [1e9, -1e9]);
        assert!(out.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn numbers_change_linearly() {
        let mut glide = Glide::new(&[0.0, 1.0], 4);
        let mut out = [0.0; 4];
        glide.fill(&mut out);
        assert_eq!(out, [0.0, 1.0, 0.0, 1.0]);
        glide.set_targets(&[1.0]);
        let mut out = [0.0; 12];
        glide.fill(&mut out);
        assert_eq!(out, [0.25, 1.0, 0.5, 1.0, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    }
}
