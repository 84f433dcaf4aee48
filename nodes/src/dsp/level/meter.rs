//! Peak and root mean square.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::impl_state;
use serde::{Deserialize, Serialize};
/// How loud a whole recording is, all channels together.
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

/// Measures a [`Level`] block by block.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelMeter {
    peak: f32,
    sum_squares: f64,
    samples: u64,
}
impl_state!(LevelMeter { peak, sum_squares, samples });

impl LevelMeter {
    /// Takes in samples, one after the other, so that blocks do not change a bit.
    pub fn process(&mut self, samples: &[f32]) {
        self.process_each(samples);
    }

    /// The same of any samples, such as those of one channel.
    pub fn process_each<'a>(&mut self, samples: impl IntoIterator<Item = &'a f32>) {
        for &x in samples {
            self.peak = self.peak.max(x.abs());
            self.sum_squares += f64::from(x) * f64::from(x);
            self.samples += 1;
        }
    }

    /// The level of everything so far; that of silence where there was nothing.
    #[must_use]
    pub fn level(&self) -> Level {
        Level { peak: self.peak, rms: (self.sum_squares / self.samples.max(1) as f64).sqrt() }
    }
}
