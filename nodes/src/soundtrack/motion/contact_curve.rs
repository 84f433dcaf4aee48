//! The node `ContactCurve`.

use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::ports::{Events, Stream};
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick};
use crate::rigid::ContactState;
use crate::{archive_state, choices, params, ports};
use serde::{Deserialize, Serialize};

choices! {
    /// A measure of the contacts of a scene.
    pub enum ContactMeasure {
        /// Sum of the normal forces, N.
        Force,
        /// Greatest speed of slip, m/s.
        Sliding,
        /// Greatest speed of rolling, m/s.
        Rolling,
        /// Sum of the power that is dissipated, W.
        Power,
        /// Number of contacts.
        Count,
    }
}

params! {
    /// Turns the contacts of a physics simulation into a curve: force, speed of slip or rolling, power, or their number.
    ///
    /// As `weights` of a `TextureSynthesis` it directs a sound texture by physics.
    pub struct ContactCurveParams {
        /// The measured quantity.
        measure: ContactMeasure = ContactMeasure::Sliding;
        /// The measure that becomes 1; greater measures are limited to 1. None for the measure itself.
        full: Option<f64> = None, unit "", range 1e-9..=1.0e12_f64;
        /// Items per second.
        rate: Rate = Rate::hz(60);
    }
}
ports! {
    pub struct ContactCurvePorts / ContactCurveIo {
        in {
            /// The contacts.
            states: Events<ContactState>,
        }
        out {
            /// The measure.
            curve: Stream<f32>,
        }
    }
}

/// Maximum number of contacts at a time; more replace the oldest.
const MAX_CONTACTS: usize = 4096;

/// A contact that lasts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Open {
    contact: u64,
    value: f32,
    /// Time after which a contact without an end has ended.
    until: Tick,
}

/// The node `ContactCurve`.
#[derive(Debug)]
pub struct ContactCurve {
    params: ContactCurveParams,
    open: Vec<Open>,
}

impl ContactCurve {
    fn value(&self, state: &ContactState) -> f32 {
        match self.params.measure {
            ContactMeasure::Force => state.frame.force,
            ContactMeasure::Sliding => state.sliding,
            ContactMeasure::Rolling => state.rolling,
            ContactMeasure::Power => state.power,
            ContactMeasure::Count => 1.0,
        }
    }

    fn receive(&mut self, tick: Tick, state: &ContactState) {
        let contact = state.frame.contact;
        self.open.retain(|open| open.contact != contact);
        if state.frame.ends {
            return;
        }
        if self.open.len() == MAX_CONTACTS {
            self.open.remove(0);
        }
        // A contact whose next frame does not come within two frames has ended.
        let until = tick.saturating_add(state.frame.interval.max(0).saturating_mul(2));
        self.open.push(Open { contact, value: self.value(state), until });
    }

    fn measured(&self) -> f32 {
        let values = self.open.iter().map(|open| open.value).filter(|x| x.is_finite());
        let value = match self.params.measure {
            ContactMeasure::Sliding | ContactMeasure::Rolling => values.fold(0.0, f32::max),
            ContactMeasure::Force | ContactMeasure::Power | ContactMeasure::Count => values.sum(),
        };
        self.params.full.map_or(value, |full| (value / full as f32).min(1.0))
    }
}

impl Node for ContactCurve {
    type Params = ContactCurveParams;
    type Ports = ContactCurvePorts;
    const NAME: &'static str = "ContactCurve";
    const CLASS: Class = Class::Audio;

    fn shape(p: &ContactCurveParams, s: &mut Shape<'_, '_, ContactCurvePorts>) -> Result<(), Reject> {
        s.output(ContactCurvePorts::curve, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &ContactCurveParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { params: p.clone(), open: Vec::with_capacity(MAX_CONTACTS) })
    }

    fn run(&mut self, mut io: ContactCurveIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.curve.first(), io.curve.rate());
        let mut events = io.states.events().iter().peekable();
        for (k, out) in (first..).zip(io.curve.items()) {
            let now = rate.tick(k);
            while let Some((tick, state)) = events.next_if(|(tick, _)| *tick <= now) {
                self.receive(*tick, state);
            }
            self.open.retain(|open| open.until >= now);
            *out = self.measured();
        }
        // Those after the last item count for the first of the next window.
        for (tick, state) in events {
            self.receive(*tick, state);
        }
        Ok(())
    }

    archive_state!(open);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Event;
    use crate::core::random::Rng;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;

    fn state(contact: u64, sliding: f32, ends: bool) -> ContactState {
        let mut state = ContactState::trial(&mut Rng::new(1));
        (state.frame.contact, state.frame.ends, state.sliding) = (contact, ends, sliding);
        state.frame.interval = ticks(0.1);
        state
    }

    fn measured(measure: ContactMeasure, full: Option<f64>) -> Vec<f32> {
        let p = ContactCurveParams { measure, full, rate: Rate::hz(10) };
        let events = vec![
            (ticks(0.1), state(1, 2.0, false)),
            (ticks(0.2), state(1, 1.0, false)),
            (ticks(0.2), state(2, 3.0, false)),
            (ticks(0.3), state(2, 3.0, true)),
            (ticks(0.9), state(3, 0.5, false)),
        ];
        let run = |window: f64| {
            Standalone::new::<ContactCurve>(p.clone())
                .events(ContactCurvePorts::states, events.clone(), ticks(1.0))
                .window(ticks(window))
                .run()
                .unwrap()
                .stream(ContactCurvePorts::curve)
        };
        assert_eq!(run(0.07), run(5.0));
        run(5.0)
    }

    #[test]
    fn contacts_count_until_they_end_or_no_frame_comes() {
        assert_eq!(measured(ContactMeasure::Count, None), [0.0, 1.0, 2.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let sliding = measured(ContactMeasure::Sliding, None);
        assert_eq!(sliding[..5], [0.0, 2.0, 3.0, 1.0, 1.0]);
        assert_eq!(measured(ContactMeasure::Sliding, Some(4.0))[2], 0.75);
        assert_eq!(measured(ContactMeasure::Count, Some(1.0))[2], 1.0);
    }
}
