//! Contacts that damp an object, as a node.

use super::support::Support;
use crate::contact::vector::{dot, norm, scale, sub, widen};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Many};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, ticks};
use crate::rigid::ContactFrame;
use crate::{archive_state, params, ports};
use serde::{Deserialize, Serialize};

params! {
    /// Contacts of an object that last, as supports that damp it: surfaces that it rests on, and grips.
    ///
    /// A contact that has lasted for `min_age` and hardly slides is a support, with a damping coefficient in proportion to its normal force.
    /// Link the output to `supports` of the `ModalBank`: each mode is damped by how much the object would move at the contact, so a
    /// support on a nodal line of a mode leaves that mode as it is.
    ///
    /// # Source
    /// Sterling et al. (IEEE TVCG 25(5), 2019), section 3.2 and equation 21. They state that long-lasting contacts damp; the limits of age and
    /// sliding, and `kappa`, are choices.
    pub struct ContactDampingParams {
        /// Number of the object among the bodies of the contacts; None for any, with positions on body b.
        body: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Damping coefficient of a contact per normal force.
        kappa: f64 = 0.5, unit "s/m", range 0.0..=1.0e6_f64;
        /// Damping along the surface relative to that along the normal: the coefficient of friction.
        mu: f64 = 0.5, unit "", range 0.0..=10.0;
        /// Minimum age of a contact that is a support: an impact must not damp its own sound.
        min_age: f64 = 0.05, unit "s", range 0.0..=10.0;
        /// Sliding speed above which a contact is not a support.
        max_slide: f64 = 0.05, unit "m/s", range 0.0..=1000.0;
        /// Time in which a change of the damping is reached.
        release: f64 = 0.005, unit "s", range 0.0..=1.0;
        /// Position of the origin of the shape in the frame of the object.
        origin: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -1_000_000.0..=1_000_000.0;
        /// Maximum number of simultaneous contacts.
        room: u16 = 64, unit "contacts", range 1..=1024_u16;
    }
}
ports! {
    pub struct ContactDampingPorts / ContactDampingIo {
        in {
            /// The contacts.
            contacts: Many<Events<ContactFrame>>,
        }
        out {
            /// The supports: an event for each change.
            supports: Events<Support>,
        }
    }
}

/// A contact that may be a support.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Contact {
    /// Link and number of the contact.
    key: (u32, u64),
    /// Number of the support.
    id: u64,
    /// First tick at which it counts.
    from: Tick,
    /// True if it is a support.
    supports: bool,
}

/// The node `ContactDamping`.
#[derive(Debug)]
pub struct ContactDamping {
    params: ContactDampingParams,
    contacts: Vec<Contact>,
    /// Contacts so far; supports so far; contacts beyond the room.
    count: u64,
    supports: u64,
    left_out: u64,
    /// Largest damping coefficient, N s/m.
    peak: f32,
}

impl ContactDamping {
    /// Returns the change of a support by a frame of a contact of link `link`.
    fn take(&mut self, link: u32, tick: Tick, frame: &ContactFrame) -> Option<Support> {
        let side = match self.params.body {
            Some(body) if body == frame.bodies[0] => 0,
            Some(body) if body == frame.bodies[1] => 1,
            Some(_) => return None,
            None => 1,
        };
        let key = (link, frame.contact);
        let known = self.contacts.iter().position(|c| c.key == key);
        let force = self.supporting_force(frame).filter(|_| !frame.ends);
        let k = match known {
            Some(k) => k,
            None if frame.ends => return None,
            None if self.contacts.len() == usize::from(self.params.room) => {
                self.left_out += 1;
                return None;
            }
            None => {
                let from = tick + ticks(self.params.min_age);
                self.contacts.push(Contact { key, id: self.count, from, supports: false });
                self.count += 1;
                self.contacts.len() - 1
            }
        };
        let contact = &mut self.contacts[k];
        let force = force.filter(|_| tick >= contact.from);
        let (id, changes) = (contact.id, force.is_some() || contact.supports);
        self.supports += u64::from(force.is_some() && !contact.supports);
        contact.supports = force.is_some();
        if frame.ends {
            self.contacts.swap_remove(k);
        }
        let p = &self.params;
        let coefficient = force.map_or(0.0, |force| (p.kappa * force) as f32);
        self.peak = self.peak.max(coefficient);
        let local = sub(frame.local[side], p.origin).map(|x| x as f32);
        let support = Support { id, local, coefficient, mu: p.mu as f32, release: p.release as f32 };
        changes.then_some(support)
    }

    /// The normal force of a contact that hardly slides.
    fn supporting_force(&self, frame: &ContactFrame) -> Option<f64> {
        let (velocity, normal) = (widen(frame.velocity), widen(frame.normal));
        let slide = norm(sub(velocity, scale(normal, dot(velocity, normal))));
        let force = f64::from(frame.force);
        (force > 0.0 && force.is_finite() && slide <= self.params.max_slide).then_some(force)
    }
}

impl Node for ContactDamping {
    type Params = ContactDampingParams;
    type Ports = ContactDampingPorts;
    const NAME: &'static str = "ContactDamping";
    const CLASS: Class = Class::Audio;

    fn shape(_: &ContactDampingParams, _: &mut Shape<'_, '_, ContactDampingPorts>) -> Result<(), Reject> {
        Ok(())
    }

    fn build(p: &ContactDampingParams, _: &Build<'_>) -> Result<Self, Fault> {
        let contacts = Vec::with_capacity(p.room.into());
        Ok(Self { params: p.clone(), contacts, count: 0, supports: 0, left_out: 0, peak: 0.0 })
    }

