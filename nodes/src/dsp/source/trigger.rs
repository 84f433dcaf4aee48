//! The start of a sound as an event.

use crate::core::item::Event;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};
/// The start of a sound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trigger {
    /// Amplitude factor.
    pub gain: f32,
}

impl Event for Trigger {
    const NAME: &'static str = "trigger";

    fn trial(rng: &mut Rng) -> Self {
        Self { gain: rng.between(0.0, 1.0) as f32 }
    }
}
