//! The node `ContactPressure`: the pressure of each vertex on the surface that it touches, relative to a light contact.

use crate::contact::item::{Contact, Contacts, Pressures};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::Rate;
use crate::{archive_state, params, ports};

params! {
    /// Estimates the contact pressure of each vertex of a cloth from the distance of the layers and from their closing speed.
    ///
    /// A simulation without forces shows pressure as compression: layers that are pressed together are nearer than those that rest on each other,
    /// and layers that meet approach fast. The pressure is (2 (1 - d / radius))^distance (1 + v / approach) for the distance d and the
    /// closing speed v of the nearest contact: 1 for layers at rest at half the radius, and 0 without contact. Between frames it is linear.
    ///
    /// Linked to `pressure` of `IftNoise`, it is a factor on the power of the friction of each vertex.
    ///
    /// # Complexity
    /// O(vertices) for each item.
    ///
    /// # Source
    /// An addition: An, James and Marschner (SIGGRAPH 2012), section 2, drive friction by speed and area alone. That power grows in proportion
    /// to the normal force is the law of Coulomb for the work of friction.
    pub struct ContactPressureParams {
        /// Distance at which the pressure is 0: `radius` of ContactDetector.
        radius: f32 = 0.05, unit "m", range 0.00001..=10.0;
        /// Exponent of the compression; 0 ignores the distance.
        distance: f32 = 1.0, unit "", range 0.0..=10.0;
        /// Closing speed at which the pressure is twice that of layers at rest; None ignores it.
        approach: Option<f32> = Some(0.5), unit "m/s", range 0.001..=1000.0;
        /// Largest pressure.
        limit: f32 = 12.0, unit "dB", range 0.0..=60.0;
        /// Pressures per second: those of the speeds.
        rate: Rate = Rate::hz(40);
    }
}

ports! {
    pub struct ContactPressurePorts / ContactPressureIo {
        in {
            /// Contacts of a cloth.
            contacts: Stream<Contacts>,
        }
        out {
            /// Pressure per vertex.
            pressures: Stream<Pressures>,
        }
    }
}

/// The pressure of a contact.
#[derive(Clone, Copy, Debug)]
struct Law {
    radius: f32,
    distance: f32,
    /// Change of the distance until the next frame at which the pressure doubles, m.
    approach: Option<f32>,
    limit: f32,
}

impl Law {
    fn new(p: &ContactPressureParams, frames: Rate) -> Self {
        Self {
            radius: p.radius,
            distance: p.distance,
            approach: p.approach.map(|speed| speed / frames.as_f64() as f32),
            limit: libm::powf(10.0, p.limit / 10.0),
        }
    }

    /// Pressure of the contacts of a vertex, the nearest first; the approach of the last frame of a stream is not known.
    fn pressure(&self, slots: &[Contact], has_next: bool) -> f32 {
        let Some(nearest) = slots.first().filter(|c| c.is_some()) else { return 0.0 };
        let compression = 2.0 * (1.0 - nearest.distance / self.radius).max(0.0);
        let closing = self.approach.filter(|_| has_next).map_or(0.0, |a| (-nearest.approach / a).max(0.0));
        let pressure = libm::powf(compression, self.distance) * (1.0 + closing);
        if pressure.is_finite() { pressure.min(self.limit) } else { 0.0 }
    }
}

/// The node `ContactPressure`.
pub struct ContactPressure {
    law: Law,
    slots: usize,
    /// Frames of the stream, if it ends.
    frames: Option<i64>,
    /// Sum and number of the pressures above 0.
    sum: f64,
    count: u64,
}

impl Node for ContactPressure {
    type Params = ContactPressureParams;
    type Ports = ContactPressurePorts;
    const NAME: &'static str = "ContactPressure";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 10.0;

    fn shape(p: &ContactPressureParams, s: &mut Shape<'_, '_, ContactPressurePorts>) -> Result<(), Reject> {
        let contacts = s.input(ContactPressurePorts::contacts);
        s.lookaround(ContactPressurePorts::contacts, 1, 1);
        s.when_ended(ContactPressurePorts::contacts, Ends::Stop);
        s.output(ContactPressurePorts::pressures, p.rate, contacts.format.areas);
        Ok(())
    }

    fn build(p: &ContactPressureParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let contacts = cx.input(ContactPressurePorts::contacts);
        let law = Law::new(p, contacts.rate);
        Ok(Self { law, slots: contacts.format.slots.max(1), frames: contacts.items(), sum: 0.0, count: 0 })
    }

