//! Damping of an object by its contacts over time, as a node.

use super::damping_of_contacts::ContactLaw;
use super::mode_shapes::ModeShapes;
use super::surface_index::SurfaceIndex;
use crate::contact::vector::{dot, norm, scale, sub, widen};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Many, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick, ticks};
use crate::rigid::ContactFrame;
use crate::{archive_state, params, ports};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

params! {
    /// Dampings that supports add to the modes of an object: what it rests on, or is gripped by.
    ///
    /// A contact that has lasted for `min_age` and hardly slides damps each mode by how much the object would move there, in proportion to
    /// its force: a support on a nodal line of a mode leaves that mode as it is. Link the output to `added_damping` of the `ModalBank`.
    /// Every change is reached within `release`.
    ///
    /// Positions are those on body `body` of the contacts, moved to the nearest point of the surface. One that is farther from it than
    /// `max_off_surface` does not count, and the summary says so.
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
        /// Age from which on a contact is a support: an impact must not damp its own sound.
        min_age: f64 = 0.05, unit "s", range 0.0..=10.0;
        /// Sliding speed from which on a contact is no support.
        max_slide: f64 = 0.05, unit "m/s", range 0.0..=1000.0;
        /// Time in which a change of the damping is reached.
        release: f64 = 0.005, unit "s", range 0.0..=1.0;
        /// Maximum distance of a contact from the surface, relative to the size of the object.
        max_off_surface: f64 = 0.05, unit "", range 0.0..=1000.0;
        /// Position of the origin of the shape in the frame of the object.
        origin: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -1_000_000.0..=1_000_000.0;
        /// Maximum number of simultaneous contacts.
        room: u16 = 64, unit "contacts", range 1..=1024_u16;
        /// Dampings per second.
        rate: Rate = Rate::hz(1000);
    }
}
ports! {
    pub struct ContactDampingPorts / ContactDampingIo {
        in {
            /// The contacts.
            contacts: Many<Events<ContactFrame>>,
            /// The surface of the object.
            shapes: Value<ModeShapes>,
        }
        out {
            /// Decay rates in 1/s that add to those of the modes, one channel for each.
            damping: Stream<f32>,
        }
    }
}

/// A contact that may be a support.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Support {
    /// Link and number of the contact.
    key: (u32, u64),
    /// Tick from which on it counts.
    from: Tick,
    /// Decay rates that it adds, 1/s.
    rates: Vec<f64>,
}

/// The node `ContactDamping`.
#[derive(Debug)]
pub struct ContactDamping {
    params: ContactDampingParams,
    shapes: Arc<ModeShapes>,
    index: SurfaceIndex,
    extent: f64,
    scratch: Vec<f64>,
    /// Current supports, then unused ones.
    supports: Vec<Support>,
    used: usize,
    /// Dampings now, the target, and the change per item.
    current: Vec<f64>,
    target: Vec<f64>,
    step: Vec<f64>,
    /// Items until the target is reached.
    remaining: u64,
    /// True if the supports have changed.
    stale: bool,
    /// Contacts off the surface and the largest distance; contacts beyond the room.
    far: (u64, f64),
    left_out: u64,
    /// Largest damping of any mode.
    peak: f64,
}

impl ContactDamping {
    /// Takes a frame of a contact of link `link`.
    fn take(&mut self, link: u32, tick: Tick, frame: &ContactFrame) {
        let side = match self.params.body {
            Some(body) if body == frame.bodies[0] => 0,
            Some(body) if body == frame.bodies[1] => 1,
            Some(_) => return,
            None => 1,
        };
        let key = (link, frame.contact);
        let known = self.supports[..self.used].iter().position(|s| s.key == key);
        if frame.ends {
            if let Some(k) = known {
                self.used -= 1;
                self.supports.swap(k, self.used);
                self.stale = true;
            }
            return;
        }
        let Some(k) = known.or_else(|| self.add(key, tick)) else { return };
        self.stale = true;
        self.supports[k].rates.fill(0.0);
        let Some(force) = self.supporting_force(frame) else { return };
        let surface = self.shapes.surface();
        let position = sub(frame.local[side], self.params.origin);
        let Some((contact, distance)) = self.index.nearest(surface, position) else { return };
        if distance > self.params.max_off_surface * self.extent {
            self.far = (self.far.0 + 1, self.far.1.max(distance));
            return;
        }
        let law = ContactLaw { kappa: self.params.kappa, mu: self.params.mu };
        law.add(surface, &contact, force, &mut self.scratch, &mut self.supports[k].rates);
    }

