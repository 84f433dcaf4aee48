//! Modes of a rectangular membrane, as a value node.

use super::membrane::Membrane;
use super::modes::Modes;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// Modes of a rectangle of taut cloth: a flag or a whipped sheet at the moment it is pulled tight.
    ///
    /// With m and n half waves along its sides a and b a membrane rings at `c / 2 sqrt((m / a)^2 + (n / b)^2)`, where c is the square
    /// root of tension over mass per area. Only odd m and n radiate: the others displace no net volume of air. Gains are the sound
    /// pressure at 1 m by Rayleigh's integral.
    ///
    /// # Source
    /// Morse and Ingard, "Theoretical Acoustics" (1968), section 5.2.
    pub struct MembraneModesParams {
        /// Sides of the sheet, or of the parts of a cloth that turn taut as one.
        size: [f64; 2] = [0.3, 0.3], unit "m", range 0.001..=1000.0;
        /// Force per length of its rim.
        tension: f64 = 200.0, unit "N/m", range 0.001..=1_000_000.0;
        /// Mass per area, as in `TensionImpact`.
        density: f64 = 0.15, unit "kg/m^2", range 0.001..=100.0;
        /// Count of odd numbers of half waves along each side.
        orders: usize = 4, unit "", range 1..=64;
        /// Decay rate of all modes: 60 dB take `6.9 / damping` seconds.
        damping: f64 = 40.0, unit "1/s", range 0.001..=100_000.0;
        /// Fraction of its energy that a mode loses per radian, in addition: cloth damps high modes.
        loss: f64 = 0.05, unit "", range 0.0..=10.0;
        /// Positions of the contact points, from 0 to 1 along each side; empty for one impulse spread over the sheet.
        places: Vec<[f64; 2]> = Vec::new(), unit "", range 0.0..=1.0;
        /// Sound pressure that is full scale.
        full_scale: f64 = 20.0, unit "Pa", range 0.000001..=1_000_000.0;
    }
}
ports! {
    pub struct MembraneModesPorts / MembraneModesIo {
        in {}
        out {
            /// The modes.
            modes: Value<Modes>,
        }
    }
}

/// The node over [`Membrane`].
#[derive(Debug)]
pub struct MembraneModes;

impl Func for MembraneModes {
    type Params = MembraneModesParams;
    type Ports = MembraneModesPorts;
    const NAME: &'static str = "MembraneModes";
    const VERSION: u32 = 2;

    fn check(_: &MembraneModesParams, _: &mut Shape<'_, '_, MembraneModesPorts>) -> Result<(), Reject> {
        Ok(())
    }

    fn eval(p: &MembraneModesParams, _: &Build<'_>, mut io: MembraneModesIo<'_>) -> Result<Summary, Fault> {
        let membrane = Membrane {
            size: p.size,
            tension: p.tension,
            density: p.density,
            damping: p.damping,
            loss: p.loss,
        };
        let modes = membrane
            .modes(p.orders, &p.places, p.full_scale)
            .map_err(|e| Fault::new("F078", e.to_string()))?;
        let mut summary = modes.summary();
        summary.push(("wave_speed_m_per_s", membrane.wave_speed().into()));
        io.modes.set(modes);
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;

    #[test]
    fn the_lowest_default_mode_is_that_of_the_formula() {
        let run =
            Standalone::func::<MembraneModes>(MembraneModesParams::read(&|_| None).unwrap()).run().unwrap();
        let modes = run.value(0).unwrap().get::<Modes>().cloned().unwrap();
        assert_eq!((modes.len(), modes.points()), (16, 1));
        let lowest = 0.5 * (200.0 / 0.15_f64).sqrt() * 2.0_f64.sqrt() / 0.3;
        assert!((modes.frequencies[0] - lowest).abs() < 1e-9);
    }
}
