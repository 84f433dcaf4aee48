//! Sound pressure of a mode, by models of how its surface radiates.

use super::modal_model::ModalModel;
use crate::choices;
use std::f64::consts::PI;

/// Density of air, kg/m^3.
pub const AIR_DENSITY: f64 = 1.2;
/// Speed of sound in air, m/s.
pub const SOUND_SPEED: f64 = 343.0;
/// Share of the net flow in the absolute one below which a mode radiates as a dipole.
const DIPOLE: f64 = 0.05;

choices! {
    /// How a mode radiates.
    pub enum Radiance {
        /// One and the same for all modes: the amplitude of a mode is its velocity after an impulse, as in the paper.
        Unit,
        /// Pressure of the net volume that a mode displaces, as a point source: for objects that are small against the wavelength.
        VolumeVelocity,
        /// Pressure of the power that a pulsating, or for modes without net volume oscillating, sphere of as much surface radiates.
        Sphere,
    }
}

impl Radiance {
    /// Pressure at a distance in m over the velocity of the mode, Pa s kg^(-1/2) / m; signed for `VolumeVelocity`.
    ///
    /// # Source
    /// A point source has `p = rho0 Q' / (4 pi r)`. The power of a surface is `sigma rho0 c0 S <v_n^2>`, with the efficiency
    /// `(k a)^2 / (1 + (k a)^2)` of a pulsating and `(k a)^4 / (4 + (k a)^4)` of an oscillating sphere.
    #[must_use]
    pub fn per_velocity(self, model: &ModalModel, mode: usize, distance: f64) -> f64 {
        let omega = model.lambda[mode].sqrt();
        match self {
            Self::Unit => 1.0,
            Self::VolumeVelocity => AIR_DENSITY * model.net_flow[mode] * omega / (4.0 * PI * distance),
            Self::Sphere => {
                let efficiency = efficiency(model, mode);
                let flow = (efficiency * model.square_flow[mode] / (4.0 * PI)).sqrt();
                AIR_DENSITY * SOUND_SPEED * flow / distance
            }
        }
    }
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
