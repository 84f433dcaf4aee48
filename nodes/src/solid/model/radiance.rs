//! Sound pressure of a mode, by models of radiation from its surface.

use super::modal_model::ModalModel;
use crate::choices;
use crate::contact::vector::{cross, norm, sub};
use std::f64::consts::PI;

/// Density of air, kg/m^3.
pub const AIR_DENSITY: f64 = 1.2;
/// Speed of sound in air, m/s.
pub const SOUND_SPEED: f64 = 343.0;
/// Share of the net flow in the absolute one below which a mode radiates as a dipole.
const DIPOLE: f64 = 0.05;

choices! {
    /// Radiation of a mode.
    pub enum Radiance {
        /// The same for all modes: the amplitude of a mode is its velocity after an impulse, as in the paper.
        Unit,
        /// Pressure of the net volume that a mode displaces, as a point source: for objects that are small against the wavelength.
        VolumeVelocity,
        /// Pressure of the power that a pulsating, or for modes without net volume oscillating, sphere of as much surface radiates.
        Sphere,
        /// Magnitude of the sum of point sources over the triangles of the surface, which interfere at the listener: for objects whose size is
        /// near the wavelength or below; nothing casts a shadow.
        FaceSum,
    }
}

/// Position of a listener, and its distance from the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Listener {
    /// Distance from the object, m.
    pub distance: f64,
    /// Position, in the coordinates of the mesh, m.
    pub position: [f64; 3],
}

impl Listener {
    /// A listener at a position, or at a distance along z from the centre of mass.
    #[must_use]
    pub fn new(model: &ModalModel, position: Option<[f64; 3]>, distance: f64) -> Self {
        let [x, y, z] = model.centre;
        match position {
            Some(position) => Self { distance: norm(sub(position, model.centre)).max(NEAREST), position },
            None => Self { distance, position: [x, y, z + distance] },
        }
    }
}

/// Smallest distance of a listener from a point source, m.
const NEAREST: f64 = 0.01;

impl Radiance {
    /// Pressure at the listener over the velocity of each mode, as [`per_velocity`](Self::per_velocity).
    #[must_use]
    pub fn pressures(self, model: &ModalModel, listener: &Listener) -> Vec<f64> {
        (0..model.len()).map(|mode| self.per_velocity(model, mode, listener)).collect()
    }

    /// Pressure at the listener over the velocity of the mode, Pa s kg^(-1/2) / m; signed for `VolumeVelocity`.
    ///
    /// # Source
    /// A point source has `p = rho0 Q' / (4 pi r)`. The power of a surface is `sigma rho0 c0 S <v_n^2>`, with the efficiency
    /// `(k a)^2 / (1 + (k a)^2)` of a pulsating and `(k a)^4 / (4 + (k a)^4)` of an oscillating sphere.
    ///
    /// # Complexity
    /// O(triangles) for `FaceSum`, else O(1).
    #[must_use]
    pub fn per_velocity(self, model: &ModalModel, mode: usize, listener: &Listener) -> f64 {
        let (omega, distance) = (model.lambda[mode].sqrt(), listener.distance);
        match self {
            Self::Unit => 1.0,
            Self::VolumeVelocity => AIR_DENSITY * model.net_flow[mode] * omega / (4.0 * PI * distance),
            Self::Sphere => {
                let efficiency = efficiency(model, mode);
                let flow = (efficiency * model.square_flow[mode] / (4.0 * PI)).sqrt();
                AIR_DENSITY * SOUND_SPEED * flow / distance
            }
            Self::FaceSum => AIR_DENSITY * omega / (4.0 * PI) * face_sum(model, mode, listener.position),
        }
    }
}

/// Magnitude of the integral of `n . phi exp(-i k r) / r` over the surface, where `r` is the distance from the listener.
///
/// The shape is linear within a triangle; the quadrature at the middles of its edges is exact for squares.
fn face_sum(model: &ModalModel, mode: usize, listener: [f64; 3]) -> f64 {
    let (surface, k) = (model.surface(), model.lambda[mode].sqrt() / SOUND_SPEED);
    let mut sum = [0.0; 2];
    for triangle in surface.triangles {
        let corners = triangle.map(|i| surface.vertices[i as usize]);
        let normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        let shapes = triangle.map(|i| {
            let along = |axis: usize| f64::from(surface.shape(i as usize, axis)[mode]) * normal[axis];
            along(0) + along(1) + along(2)
        });
        for (p, q) in [(0, 1), (1, 2), (2, 0)] {
            let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (corners[p][axis] + corners[q][axis]));
            let r = norm(sub(listener, middle)).max(NEAREST);
            // The normal is twice the area, and a third of it belongs to each middle.
            let source = 0.5 * (shapes[p] + shapes[q]) / (6.0 * r);
            sum[0] += source * libm::cos(k * r);
            sum[1] += source * libm::sin(k * r);
        }
    }
    libm::hypot(sum[0], sum[1])
}

/// Radiation efficiency of the equivalent sphere.
#[must_use]
pub fn efficiency(model: &ModalModel, mode: usize) -> f64 {
    let radius = (model.area / (4.0 * PI)).sqrt();
    let ka = model.lambda[mode].sqrt() / SOUND_SPEED * radius;
    if model.net_flow[mode].abs() < DIPOLE * model.absolute_flow[mode] {
        ka.powi(4) / (4.0 + ka.powi(4))
    } else {
        ka * ka / (1.0 + ka * ka)
    }
}

/// Damping `c` by the radiated power, 1/s.
#[must_use]
pub fn radiation_damping(model: &ModalModel, mode: usize) -> f64 {
    AIR_DENSITY * SOUND_SPEED * efficiency(model, mode) * model.square_flow[mode]
}
