//! Impacts: events from a contact detector, a file, a controller or a game to the nodes that sound.

use crate::core::item::Event;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// One impact on an object.
///
/// It is `Copy` and owns no memory, so that it may cross into the audio thread. Objects and points are numbers; the source of
/// the impacts maps names to them.
///
/// # Example
/// ```
/// use foley_nodes::modal::{Body, Impact};
///
/// let hammer = Body { mass: 0.2, restitution: 0.5 };
/// let impact = Impact::from_velocity(2.0, hammer);
/// assert!((impact.energy - 0.4).abs() < 1e-6 && (impact.impulse - 0.6).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Impact {
    /// Impulse in N s: the integral of the force.
    pub impulse: f32,
    /// Kinetic energy of the approach, in J. More energy makes the contact shorter.
    pub energy: f32,
    /// Stiffness of the pair relative to steel on stone: 1 for steel on stone, about 0.01 for rubber.
    pub hardness: f32,
    /// Contact time in s; 0 if it follows from energy and hardness.
    pub duration: f32,
    /// Number of the object that is struck.
    pub object: u32,
    /// Number of the contact point on it: the row of its modes' gains.
    pub point: u32,
    /// Position in the world, in m.
    pub position: [f32; 3],
    /// Position in the frame of the object, in m.
    pub local: [f32; 3],
}

/// The striking body: its effective mass and restitution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Effective mass in kg: `1 / (1/m1 + 1/m2)`.
    pub mass: f64,
    /// Speed after over speed before, 0 to 1.
    pub restitution: f64,
}

impl Impact {
    fn new(impulse: f64, energy: f64) -> Self {
        Self {
            impulse: impulse as f32,
            energy: energy as f32,
            hardness: 1.0,
            duration: 0.0,
            object: 0,
            point: 0,
            position: [0.0; 3],
            local: [0.0; 3],
        }
    }

    /// Impact of a body at a normal speed, in m/s: `E = m v^2 / 2`, `J = m v (1 + restitution)`.
    #[must_use]
    pub fn from_velocity(speed: f64, body: Body) -> Self {
        let v = speed.abs();
        Self::new(body.mass * v * (1.0 + body.restitution), 0.5 * body.mass * v * v)
    }

    /// Impact of a body with a kinetic energy, in J.
    #[must_use]
    pub fn from_energy(energy: f64, body: Body) -> Self {
        let speed = if body.mass > 0.0 { (2.0 * energy.max(0.0) / body.mass).sqrt() } else { 0.0 };
        Self::from_velocity(speed, body)
    }

    /// Impact of a body that transfers an impulse, in N s.
    #[must_use]
    pub fn from_impulse(impulse: f64, body: Body) -> Self {
        let speed = if body.mass > 0.0 { impulse / (body.mass * (1.0 + body.restitution)) } else { 0.0 };
        Self { impulse: impulse as f32, ..Self::from_velocity(speed, body) }
    }

    /// Returns true if all numbers are finite, and energy, hardness and duration are not negative.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let positive = [self.energy, self.hardness, self.duration];
        positive.iter().all(|x| x.is_finite() && *x >= 0.0)
            && self.impulse.is_finite()
            && self.position.iter().chain(&self.local).all(|x| x.is_finite())
    }
}

impl Event for Impact {
    const NAME: &'static str = "impact";

    fn trial(rng: &mut Rng) -> Self {
        let body = Body { mass: rng.between(0.01, 1.0), restitution: rng.uniform() };
        Self {
            hardness: rng.between(0.01, 1.0) as f32,
            duration: [0.0, rng.between(0.0001, 0.03) as f32][rng.below(2)],
            object: rng.below(3) as u32,
            point: rng.below(3) as u32,
            position: [rng.uniform() as f32, rng.uniform() as f32, rng.uniform() as f32],
            local: [rng.between(0.0, 0.1) as f32, rng.between(0.0, 0.1) as f32, 0.0],
            ..Self::from_velocity(rng.between(0.0, 3.0), body)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocity_energy_and_impulse_describe_the_same_impact() {
        let body = Body { mass: 0.3, restitution: 0.4 };
        let a = Impact::from_velocity(-1.7, body);
        for b in
            [Impact::from_energy(f64::from(a.energy), body), Impact::from_impulse(f64::from(a.impulse), body)]
        {
            assert!(
                (a.energy - b.energy).abs() < 1e-6 && (a.impulse - b.impulse).abs() < 1e-6,
                "{a:?} {b:?}"
            );
        }
    }

    #[test]
    fn a_body_at_rest_or_without_mass_has_no_impulse() {
        let body = Body { mass: 0.0, restitution: 0.4 };
        assert_eq!(Impact::from_velocity(2.0, body).impulse, 0.0);
        assert_eq!(Impact::from_energy(2.0, body).impulse, 0.0);
        assert_eq!(Impact::from_velocity(0.0, Body { mass: 1.0, ..body }).energy, 0.0);
    }

    #[test]
    fn an_impact_fits_into_one_cache_line() {
        assert!(size_of::<Impact>() <= 64);
    }

    #[test]
    fn numbers_that_are_not_finite_are_not_valid() {
        let good = Impact::from_velocity(1.0, Body { mass: 1.0, restitution: 0.0 });
        assert!(good.is_valid());
        assert!(!Impact { impulse: f32::NAN, ..good }.is_valid());
        assert!(!Impact { energy: -1.0, ..good }.is_valid());
        assert!(!Impact { position: [0.0, f32::INFINITY, 0.0], ..good }.is_valid());
    }
}
