//! An event with its sample.

use serde::{Deserialize, Serialize};

use crate::core::item::Event;
use crate::core::random::Rng;
use crate::core::time::Tick;
use crate::crumple::bank::trial_bank;
use crate::crumple::events::Crumple;

/// An event with the sample that is played for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchedCrumple {
    /// Lowest vertex; with the time it identifies the event.
    pub id: u32,
    /// Index of the sample in the bank, in order of energy.
    pub sample: u32,
    /// Desired energy of the sample, full scale^2.
    pub wanted: f64,
    /// Digest of the bank of `sample`.
    pub bank: u32,
    /// Energy of the event.
    pub energy: f64,
    /// 1 outwards, -1 inwards.
    pub sign: i8,
    /// Index of the material.
    pub material: u16,
    /// Centre, m.
    pub position: [f32; 3],
    /// Mean normal.
    pub normal: [f32; 3],
    /// Frame interval of the motion, in ticks.
    pub interval: Tick,
}

impl Event for MatchedCrumple {
    const NAME: &'static str = "matched crumples";

    fn trial(rng: &mut Rng) -> Self {
        let crumple = Crumple::trial(rng);
        Self::new(&crumple, rng.below(3) as u32, rng.between(0.001, 10.0), trial_bank().id())
    }
}

impl MatchedCrumple {
    /// Creates an event with its sample.
    #[must_use]
    pub fn new(crumple: &Crumple, sample: u32, wanted: f64, bank: u32) -> Self {
        let Crumple { id, energy, sign, material, position, normal, interval, .. } = *crumple;
        Self { id, sample, wanted, bank, energy, sign, material, position, normal, interval }
    }
}
