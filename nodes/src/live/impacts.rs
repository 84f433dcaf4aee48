//! Blows from outside.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::{Inbox, Message};
use crate::core::node::{Class, Node};
use crate::core::params::{Params, Text};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
use crate::modal::Impact;
use crate::{params, ports};

params! {
    /// Blows that come in while the graph plays: from OSC, or as JSON lines on standard input.
    ///
    /// A blow falls when it arrives, or at the time that it says. Offline none comes.
    pub struct LiveImpactsParams {
        /// The name under which they are sent: `/foley/impact/CHANNEL`.
        channel: Text;
        /// How long to listen; None listens for ever.
        duration: Option<f64> = None, unit "s", range 0.0..=1.0e6_f64;
    }
}
ports! {
    /// Ports of `LiveImpacts`.
    pub struct LiveImpactsPorts / LiveImpactsIo {
        in {}
        out {
            /// The blows.
            impacts: Events<Impact>,
        }
    }
}

/// A blow as a message.
#[must_use]
pub fn to_message(impact: &Impact) -> Option<Message> {
    let [x, y, z] = impact.position.map(f64::from);
    Message::new(&[
        impact.impulse.into(),
        impact.energy.into(),
        impact.hardness.into(),
        impact.duration.into(),
        impact.object.into(),
        impact.point.into(),
        x,
        y,
        z,
    ])
}

/// The blow of a message; `None` where it is none.
#[must_use]
pub fn from_message(message: &Message) -> Option<Impact> {
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
    };
    impact.is_valid().then_some(impact)
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
        Ok(Self { inbox: cx.inputs.open(&p.channel.0) })
    }

    fn run(&mut self, mut io: LiveImpactsIo<'_>) -> Result<(), Fault> {
        let (_, to) = io.impacts.window();
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(to)) {
            if let Some(impact) = from_message(&message) {
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
    fn a_blow_survives_its_message() {
        let mut impact = Impact::from_velocity(2.0, Body { mass: 0.2, restitution: 0.5 });
        impact.position = [1.0, -2.0, 0.5];
        impact.point = 3;
        assert_eq!(from_message(&to_message(&impact).unwrap()), Some(impact));
        assert_eq!(from_message(&Message::new(&[1.0]).unwrap()), None);
        assert_eq!(Message::new(&[f64::NAN]), None);
    }
}
