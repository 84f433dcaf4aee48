//! Supports of an object, on which it rests or by which it is gripped, and the damping that they add to its modes.

use super::contact::Contact;
use super::coupling::Coupling;
use super::damping_of_contacts::ContactLaw;
use super::mode_shapes::ModeShapes;
use super::surface_index::SurfaceIndex;
use crate::core::item::Event;
use crate::core::random::Rng;
use crate::impl_state;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A support that begins, changes or ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Support {
    /// Number of the support, constant while it lasts.
    pub id: u64,
    /// Position in the frame of the object, m.
    pub local: [f32; 3],
    /// Damping coefficient along the normal, N s/m; 0 ends the support.
    pub coefficient: f32,
    /// Damping along the surface relative to that along the normal.
    pub mu: f32,
    /// Time in which the change is reached, s.
    pub release: f32,
}

impl Support {
    /// Its damping.
    fn law(&self) -> ContactLaw {
        ContactLaw { coefficient: self.coefficient.into(), mu: self.mu.into() }
    }

    /// Returns true if all numbers are finite, and all but the position are not negative.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let positive = [self.coefficient, self.mu, self.release];
        positive.iter().all(|x| x.is_finite() && *x >= 0.0) && self.local.iter().all(|x| x.is_finite())
    }
}

impl Event for Support {
    const NAME: &'static str = "supports";

    fn trial(rng: &mut Rng) -> Self {
        Self {
            id: rng.below(3) as u64,
            local: [0.0; 3].map(|_| rng.between(0.0, 0.1) as f32),
            coefficient: [0.0, rng.between(0.0, 5.0) as f32][rng.below(2)],
            mu: rng.between(0.0, 1.0) as f32,
            release: 0.005,
        }
    }
}

/// Maximum number of supports of one object at a time.
const ROOM: usize = 64;

/// The current supports of an object, and the decay rates that they add to its modes.
///
/// Changes are linear over time. Nothing is allocated while it works.
#[derive(Clone, Debug)]
pub struct Supports {
    shapes: Arc<ModeShapes>,
    index: SurfaceIndex,
    /// Maximum distance from the surface, m.
    limit: f64,
    /// Current supports with their points on the surface.
    all: Vec<(Support, Contact)>,
    /// The whole damping matrix, if modes are coupled.
    coupling: Option<Coupling>,
    /// Decay rates now and at the end of the change, 1/s, if modes are not coupled.
    current: Vec<f32>,
    target: Vec<f64>,
    /// Time until the target is reached, s.
    remaining: f64,
    scratch: Vec<f64>,
    /// Supports too far from the surface, the largest distance in m, and supports beyond the room.
    far: (u64, f64),
    left_out: u64,
}
impl_state!(Supports { all, each coupling, current, target, remaining, far, left_out });

impl Supports {
    /// Creates an empty set of supports; those farther from the surface than `max_off_surface` times the size of the object will not count.
    #[must_use]
    pub fn new(shapes: Arc<ModeShapes>, max_off_surface: f64) -> Self {
        let (index, modes) = (SurfaceIndex::new(shapes.surface()), shapes.len());
        let limit = max_off_surface * shapes.surface().extent();
        Self {
            index,
            limit,
            all: Vec::with_capacity(ROOM),
            coupling: None,
            current: vec![0.0; modes],
            target: vec![0.0; modes],
            remaining: 0.0,
            scratch: vec![0.0; 2 * modes],
            far: (0, 0.0),
            left_out: 0,
            shapes,
        }
    }

    /// Couples the modes: the whole damping matrix counts, not only its diagonal.
    #[must_use]
    pub fn coupled(mut self) -> Self {
        self.coupling = Some(Coupling::new(&self.shapes.gains));
        self
    }

    /// Takes a change of a support.
    ///
    /// # Complexity
    /// O(supports * modes), or with coupled modes O(supports * modes^2).
    pub fn take(&mut self, support: &Support) {
        if support.is_valid() {
            self.place(support);
            self.set_target();
            self.remaining = support.release.into();
        }
    }

    /// Adds, moves or removes a support.
    fn place(&mut self, support: &Support) {
        let known = self.all.iter().position(|(other, _)| other.id == support.id);
        let known = known.map(|k| self.all.swap_remove(k));
        if support.coefficient == 0.0 {
            return;
        }
        match self.index.nearest(self.shapes.surface(), support.local.map(f64::from)) {
            Some((_, distance)) if distance > self.limit => {
                self.far = (self.far.0 + 1, self.far.1.max(distance));
            }
            Some(_) if self.all.len() == ROOM => self.left_out += u64::from(known.is_none()),
            Some((contact, _)) => self.all.push((*support, contact)),
            None => {}
        }
    }

    fn set_target(&mut self) {
        let surface = self.shapes.surface();
        if let Some(coupling) = &mut self.coupling {
            coupling.clear();
            self.all.iter().for_each(|(support, contact)| coupling.add(surface, contact, support.law()));
            return;
        }
        self.target.fill(0.0);
        for (support, contact) in &self.all {
            support.law().add(surface, contact, &mut self.scratch, &mut self.target);
        }
    }