    /// The index of a contact that begins; none without room for it.
    fn add(&mut self, key: (u32, u64), tick: Tick) -> Option<usize> {
        if self.used == self.supports.len() {
            self.left_out += 1;
            return None;
        }
        let support = &mut self.supports[self.used];
        (support.key, support.from) = (key, tick + ticks(self.params.min_age));
        self.used += 1;
        Some(self.used - 1)
    }

    /// The normal force of a contact that hardly slides.
    fn supporting_force(&self, frame: &ContactFrame) -> Option<f64> {
        let (velocity, normal) = (widen(frame.velocity), widen(frame.normal));
        let slide = norm(sub(velocity, scale(normal, dot(velocity, normal))));
        let force = f64::from(frame.force);
        (force > 0.0 && force.is_finite() && slide <= self.params.max_slide).then_some(force)
    }

    /// Sets the target from the supports at a tick.
    fn aim(&mut self, tick: Tick) {
        self.target.fill(0.0);
        for support in self.supports[..self.used].iter().filter(|s| s.from <= tick) {
            self.target.iter_mut().zip(&support.rates).for_each(|(sum, rate)| *sum += rate);
        }
        self.remaining = self.params.rate.span(1).max(1) as u64;
        self.remaining = (ticks(self.params.release) as u64).div_ceil(self.remaining).max(1);
        let all = self.step.iter_mut().zip(&self.target).zip(&self.current);
        all.for_each(|((step, target), now)| *step = (target - now) / self.remaining as f64);
    }

    /// The dampings of the next item.
    fn advance(&mut self, out: &mut [f32]) {
        match self.remaining {
            0 => {}
            1 => {
                self.current.copy_from_slice(&self.target);
                self.remaining = 0;
                self.peak = self.current.iter().copied().fold(self.peak, f64::max);
            }
            _ => {
                self.current.iter_mut().zip(&self.step).for_each(|(now, step)| *now += step);
                self.remaining -= 1;
            }
        }
        out.iter_mut().zip(&self.current).for_each(|(out, now)| *out = *now as f32);
    }
}

impl Node for ContactDamping {
    type Params = ContactDampingParams;
    type Ports = ContactDampingPorts;
    const NAME: &'static str = "ContactDamping";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 100.0;

    fn shape(p: &ContactDampingParams, s: &mut Shape<'_, '_, ContactDampingPorts>) -> Result<(), Reject> {
        let shapes = s.value(ContactDampingPorts::shapes);
        if let Some(shapes) = &shapes {
            shapes.validate().map_err(|e| Reject::new("F078", e).at("shapes"))?;
            if shapes.len() > usize::from(u16::MAX) {
                let message = format!("{} modes; a stream has at most {} channels", shapes.len(), u16::MAX);
                return Err(Reject::new("F078", message)
                    .at("shapes")
                    .help("leave modes out: `top` of ModelModes"));
            }
        }
        s.tail(ticks(p.release) + p.rate.span(1));
        s.output(ContactDampingPorts::damping, p.rate, Channels(shapes.map_or(1, |s| s.len() as u16)));
        Ok(())
    }

