//! How strong a force was, for the summary of a run.

use crate::core::node::Summary;

/// Peak and root of the mean square of a force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Meter {
    peak: f32,
    squares: f64,
    samples: u64,
}

impl Meter {
    /// Takes in the next samples.
    pub fn add(&mut self, samples: &[f32]) {
        for x in samples {
            self.peak = self.peak.max(x.abs());
            self.squares += f64::from(*x) * f64::from(*x);
        }
        self.samples += samples.len() as u64;
    }

    /// What to tell at the end.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let rms = (self.squares / self.samples.max(1) as f64).sqrt();
        vec![("peak_n", f64::from(self.peak).into()), ("rms_n", rms.into())]
    }
}
