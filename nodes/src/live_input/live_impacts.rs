//! The node `LiveImpacts`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::{Inbox, MAX_COUNT, Message, MessageKind};
use crate::core::node::{Class, Node};
use crate::core::params::{Params, Text};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
use crate::modal::Impact;
use crate::{params, ports};

params! {
    /// Impacts that come in while the graph plays: from OSC, or as JSON lines on standard input.
    ///
    /// The time of an impact is that of its arrival, or the time in its message. In an offline run there are no impacts.
    pub struct LiveImpactsParams {
        /// Name of the channel: messages are sent to `/foley/impact/CHANNEL`.
        channel: Text;
        /// Time to receive messages; None for no limit.
        duration: Option<f64> = None, unit "s", range 0.0..=1.0e6_f64;
    }
}
ports! {
    /// Ports of `LiveImpacts`.
    pub struct LiveImpactsPorts / LiveImpactsIo {
        in {}
        out {
            /// The impacts.
            impacts: Events<Impact>,
        }
    }
}

/// Encodes an impact.
#[must_use]
pub fn impact_to_message(impact: &Impact) -> Option<Message> {
    let [x, y, z] = impact.position.map(f64::from);
    let numbers = [
        impact.impulse.into(),
        impact.energy.into(),
        impact.hardness.into(),
        impact.duration.into(),
        impact.object.into(),
        impact.point.into(),
        x,
        y,
        z,
    ];
    Message::new(MessageKind::Impact, &numbers)
}

/// Decodes an impact; returns `None` for any other message.
#[must_use]
pub fn impact_from_message(message: &Message) -> Option<Impact> {
    let [impulse, energy, hardness, duration, object, point, x, y, z] = *message.numbers() else {
        return None;
    };
    let impact = Impact {
        impulse: impulse as f32,
        energy: energy as f32,
        hardness: hardness as f32,
        duration: duration as f32,
        object: object as u32,
        point: point as u32,
        position: [x as f32, y as f32, z as f32],
        // What is sent is relative to the object.
        local: [x as f32, y as f32, z as f32],
    };
    (message.kind() == MessageKind::Impact && impact.is_valid()).then_some(impact)
}

/// The node `LiveImpacts`.
pub struct LiveImpacts {
    inbox: Option<Box<dyn Inbox>>,
}

impl Node for LiveImpacts {
    type Params = LiveImpactsParams;
    type Ports = LiveImpactsPorts;
    const NAME: &'static str = "LiveImpacts";
    const CLASS: Class = Class::Audio;

    fn shape(p: &LiveImpactsParams, s: &mut Shape<'_, '_, LiveImpactsPorts>) -> Result<(), Reject> {
        s.ends(p.duration.map(ticks));
        Ok(())
    }

    fn build(p: &LiveImpactsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { inbox: cx.inputs.open(&p.channel.0, MessageKind::Impact, MAX_COUNT) })
    }

    fn run(&mut self, mut io: LiveImpactsIo<'_>) -> Result<(), Fault> {
        let (_, end) = io.impacts.window();
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(end)) {
            if let Some(impact) = impact_from_message(&message) {
                io.impacts.push(tick, impact);
            }
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (LiveImpactsParams, MemoryFiles) {
        let params = LiveImpactsParams::trial(rng);
        let duration = params.duration.map(|_| rng.between(0.0, 0.5));
        (LiveImpactsParams { duration, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::Body;

    #[test]
    fn encoding_and_decoding_an_impact_changes_nothing() {
        let mut impact = Impact::from_velocity(2.0, Body { mass: 0.2, restitution: 0.5 });
        impact.position = [1.0, -2.0, 0.5];
        impact.local = impact.position;
        impact.point = 3;
        assert_eq!(impact_from_message(&impact_to_message(&impact).unwrap()), Some(impact));
        assert_eq!(impact_from_message(&Message::new(MessageKind::Impact, &[1.0]).unwrap()), None);
        assert_eq!(Message::new(MessageKind::Impact, &[f64::NAN]), None);
    }
}
