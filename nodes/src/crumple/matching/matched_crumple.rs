//! An event with the sample that plays for it.

use serde::{Deserialize, Serialize};

use crate::core::item::Event;
use crate::core::random::Rng;
use crate::core::time::Tick;
use crate::crumple::bank::trial_bank;
use crate::crumple::events::Crumple;

/// A crumple and the recorded sample that is to sound for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchedCrumple {
    /// The lowest vertex of the crumple: with the time, its identity.
    pub id: u32,
    /// Number of the sample in the bank, quietest first.
    pub sample: u32,
    /// Energy that the sample should have, full scale^2 times samples.
    pub wanted: f64,
    /// Digest of the bank that `sample` counts in.
    pub bank: u32,
    /// Energy of the crumple.
    pub energy: f64,
    /// 1 where it snaps outwards, -1 inwards.
    pub sign: i8,
    /// Number of its material.
    pub material: u16,
    /// Its centre, m.
    pub position: [f32; 3],
    /// Its mean normal.
    pub normal: [f32; 3],
    /// Ticks from one frame of the motion to the next.
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
    /// A crumple for which a sample of a bank is to sound.
    #[must_use]
    pub fn new(crumple: &Crumple, sample: u32, wanted: f64, bank: u32) -> Self {
        let Crumple { id, energy, sign, material, position, normal, interval, .. } = *crumple;
        Self { id, sample, wanted, bank, energy, sign, material, position, normal, interval }
    }
}
