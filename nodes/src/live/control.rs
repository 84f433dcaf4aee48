//! Numbers from outside, as a stream.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::{Inbox, Message};
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::{Params, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick, ticks};
use crate::{params, ports};

/// Most numbers of one message.
const MOST: usize = 16;

/// The numbers of a control as a message; `None` where they are more than it takes, or not finite.
#[must_use]
pub fn control_to_message(numbers: &[f64]) -> Option<Message> {
    (numbers.len() <= MOST).then(|| Message::new(numbers))?
}

params! {
    /// Numbers that come in while the graph plays, such as a position, a speed or a level, as a stream.
    ///
    /// Each message sets all channels; the stream goes to them on a straight line. Offline it stays at `initial`.
    pub struct LiveControlParams {
        /// The name under which they are sent: `/foley/control/CHANNEL`.
        channel: Text;
        /// The numbers before the first message, one per channel of the stream.
        initial: Vec<f64> = vec![0.0], unit "", range -1.0e9_f64..=1.0e9_f64;
        /// How long the stream takes to the numbers of a message.
        glide: f64 = 0.02, unit "s", range 0.0..=60.0;
        /// Items per second.
        rate: Rate = Rate::hz(48_000);
        /// How long to listen; None listens for ever.
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

/// Several numbers that go to targets on straight lines of a set number of items.
#[derive(Clone, Debug, PartialEq)]
pub struct Glide {
    from: Vec<f64>,
    to: Vec<f64>,
    items: u64,
    passed: u64,
}

impl Glide {
    /// At rest.
    #[must_use]
    pub fn new(numbers: &[f64], items: u64) -> Self {
        Self { from: numbers.to_vec(), to: numbers.to_vec(), items, passed: items }
    }

    /// Starts towards other numbers; those that are missing stay.
    pub fn go_to(&mut self, numbers: &[f64]) {
        for k in 0..self.to.len() {
            self.from[k] = self.at(k);
            if let Some(x) = numbers.get(k) {
                self.to[k] = *x;
            }
        }
        self.passed = 0;
    }

    fn at(&self, k: usize) -> f64 {
        if self.passed >= self.items {
            self.to[k]
        } else {
            self.from[k] + (self.to[k] - self.from[k]) * (self.passed as f64 / self.items as f64)
        }
    }

    /// Writes the next items.
    pub fn fill(&mut self, out: &mut [f32]) {
        for item in out.chunks_exact_mut(self.to.len().max(1)) {
            self.passed = self.passed.saturating_add(1);
            for (k, x) in item.iter_mut().enumerate() {
                *x = self.at(k) as f32;
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
        if p.initial.is_empty() || p.initial.len() > MOST {
            let message = format!("`initial` has {} numbers; 1 to {} are needed", p.initial.len(), MOST);
            return Err(Reject::new("F051", message).at("initial"));
        }
        s.ends(p.duration.map(ticks));
        s.output(LiveControlPorts::values, p.rate, Channels(p.initial.len() as u16));
        Ok(())
    }

    fn build(p: &LiveControlParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let items = (p.glide * p.rate.as_f64()).round() as u64;
        Ok(Self { inbox: cx.inputs.open(&p.channel.0), glide: Glide::new(&p.initial, items), rate: p.rate })
    }

    fn run(&mut self, mut io: LiveControlIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.values.first(), io.values.width().max(1));
        let out = io.values.items();
        let end: Tick = self.rate.tick(first + (out.len() / width) as i64);
        let mut done = 0;
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(end)) {
            let message: Message = message;
            let at = ((self.rate.first_at(tick) - first).max(0) as usize * width).clamp(done, out.len());
            self.glide.fill(&mut out[done..at]);
            self.glide.go_to(message.numbers());
            done = at;
        }
        self.glide.fill(&mut out[done..]);
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
        if self.glide.to.len() == old.glide.to.len() {
            self.glide.from.copy_from_slice(&old.glide.from);
            self.glide.to.copy_from_slice(&old.glide.to);
            (self.glide.items, self.glide.passed) = (old.glide.items, old.glide.passed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_reached_on_a_straight_line() {
        let mut glide = Glide::new(&[0.0, 1.0], 4);
        let mut out = [0.0; 4];
        glide.fill(&mut out);
        assert_eq!(out, [0.0, 1.0, 0.0, 1.0]);
        glide.go_to(&[1.0]);
        let mut out = [0.0; 12];
        glide.fill(&mut out);
        assert_eq!(out, [0.25, 1.0, 0.5, 1.0, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    }
}
