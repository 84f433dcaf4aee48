//! Mixtures of two sounds, coefficient by coefficient.

use crate::choices;
use crate::soundtrack::score::{NodeSet, SourceSet};
use crate::soundtrack::wavelet::TextureModel;

choices! {
    /// Sound where targets of two sounds overlap.
    pub enum OverlapMode {
        /// The sound of the greater weight.
        Winner,
        /// Both, as geometric means of the magnitudes of their coefficients: between their spectra and envelopes.
        Geometric,
        /// Both, as means of their coefficients: at the same time.
        Linear,
    }
}

impl OverlapMode {
    /// True if both sounds are heard.
    #[must_use]
    pub fn is_mixed(self) -> bool {
        self != Self::Winner
    }
}

/// Steps of the exponent of a moment.
const STEPS: usize = 16;
/// Most nodes of a level that moments are taken over.
const MOST: usize = 4096;
/// Least magnitude of a coefficient in a geometric mean.
const FLOOR: f64 = 1e-9;

/// Logarithms of the mean of `|d|^(2 k / STEPS)` of coefficients, for `k` from 0 to `STEPS`.
#[derive(Clone, Debug)]
struct Moments([f64; STEPS + 1]);

impl Moments {
    fn new(model: &TextureModel, level: usize, set: &NodeSet) -> Self {
        let channels = model.tree.channels;
        let stride = set.len().div_ceil(MOST).max(1);
        let (mut sums, mut count) = ([0.0; STEPS + 1], 0.0);
        for node in set.iter().step_by(stride) {
            let k = node as usize * channels;
            for value in model.tree.details[level].get(k..k + channels).unwrap_or_default() {
                let factor = magnitude(*value).powf(2.0 / STEPS as f64);
                let mut power = 1.0;
                for sum in &mut sums {
                    *sum += power;
                    power *= factor;
                }
                count += 1.0;
            }
        }
        Self(sums.map(|sum| if count > 0.0 { f64::ln(sum / count) } else { 0.0 }))
    }

    /// The logarithm of the mean of `|d|^(2 share)`.
    fn at(&self, share: f64) -> f64 {
        let x = (share * STEPS as f64).clamp(0.0, STEPS as f64);
        let k = (x as usize).min(STEPS - 1);
        self.0[k] + (x - k as f64) * (self.0[k + 1] - self.0[k])
    }
}

fn magnitude(value: f32) -> f64 {
    f64::from(value.abs()).max(FLOOR)
}

/// Two sets of sounds that are mixed at one level.
#[derive(Clone, Copy, Debug)]
pub struct Mixture {
    mode: OverlapMode,
    /// Share of the first one.
    share: f64,
    gain: f64,
}

impl Mixture {
    /// A coefficient of both.
    pub fn mix(&self, a: f32, b: f32) -> f32 {
        let share = self.share;
        if share >= 1.0 || share <= 0.0 {
            return if share >= 1.0 { a } else { b };
        }
        let mixed = match self.mode {
            OverlapMode::Geometric => {
                let size = magnitude(a).powf(share) * magnitude(b).powf(1.0 - share);
                let is_first = share * f64::from(a.abs()) >= (1.0 - share) * f64::from(b.abs());
                size.copysign(f64::from(if is_first { a } else { b }))
            }
            OverlapMode::Winner | OverlapMode::Linear => share * f64::from(a) + (1.0 - share) * f64::from(b),
        };
        (self.gain * mixed) as f32
    }
}

/// Mixtures of the sets of a score.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), section 8, names the morphing of overlaps as future work; the rules are ours.
#[derive(Clone, Debug)]
pub struct Morph {
    mode: OverlapMode,
    /// By set and level.
    moments: Vec<Vec<Moments>>,
}

impl Morph {
    /// Prepares the mixtures of sets.
    ///
    /// # Complexity
    /// Linear in the nodes of the sets, up to 4096 of each level.
    pub fn new(mode: OverlapMode, model: &TextureModel, sets: &[SourceSet]) -> Self {
        let of = |set: &SourceSet| {
            set.included.iter().enumerate().map(|(level, nodes)| Moments::new(model, level, nodes)).collect()
        };
        Self { mode, moments: sets.iter().map(of).collect() }
    }

    /// The mixture of two sets at a level, `share` of the first. Its gain brings the mean power of independent coefficients to that between both
    /// sets: as levels in dB for geometric means, as powers for linear ones.
    pub fn mixture(&self, level: usize, sets: [usize; 2], share: f64) -> Mixture {
        let moments = |k: usize| self.moments.get(sets[k]).and_then(|of| of.get(level));
        let gain = match (moments(0), moments(1)) {
            (Some(a), Some(b)) => {
                let (whole, rest) = ([a.at(1.0), b.at(1.0)], 1.0 - share);
                let log = match self.mode {
                    OverlapMode::Geometric => share * whole[0] + rest * whole[1] - a.at(share) - b.at(rest),
                    OverlapMode::Winner | OverlapMode::Linear => {
                        let [a, b] = whole.map(f64::exp);
                        ((share * a + rest * b) / (share * share * a + rest * rest * b)).ln()
                    }
                };
                (0.5 * log).exp()
            }
            _ => 1.0,
        };
        Mixture { mode: self.mode, share, gain }
    }
}

#[cfg(test)]
mod tests;
