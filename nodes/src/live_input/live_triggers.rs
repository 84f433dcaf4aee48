//! The node `LiveTriggers`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::{Inbox, MAX_COUNT, Message, MessageKind};
use crate::core::node::{Class, Node};
use crate::core::params::{Params, Text};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
use crate::dsp::Trigger;
use crate::{params, ports};

params! {
    /// Triggers that come in while the graph plays: from OSC, or as JSON lines on standard input.
    ///
    /// The time of a trigger is that of its arrival, or the time in its message. In an offline run there are no triggers.
    pub struct LiveTriggersParams {
        /// Name of the channel: messages are sent to `/foley/trigger/CHANNEL`.
        channel: Text;
        /// Time to receive messages; None for no limit.
        duration: Option<f64> = None, unit "s", range 0.0..=1.0e6_f64;
    }
}
ports! {
    /// Ports of `LiveTriggers`.
    pub struct LiveTriggersPorts / LiveTriggersIo {
        in {}
        out {
            /// The triggers.
            triggers: Events<Trigger>,
        }
    }
}

/// Encodes a trigger.
#[must_use]
pub fn trigger_to_message(trigger: &Trigger) -> Option<Message> {
    Message::new(MessageKind::Trigger, &[trigger.gain.into(), trigger.index.into(), trigger.ratio.into()])
}

/// Decodes a trigger; returns `None` for any other message.
#[must_use]
pub fn trigger_from_message(message: &Message) -> Option<Trigger> {
    (message.kind() == MessageKind::Trigger).then(|| Trigger::from_numbers(message.numbers()))?
}

/// The node `LiveTriggers`.
pub struct LiveTriggers {
    inbox: Option<Box<dyn Inbox>>,
}

impl Node for LiveTriggers {
    type Params = LiveTriggersParams;
    type Ports = LiveTriggersPorts;
    const NAME: &'static str = "LiveTriggers";
    const CLASS: Class = Class::Audio;

    fn shape(p: &LiveTriggersParams, s: &mut Shape<'_, '_, LiveTriggersPorts>) -> Result<(), Reject> {
        s.ends(p.duration.map(ticks));
        Ok(())
    }

    fn build(p: &LiveTriggersParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { inbox: cx.inputs.open(&p.channel.0, MessageKind::Trigger, MAX_COUNT) })
    }

    fn run(&mut self, mut io: LiveTriggersIo<'_>) -> Result<(), Fault> {
        let (_, end) = io.triggers.window();
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(end)) {
            if let Some(trigger) = trigger_from_message(&message) {
                io.triggers.push(tick, trigger);
            }
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (LiveTriggersParams, MemoryFiles) {
        let params = LiveTriggersParams::trial(rng);
        let duration = params.duration.map(|_| rng.between(0.0, 0.5));
        (LiveTriggersParams { duration, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_and_decoding_a_trigger_changes_nothing() {
        let trigger = Trigger { gain: 0.3, index: u32::MAX, ratio: 0.75 };
        assert_eq!(trigger_from_message(&trigger_to_message(&trigger).unwrap()), Some(trigger));
        let read = |kind, numbers: &[f64]| trigger_from_message(&Message::new(kind, numbers).unwrap());
        assert_eq!(read(MessageKind::Trigger, &[0.25]), Some(Trigger::of(0.25)));
        assert_eq!(read(MessageKind::Trigger, &[1.0, 0.5]), None);
        assert_eq!(read(MessageKind::Control, &[0.25]), None);
    }
}