    /// The share of the remaining change that is made in the next `step` seconds.
    fn share(&mut self, step: f64) -> f64 {
        let share = if self.remaining > step { step / self.remaining } else { 1.0 };
        self.remaining = (self.remaining - step).max(0.0);
        share
    }

    /// Advances the coupling by `step` seconds, for samples of `interval` seconds.
    pub fn advance_coupling(&mut self, step: f64, interval: f64) {
        let share = self.share(step);
        if let Some(coupling) = &mut self.coupling {
            coupling.advance(share, interval);
        }
    }

    /// The coupling, if modes are coupled.
    #[must_use]
    pub fn coupling(&self) -> Option<&Coupling> {
        self.coupling.as_ref()
    }

    /// Decay rates that are being approached, 1/s, `[modes]`, if modes are not coupled.
    #[must_use]
    pub fn target(&self) -> &[f64] {
        &self.target
    }

    /// Decay rates `step` seconds later, 1/s, `[modes]`, if modes are not coupled.
    pub fn advance(&mut self, step: f64) -> &[f32] {
        let share = self.share(step);
        for (now, target) in self.current.iter_mut().zip(&self.target) {
            *now = if share < 1.0 { *now + (share as f32) * (*target as f32 - *now) } else { *target as f32 };
        }
        &self.current
    }

    /// Takes over the supports of an object with as many modes, moved to this surface.
    pub fn take_state(&mut self, old: &Self) {
        if old.shapes.len() == self.shapes.len() {
            old.all.iter().for_each(|(support, _)| self.place(support));
            self.set_target();
            self.current.copy_from_slice(&old.current);
            if let (Some(new), Some(old)) = (&mut self.coupling, &old.coupling) {
                new.take_state(old);
            }
            self.remaining = old.remaining;
        }
        (self.far, self.left_out) = (old.far, old.left_out);
    }

    /// Warning about the supports, for a summary.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let (far, distance) = self.far;
        if far > 0 {
            let limit = self.limit;
            return Some(format!(
                "{far} supports are up to {distance:.3} m from the surface, more than {limit:.3} m: have contacts and shape the same unit and frame?"
            ));
        }
        (self.left_out > 0)
            .then(|| format!("{} supports beyond {ROOM} at a time were left out", self.left_out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;

    fn support(id: u64, coefficient: f32) -> Support {
        Support { id, local: [0.03, 0.02, 0.0], coefficient, mu: 0.5, release: 0.01 }
    }

    #[test]
    fn dampings_of_supports_add_up_glide_and_end() {
        let shapes = Arc::new(ModeShapes::trial(&mut Rng::new(5)));
        let mut supports = Supports::new(Arc::clone(&shapes), 0.05);
        let (contact, _) = supports.index.nearest(shapes.surface(), [0.03, 0.02, 0.0]).unwrap();
        let (mut scratch, mut one) = (vec![0.0; 2 * shapes.len()], vec![0.0; shapes.len()]);
        ContactLaw { coefficient: 2.0, mu: 0.5 }.add(shapes.surface(), &contact, &mut scratch, &mut one);
        let close = |found: &[f32], factor: f64| {
            found.iter().zip(&one).all(|(f, one)| (f64::from(*f) - factor * one).abs() < 1e-5 * (1.0 + one))
        };
        supports.take(&support(1, 2.0));
        assert!(close(supports.advance(0.005), 0.5), "half of the way");
        assert!(close(supports.advance(0.005), 1.0));
        supports.take(&support(2, 1.0));
        assert!(close(supports.advance(1.0), 1.5));
        supports.take(&support(1, 4.0));
        assert!(close(supports.advance(1.0), 2.5));
        supports.take(&support(1, 0.0));
        supports.take(&support(2, 0.0));
        supports.take(&support(7, 0.0));
        assert!(supports.advance(1.0).iter().all(|x| *x == 0.0));
        assert_eq!(supports.warning(), None);
    }

    #[test]
    fn what_lies_elsewhere_or_is_not_a_number_does_not_damp() {
        let shapes = Arc::new(ModeShapes::trial(&mut Rng::new(5)));
        let mut supports = Supports::new(shapes, 0.05);
        supports.take(&Support { local: [0.0, 0.0, 2.0], ..support(1, 1.0) });
        supports.take(&Support { coefficient: f32::NAN, ..support(2, 1.0) });
        supports.take(&Support { local: [f32::INFINITY; 3], ..support(3, 1.0) });
        assert!(supports.advance(1.0).iter().all(|x| *x == 0.0));
        assert!(supports.warning().unwrap().contains("m from the surface"));
        (0..100).for_each(|id| supports.take(&support(id, 1.0)));
        assert!(supports.all.len() == ROOM && supports.left_out == 36, "{}", supports.left_out);
    }
}