    fn run(&mut self, mut io: ContactDampingIo<'_>) -> Result<(), Fault> {
        let ContactDampingIo { contacts, supports, .. } = &mut io;
        contacts.each_in_order(|link, tick, frame| {
            if let Some(support) = self.take(link, tick, frame) {
                supports.push(tick, support);
            }
        });
        Ok(())
    }

    fn finish(&mut self, _: ContactDampingIo<'_>) -> Result<Summary, Fault> {
        let mut summary: Summary = vec![
            ("contacts", self.count.into()),
            ("supports", self.supports.into()),
            ("largest_coefficient_n_s_per_m", self.peak.into()),
        ];
        if self.left_out > 0 {
            summary.push(("contacts_left_out", self.left_out.into()));
        }
        Ok(summary)
    }

    fn retune(&mut self, new: &ContactDampingParams) -> Retune {
        if new.room != self.params.room {
            return Retune::Rebuild;
        }
        // Contacts take new laws with their next frames.
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        (self.count, self.supports, self.left_out, self.peak) =
            (old.count, old.supports, old.left_out, old.peak);
        let room = usize::from(self.params.room);
        self.contacts.extend(old.contacts.iter().take(room));
    }

    archive_state!(contacts, count, supports, left_out, peak);

    fn trial(rng: &mut Rng) -> (ContactDampingParams, MemoryFiles) {
        let params = ContactDampingParams {
            body: [None, Some(0), Some(1)][rng.below(3)],
            max_slide: 5.0,
            room: 1 + rng.below(4) as u16,
            min_age: [0.0, 0.05][rng.below(2)],
            ..ContactDampingParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Event;
    use crate::core::standalone::{Feed, Standalone};

    fn params() -> ContactDampingParams {
        ContactDampingParams { body: Some(1), ..ContactDampingParams::read(&|_| None).unwrap() }
    }

    fn frame(contact: u64, force: f32) -> ContactFrame {
        ContactFrame {
            contact,
            bodies: [0, 1],
            local: [[9.0; 3], [0.03, 0.02, 0.0]],
            force,
            velocity: [0.01, 0.0, -2.0],
            normal: [0.0, 0.0, 1.0],
            begins: false,
            ends: false,
            ..ContactFrame::trial(&mut Rng::new(1))
        }
    }

    /// Frames of one contact at 100 Hz from one time to another, and its end.
    fn contact(contact: u64, force: f32, from: f64, to: f64) -> Vec<(Tick, ContactFrame)> {
        let count = ((to - from) * 100.0).round() as usize;
        let mut all: Vec<_> =
            (0..count).map(|k| (ticks(from + 0.01 * k as f64), frame(contact, force))).collect();
        all.push((ticks(to), ContactFrame { ends: true, force: 0.0, ..frame(contact, 0.0) }));
        all
    }

    fn run(
        p: ContactDampingParams,
        links: &[Vec<(Tick, ContactFrame)>],
        window: f64,
    ) -> Vec<(Tick, Support)> {
        let mut standalone = Standalone::new::<ContactDamping>(p);
        for contacts in links {
            let feed = Feed::events(contacts.clone(), ticks(1.0));
            standalone = standalone.feed(ContactDampingPorts::contacts.index(), feed);
        }
        standalone.window(ticks(window)).run().unwrap().events(ContactDampingPorts::supports)
    }

    #[test]
    fn contacts_support_from_their_age_on_until_they_end() {
        let found = run(params(), &[contact(3, 4.0, 0.1, 0.3)], 0.1);
        let times: Vec<Tick> = found.iter().map(|(tick, _)| *tick).collect();
        let expected: Vec<Tick> = (5..=20).map(|k| ticks(0.1 + 0.01 * f64::from(k))).collect();
        assert!(times.iter().zip(&expected).all(|(a, b)| (a - b).abs() <= 1) && times.len() == 16);
        let first = found[0].1;
        assert_eq!((first.coefficient, first.mu, first.local), (2.0, 0.5, [0.03, 0.02, 0.0]));
        assert_eq!(found[15].1.coefficient, 0.0);
        assert!(found.iter().all(|(_, s)| s.id == first.id && s.is_valid()));
    }

    #[test]
    fn links_are_merged_in_time_however_it_is_cut() {
        let links = [contact(3, 4.0, 0.1, 0.5), contact(3, 1.0, 0.105, 0.6)];
        let all = run(params(), &links, 0.1);
        assert!(all.is_sorted_by_key(|(tick, _)| *tick));
        let ids: std::collections::BTreeSet<u64> = all.iter().map(|(_, s)| s.id).collect();
        assert_eq!(ids.len(), 2, "contacts of two links have two supports");
        for window in [0.0007, 0.013, 1.0] {
            assert_eq!(run(params(), &links, window), all, "{window}");
        }
    }

    #[test]
    fn what_slides_lifts_or_is_another_body_is_no_support() {
        let count = |change: fn(&mut ContactFrame), p: ContactDampingParams| {
            let mut frames = contact(3, 4.0, 0.1, 0.5);
            frames.iter_mut().for_each(|(_, frame)| change(frame));
            run(p, &[frames], 0.1).len()
        };
        assert!(count(|_| {}, params()) > 0);
        assert_eq!(count(|f| f.velocity = [0.1, 0.0, 0.0], params()), 0);
        assert_eq!(count(|f| f.force = 0.0, params()), 0);
        assert_eq!(count(|f| f.force = f32::NAN, params()), 0);
        assert_eq!(count(|_| {}, ContactDampingParams { body: Some(7), ..params() }), 0);
    }
}