    fn run(&mut self, mut io: ContactPressureIo<'_>) -> Result<(), Fault> {
        let contacts = &io.contacts;
        let (frames, rate) = (contacts.rate(), io.pressures.rate());
        let known = (contacts.around().len() / contacts.width().max(1)) as i64 - contacts.behind() as i64;
        // After its last frame the stream is padded.
        let last = (contacts.first() + known - 1).min(self.frames.map_or(i64::MAX, |n| n - 1));
        let (first, vertices) = (io.pressures.first(), io.pressures.width().max(1));
        for (item, out) in (first..).zip(io.pressures.items().chunks_exact_mut(vertices)) {
            let tick = rate.tick(item);
            let (before, [from, to]) = frames.around(tick);
            let t = (tick - from) as f32 / (to - from).max(1) as f32;
            let frame = |k: i64| {
                let k = k.min(last);
                (contacts.item((k - contacts.first()) as isize), self.frames.is_none_or(|n| k + 1 < n))
            };
            let ((a, a_next), (b, b_next)) = (frame(before), frame(before + 1));
            let slots = a.chunks_exact(self.slots).zip(b.chunks_exact(self.slots));
            for (out, (a, b)) in out.iter_mut().zip(slots) {
                let (a, b) = (self.law.pressure(a, a_next), self.law.pressure(b, b_next));
                *out = a + t * (b - a);
                self.sum += f64::from(*out);
                self.count += u64::from(*out > 0.0);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: ContactPressureIo<'_>) -> Result<Summary, Fault> {
        let mean = self.sum / self.count.max(1) as f64;
        let mut summary: Summary = vec![("mean_pressure", mean.into())];
        if self.count == 0 {
            let text = "no contact is nearer than `radius`, so friction by these pressures is silent: set it to `radius` of ContactDetector";
            summary.push(("warning", text.into()));
        }
        Ok(summary)
    }

    archive_state!(sum, count);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::item::ContactsFormat;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;

    fn contact(distance: f32, approach: f32) -> Contact {
        Contact { surface: 1, distance, approach, ..Contact::default() }
    }

    fn run(p: ContactPressureParams, rows: &[Contact], vertices: usize) -> Vec<f32> {
        let format = ContactsFormat::plain(vec![1e-4; vertices].into(), 1);
        let node = Standalone::new::<ContactPressure>(p).input(
            ContactPressurePorts::contacts,
            Rate::hz(60),
            format,
            rows.to_vec(),
        );
        node.run().unwrap().stream(ContactPressurePorts::pressures)
    }

    fn params() -> ContactPressureParams {
        let defaults = ContactPressureParams::read(&|_| None).unwrap();
        ContactPressureParams { radius: 0.01, rate: Rate::hz(120), ..defaults }
    }

    #[test]
    fn half_the_radius_is_one_and_nearer_layers_press_more() {
        let row = [contact(0.005, 0.0), contact(0.0025, 0.0), contact(0.01, 0.0), Contact::default()];
        let found = run(params(), &[row, row, row].concat(), 4);
        assert_eq!(found.len(), 6 * 4);
        for item in found.chunks_exact(4) {
            let expected = [1.0, 1.5, 0.0, 0.0];
            assert!(item.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-5), "{item:?}");
        }
        let flat = run(ContactPressureParams { distance: 0.0, ..params() }, &row, 4);
        assert_eq!(flat[..4], [1.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn it_is_linear_between_frames_and_constant_after_the_last() {
        let rows = [contact(0.005, 0.0), contact(0.0, 0.0)];
        let found = run(params(), &rows, 1);
        assert_eq!(found, [1.0, 1.5, 2.0, 2.0]);
    }

    #[test]
    fn a_fast_approach_presses_more_up_to_the_limit() {
        // 0.5 m/s are 1/120 m in a frame.
        let p = ContactPressureParams { rate: Rate::hz(60), ..params() };
        let rows = [contact(0.005, -1.0 / 120.0), contact(0.005, 0.5), contact(0.005, -1.0)];
        let found = run(p.clone(), &[rows, rows].concat(), 3);
        assert!((found[0] - 2.0).abs() < 1e-5 && found[1] == 1.0, "{found:?}");
        assert!((found[2] - 10_f32.powf(1.2)).abs() < 1e-3, "limited to 12 dB: {found:?}");
        assert_eq!(found[3..], [1.0; 3], "no approach is known after the last frame");
        let deaf = run(ContactPressureParams { approach: None, ..p }, &rows, 3);
        assert_eq!(deaf, [1.0; 3]);
    }
}
