//! Chosen units that travel between nodes.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use crate::core::item::Item;
use crate::core::random::Rng;
use crate::feature::{FeatureConventions, FeatureFormat};

/// One chosen unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pick {
    /// The unit of the database.
    pub unit: i32,
    /// True if no unit was within `d_max`, and this is the nearest.
    pub fallback: bool,
    /// True if nothing was chosen because the target is silent: `unit` is the previous one.
    pub asleep: bool,
    /// Distance of its features from the target's.
    pub d1: f32,
    /// Sum of distances over the units that were compared; 0 for a fallback.
    pub d2: f32,
}

impl Pick {
    /// A pick whose cost is its distance `d1`; a fallback where that is above `d_max`.
    pub(super) fn of_distance(d1: f64, unit: u32, d_max: f64) -> Self {
        let fallback = d1 > d_max;
        Self {
            unit: unit as i32,
            fallback,
            asleep: false,
            d1: d1 as f32,
            d2: if fallback { 0.0 } else { d1 as f32 },
        }
    }
}

/// The chosen units of a target, one per channel that is treated alone.
#[derive(Debug)]
pub struct Picks;

/// Format of a stream of picks.
#[derive(Clone, Debug, PartialEq)]
pub struct PickFormat {
    /// Picks per unit of the target.
    pub channels: usize,
    /// Conventions of the features from which the picks were chosen.
    pub conventions: Arc<FeatureConventions>,
}

impl PickFormat {
    /// The format of the picks for a target of features.
    #[must_use]
    pub fn of(features: &FeatureFormat) -> Self {
        Self { channels: features.vectors, conventions: Arc::clone(&features.conventions) }
    }
}

impl Item for Picks {
    type Elem = Pick;
    type Format = PickFormat;
    const NAME: &'static str = "picks";
    const COLUMNS: &'static [&'static str] = &["unit", "fallback", "asleep", "d1", "d2"];

    fn width(format: &PickFormat) -> usize {
        format.channels
    }

    fn describe(format: &PickFormat) -> String {
        match format.channels {
            1 => format!("units of {} samples", format.conventions.unit),
            n => format!("units of {} samples for {n} channels", format.conventions.unit),
        }
    }

    fn trial_format(rng: &mut Rng) -> PickFormat {
        PickFormat { channels: 1 + rng.below(2), conventions: Arc::new(FeatureConventions::trial()) }
    }

    fn trial(_: &PickFormat, _: usize, rng: &mut Rng) -> Pick {
        // Some of them beyond any small database.
        let (unit, fallback) = (rng.below(70) as i32, rng.below(5) == 0);
        let d1 = rng.between(0.0, 3.0) as f32;
        Pick { unit, fallback, asleep: false, d1, d2: if fallback { 0.0 } else { 6.0 * d1 } }
    }

    fn finite(pick: &Pick) -> bool {
        pick.d1.is_finite() && pick.d2.is_finite()
    }

    fn poison() -> Pick {
        Pick { d1: f32::NAN, d2: f32::NAN, ..Pick::default() }
    }

    fn numbers(pick: &Pick, out: &mut Vec<f32>) {
        let flag = |flag: bool| f32::from(u8::from(flag));
        out.extend([pick.unit as f32, flag(pick.fallback), flag(pick.asleep), pick.d1, pick.d2]);
    }
}
