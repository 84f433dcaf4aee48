//! Weights of sounds as streams.

use super::constraints::{Constraint, Overlap};
use super::directive::SOFT;

/// Weights of the sounds of a score that come as a stream: item `k` holds from `k / rate` to `(k + 1) / rate`.
#[derive(Clone, Copy, Debug)]
pub struct WeightStream<'a> {
    /// Items per second.
    pub rate: f64,
    /// Index of the first item.
    pub first: i64,
    /// Number of sounds.
    pub width: usize,
    /// Weights by item and sound; the last item holds on.
    pub items: &'a [f32],
}

impl WeightStream<'_> {
    /// Adds the constraints of an interval, in s, as [`Constraints::at`](super::Constraints::at).
    pub fn add(&self, from: f64, to: f64, found: &mut Overlap, mut forbidden: Option<&mut Vec<usize>>) {
        let count = (self.items.len() / self.width.max(1)) as i64;
        if count == 0 {
            return;
        }
        let (a, b) = (from * self.rate - self.first as f64, to * self.rate - self.first as f64);
        let (start, end) = ((a + 1e-6).floor() as i64, (b - 1e-6).ceil() as i64);
        for sound in 0..self.width {
            let (mut sum, mut is_one, mut is_minus_one) = (0.0, true, true);
            for k in start..end.max(start + 1) {
                let index = k.clamp(0, count - 1) as usize * self.width + sound;
                let x =
                    self.items.get(index).copied().filter(|x| x.is_finite()).unwrap_or(0.0).clamp(-1.0, 1.0);
                let share = (b.min((k + 1) as f64) - a.max(k as f64)).max(0.0);
                sum += share * f64::from(x);
                is_one &= x == 1.0;
                is_minus_one &= x == -1.0;
            }
            if is_minus_one && let Some(forbidden) = forbidden.as_mut() {
                forbidden.push(sound);
                continue;
            }
            let weight = if is_one { 1.0 } else { (sum / (b - a).max(1e-12)).clamp(-SOFT, SOFT) };
            found.add(Constraint { set: sound, weight, is_hard: is_one, layer: sound % 2 });
        }
    }
}
