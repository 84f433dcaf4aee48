//! Strength of an excitation, found by another node: a number, and a multiplier at each speed.

use super::law::Law;
use super::speed_curve::{MAX_FACTOR, POINTS, SpeedCurve};
use crate::core::fault::Reject;
use crate::core::item::Data;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Strength of an excitation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strength {
    /// Force at 1 N and 1 m/s, N.
    pub kappa: f64,
    /// Multiplier at each speed; 1 without a curve.
    pub curve: Option<SpeedCurve>,
}

impl Strength {
    /// A strength that is the same at any speed.
    #[must_use]
    pub fn constant(kappa: f64) -> Self {
        Self { kappa, curve: None }
    }

    /// The strength at a speed, m/s.
    #[must_use]
    pub fn at(&self, speed: f64) -> f64 {
        self.kappa * self.curve.map_or(1.0, |curve| f64::from(curve.at(speed as f32)))
    }
}

impl Data for Strength {
    const NAME: &'static str = "strength";

    fn trial(rng: &mut Rng) -> Self {
        let factors = [(); POINTS].map(|()| rng.between(0.1, 10.0));
        let curve = (rng.below(2) == 0).then(|| {
            let curve = SpeedCurve::new(rng.between(0.1, 2.0), factors);
            if rng.below(2) == 0 { curve } else { curve.of_relief() }
        });
        Self { kappa: rng.between(-10.0, 10.0), curve }
    }
}

/// The strength that is linked to `kappa`, where one is.
pub(in crate::scrape) fn linked(kappa: Option<Arc<Strength>>) -> Result<Option<Strength>, Reject> {
    let Some(found) = kappa.as_deref().copied() else { return Ok(None) };
    let problem = if !found.kappa.is_finite() || found.kappa.abs() > MAX_FACTOR {
        format!("is {}; -{MAX_FACTOR} to {MAX_FACTOR} are taken", found.kappa)
    } else if !found.curve.is_none_or(|curve| curve.holds()) {
        format!("has factors by speed that are not all between 0 and {MAX_FACTOR}")
    } else {
        return Ok(Some(found));
    };
    Err(Reject::new("F128", format!("the strength that is linked to `kappa` {problem}")).at("kappa"))
}

/// The law of three numbers, the strength in front; with one that is linked in place of it.
pub(in crate::scrape) fn law(numbers: [f64; 3], linked: Option<Strength>, rate: f64) -> Law {
    Law { curve: linked.and_then(|strength| strength.curve), ..Law::new(numbers, rate) }
}

/// Returns true if the linked strength is 0: then `out` is silent, and nothing else needs to be computed.
pub(in crate::scrape) fn silent(linked: Option<Strength>, out: &mut [f32]) -> bool {
    let silent = linked.is_some_and(|strength| strength.kappa == 0.0);
    if silent {
        out.fill(0.0);
    }
    silent
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_goes_through_its_points_and_on_as_at_its_ends() {
        let factors = std::array::from_fn(|k| (1 + k * k) as f64);
        let curve = SpeedCurve::new(1.2, factors);
        let speeds = SpeedCurve::speeds(1.2);
        assert!((speeds[0] - 0.3).abs() < 1e-12 && (speeds[POINTS - 1] - 4.8).abs() < 1e-12);
        for (speed, factor) in speeds.into_iter().zip(factors) {
            assert!((f64::from(curve.at(speed as f32)) / factor - 1.0).abs() < 1e-4, "{speed}");
        }
        assert_eq!([0.0, 0.1, 50.0].map(|v| curve.at(v)), [1.0, 1.0, 257.0]);
        let half = (speeds[3] * speeds[4]).sqrt() as f32;
        assert!((curve.at(half) - 13.5).abs() < 1e-3, "{}", curve.at(half));
        let strength = Strength { kappa: 2.0, curve: Some(curve) };
        assert!((strength.at(1.2) - 130.0).abs() < 1e-2 && Strength::constant(3.0).at(9.0) == 3.0);
    }

    #[test]
    fn strengths_that_are_none_are_refused() {
        let reported = |strength: Strength| linked(Some(Arc::new(strength))).unwrap_err().to_string();
        assert!(reported(Strength::constant(f64::NAN)).contains("NaN"));
        assert!(reported(Strength::constant(2e6)).contains("2000000"));
        let curve = |middle: f64, factor: f64| Some(SpeedCurve::new(middle, [factor; POINTS]));
        for curve in [curve(1.0, -1.0), curve(1.0, f64::NAN), curve(0.0, 1.0), curve(f64::NAN, 1.0)] {
            assert!(reported(Strength { kappa: 1.0, curve }).contains("factors by speed"), "{curve:?}");
        }
        assert!(linked(None).unwrap().is_none());
    }
}