    fn build(p: &ContactDampingParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let shapes = cx.value(ContactDampingPorts::shapes);
        shapes.validate().map_err(|e| Fault::new("F078", e).at("shapes"))?;
        let (index, extent) = (SurfaceIndex::new(shapes.surface()), shapes.surface().extent());
        let zero = vec![0.0; shapes.len()];
        let support = Support { rates: zero.clone(), ..Support::default() };
        Ok(Self {
            params: p.clone(),
            index,
            extent,
            scratch: vec![0.0; 2 * shapes.len()],
            supports: vec![support; p.room.into()],
            used: 0,
            current: zero.clone(),
            target: zero.clone(),
            step: zero,
            remaining: 0,
            stale: false,
            far: (0, 0.0),
            left_out: 0,
            peak: 0.0,
            shapes,
        })
    }

    fn run(&mut self, mut io: ContactDampingIo<'_>) -> Result<(), Fault> {
        let (rate, first, width) = (io.damping.rate(), io.damping.first(), io.damping.width().max(1));
        let mut before = rate.tick(first) - 1;
        for (item, out) in (first..).zip(io.damping.items().chunks_exact_mut(width)) {
            let now = rate.tick(item);
            for (link, contacts) in io.contacts.iter().enumerate() {
                // Those since the previous item; the first item takes those between the windows.
                let events = contacts.events();
                let from =
                    if item == first { 0 } else { events.partition_point(|(tick, _)| *tick <= before) };
                let to = events.partition_point(|(tick, _)| *tick <= now);
                for (tick, frame) in events.get(from..to).unwrap_or_default() {
                    self.take(link as u32, *tick, frame);
                }
            }
            let previous = rate.tick(item - 1);
            let begins = self.supports[..self.used].iter().any(|s| s.from > previous && s.from <= now);
            if std::mem::take(&mut self.stale) || begins {
                self.aim(now);
            }
            self.advance(out);
            before = now;
        }
        // Those after the last item of the window.
        for (link, contacts) in io.contacts.iter().enumerate() {
            let events = contacts.events();
            let from = events.partition_point(|(tick, _)| *tick <= before);
            for (tick, frame) in &events[from..] {
                self.take(link as u32, *tick, frame);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: ContactDampingIo<'_>) -> Result<Summary, Fault> {
        let mut summary: Summary = vec![("largest_damping_per_s", self.peak.into())];
        let (far, distance) = self.far;
        if far > 0 {
            let limit = self.params.max_off_surface * self.extent;
            let text = format!(
                "{far} frames of contacts are up to {distance:.3} m from the surface, more than {limit:.3} m: have the contacts and the shape the same unit and frame?"
            );
            summary.push(("warning", text.into()));
        }
        if self.left_out > 0 {
            summary.push(("contacts_left_out", self.left_out.into()));
        }
        Ok(summary)
    }

    fn retune(&mut self, new: &ContactDampingParams) -> Retune {
        if (new.rate, new.room) != (self.params.rate, self.params.room) {
            return Retune::Rebuild;
        }
        // Contacts take new laws with their next frames.
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        (self.far, self.left_out, self.peak) = (old.far, old.left_out, old.peak);
        if old.shapes.len() != self.shapes.len() {
            return;
        }
        self.current.copy_from_slice(&old.current);
        self.used = old.used.min(self.supports.len());
        let all = self.supports.iter_mut().zip(&old.supports).take(self.used);
        all.for_each(|(to, from)| to.clone_from(from));
        self.stale = true;
    }

    archive_state!(supports, used, current, target, step, remaining, stale, far, left_out, peak);

    fn trial(rng: &mut Rng) -> (ContactDampingParams, MemoryFiles) {
        let params = ContactDampingParams {
            body: [None, Some(0), Some(1)][rng.below(3)],
            max_slide: 5.0,
            max_off_surface: 50.0,
            room: 1 + rng.below(4) as u16,
            rate: Rate::hz([100, 1000, 689][rng.below(3)]),
            min_age: [0.0, 0.05][rng.below(2)],
            release: [0.0, 0.005][rng.below(2)],
            ..ContactDampingParams::trial(rng)
        };
        (ContactDampingParams { origin: [0.0; 3], ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
