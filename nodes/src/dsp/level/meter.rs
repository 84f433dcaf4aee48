//! Peak and root mean square of a recording.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::impl_state;
use serde::{Deserialize, Serialize};
/// The level of a whole recording, over all channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Largest magnitude of a sample.
    pub peak: f32,
    /// Root mean square of all samples.
    pub rms: f64,
}

impl Data for Level {
    const NAME: &'static str = "level";

    fn trial(rng: &mut Rng) -> Self {
        let peak = rng.between(0.01, 2.0) as f32;
        Self { peak, rms: f64::from(peak) * rng.between(0.01, 1.0) }
    }
}

/// Measures a [`Level`] in blocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelMeter {
    peak: f32,
    sum_squares: f64,
    samples: u64,
}
impl_state!(LevelMeter { peak, sum_squares, samples });

impl LevelMeter {
    /// Adds samples. The cut into blocks does not change the bits of the result.
    pub fn process(&mut self, samples: &[f32]) {
        self.process_each(samples);
    }

    /// Adds samples of an iterator, such as those of one channel.
    pub fn process_each<'a>(&mut self, samples: impl IntoIterator<Item = &'a f32>) {
        for &x in samples {
            self.peak = self.peak.max(x.abs());
            self.sum_squares += f64::from(x) * f64::from(x);
            self.samples += 1;
        }
    }

    /// Returns the level of all samples so far; without samples, that of silence.
    #[must_use]
    pub fn level(&self) -> Level {
        Level { peak: self.peak, rms: (self.sum_squares / self.samples.max(1) as f64).sqrt() }
    }
}
