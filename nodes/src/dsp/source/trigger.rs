//! The start of a sound as an event.

use crate::core::item::Event;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// The start of a sound.
///
/// Nodes that play one sound ignore `index`, and nodes that play no recording ignore `ratio`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trigger {
    /// Amplitude factor.
    pub gain: f32,
    /// Index of the sound among those of the node that plays it.
    pub index: u32,
    /// Speed of playback as a factor.
    pub ratio: f32,
}

impl Trigger {
    /// Ratios of a valid trigger: four octaves down and up.
    pub const RATIOS: RangeInclusive<f32> = 0.0625..=16.0;

    /// A trigger of sound 0 at its own speed.
    #[must_use]
    pub const fn of(gain: f32) -> Self {
        Self { gain, index: 0, ratio: 1.0 }
    }

    /// A trigger of its gain, and optionally its index and its ratio; `None` for any other numbers.
    #[must_use]
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (gain, index, ratio) = match *numbers {
            [gain] => (gain, 0.0, 1.0),
            [gain, index] => (gain, index, 1.0),
            [gain, index, ratio] => (gain, index, ratio),
            _ => return None,
        };
        let is_index = index.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&index);
        let trigger = Self { gain: gain as f32, index: index as u32, ratio: ratio as f32 };
        (is_index && trigger.is_valid()).then_some(trigger)
    }

    /// Returns true if the gain is finite and the ratio is one of [`Trigger::RATIOS`].
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.gain.is_finite() && Self::RATIOS.contains(&self.ratio)
    }
}

impl Event for Trigger {
    const NAME: &'static str = "trigger";

    fn trial(rng: &mut Rng) -> Self {
        // One random number determines all fields.
        let gain = rng.between(0.0, 1.0);
        let step = (60.0 * gain) as u32;
        let ratio = [1.0, 0.5, 0.75, 1.5, 2.0][step as usize % 5];
        Self { gain: gain as f32, index: step % 4, ratio }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_and_ratio_are_optional_and_other_numbers_are_refused() {
        assert_eq!(Trigger::from_numbers(&[0.5]), Some(Trigger::of(0.5)));
        assert_eq!(Trigger::from_numbers(&[0.5, 3.0]), Some(Trigger { index: 3, ..Trigger::of(0.5) }));
        let all = Trigger { gain: -2.0, index: 7, ratio: 0.5 };
        assert_eq!(Trigger::from_numbers(&[-2.0, 7.0, 0.5]), Some(all));
        let wrong: [&[f64]; 10] = [
            &[],
            &[1.0, 0.0, 1.0, 0.0],
            &[1e40],
            &[f64::NAN],
            &[1.0, -1.0],
            &[1.0, 0.5],
            &[1.0, 1e10],
            &[1.0, 0.0, 0.0],
            &[1.0, 0.0, 16.1],
            &[1.0, 0.0, f64::NAN],
        ];
        assert!(wrong.iter().all(|numbers| Trigger::from_numbers(numbers).is_none()));
    }
}
