//! Parameters that all players of matched events share.

use crate::core::random::Rng;
use crate::core::time::Rate;
use crate::params;

params! {
    /// Levels and voices of a player, and its output.
    pub struct PlaybackParams {
        /// Factor on the output.
        gain: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Scales samples to the exact energy of the match, by at most 6 dB.
        match_gain: bool = false;
        /// Maximum number of simultaneous samples; above it those with the least remaining energy are stolen. 64 is
        /// good for live use.
        max_voices: usize = 4096, unit "voices", range 1..=65_536;
        /// Duration of the output after the last event, for the jitter and the longest sample.
        tail: f64 = 0.6, unit "s", range 0.0..=60.0;
        /// Sample rate of the audio.
        rate: Rate = Rate::hz(48_000);
    }
}

impl PlaybackParams {
    /// A few voices at a low rate, for trials.
    pub(super) fn small(rng: &mut Rng) -> Self {
        let rate = Rate::hz([4000, 8000, 8820][rng.below(3)]);
        let (max_voices, tail) = (1 + rng.below(20), rng.between(0.0, 0.1));
        Self { gain: 1.0, match_gain: false, max_voices, tail, rate }
    }

    /// The same with the gains of other parameters, which change while samples sound.
    pub(super) fn with_gains_of(&self, other: &Self) -> Self {
        Self { gain: other.gain, match_gain: other.match_gain, ..*self }
    }
}
