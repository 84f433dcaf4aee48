//! Curves of a motion.

use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::{Chart, Line};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Longest gap that a straight line fills, s.
const BRIDGED: f64 = 0.1;

/// The reason why a curve cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CurveError {
    /// It has no frame.
    #[error("the curve has no frame")]
    Empty,
    /// It has no channel, or its values are not a whole number of frames.
    #[error("the curve has {values} values for {channels} channels")]
    Shape {
        /// Its values.
        values: usize,
        /// Its channels.
        channels: usize,
    },
    /// A number is not finite.
    #[error("the curve is not finite")]
    NotFinite,
}

/// A motion over time: one or more numbers a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionCurve {
    /// Frames per second.
    pub rate: f64,
    /// Numbers of a frame.
    pub channels: usize,
    /// Values by frame and channel.
    pub values: Vec<f32>,
    /// Frames without a value, from one to before another; their values are a straight line.
    pub gaps: Vec<(usize, usize)>,
}

impl MotionCurve {
    /// Makes a curve of values, some of which are not finite. Gaps of up to 0.1 s are filled by a straight line.
    #[must_use]
    pub fn with_gaps(rate: f64, channels: usize, mut values: Vec<f32>) -> Self {
        let channels = channels.max(1);
        let frames = values.len() / channels;
        values.truncate(frames * channels);
        let is_whole =
            |values: &[f32], k: usize| values[k * channels..(k + 1) * channels].iter().all(|x| x.is_finite());
        let mut gaps = Vec::new();
        let mut from = 0;
        while from < frames {
            if is_whole(&values, from) {
                from += 1;
                continue;
            }
            let to = (from..frames).find(|k| is_whole(&values, *k)).unwrap_or(frames);
            for c in 0..channels {
                let before = from.checked_sub(1).map(|k| values[k * channels + c]);
                let after = (to < frames).then(|| values[to * channels + c]);
                let (a, b) = match (before, after) {
                    (Some(a), Some(b)) => (a, b),
                    (Some(a), None) | (None, Some(a)) => (a, a),
                    (None, None) => (0.0, 0.0),
                };
                for k in from..to {
                    let t = (k + 1 - from) as f32 / (to + 1 - from) as f32;
                    values[k * channels + c] = a + t * (b - a);
                }
            }
            if (to - from) as f64 > BRIDGED * rate || from == 0 || to == frames {
                gaps.push((from, to));
            }
            from = to;
        }
        Self { rate, channels, values, gaps }
    }

    /// The number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.values.len() / self.channels.max(1)
    }

    /// Its duration, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.frames() as f64 / self.rate
    }

    /// The motion at another rate, on straight lines between its frames, with gaps at the same times.
    #[must_use]
    pub fn at_rate(&self, rate: f64) -> Self {
        if (self.rate - rate).abs() < 1e-9 || self.frames() < 2 {
            return Self { rate, ..self.clone() };
        }
        let ratio = self.rate / rate;
        let count = (self.frames() as f64 / ratio).floor() as usize;
        let mut values = Vec::with_capacity(count * self.channels);
        for k in 0..count {
            let at = (k as f64 * ratio).min((self.frames() - 1) as f64);
            let j = (at as usize).min(self.frames() - 2);
            let t = (at - j as f64) as f32;
            values.extend(self.frame(j).iter().zip(self.frame(j + 1)).map(|(a, b)| a + t * (b - a)));
        }
        let scaled = |k: usize| ((k as f64 / ratio).round() as usize).min(count);
        let gaps = self.gaps.iter().map(|(from, to)| (scaled(*from), scaled(*to))).filter(|(a, b)| a < b);
        Self { rate, channels: self.channels, values, gaps: gaps.collect() }
    }

    /// The numbers of a frame.
    #[must_use]
    pub fn frame(&self, k: usize) -> &[f32] {
        self.values.get(k * self.channels..(k + 1) * self.channels).unwrap_or_default()
    }

    /// The values of one channel.
    #[must_use]
    pub fn channel(&self, c: usize) -> Vec<f64> {
        self.values.iter().skip(c).step_by(self.channels.max(1)).map(|x| f64::from(*x)).collect()
    }

    /// Checks that it has frames, and finite values.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn validate(&self) -> Result<(), CurveError> {
        if self.channels == 0 || !self.values.len().is_multiple_of(self.channels) {
            return Err(CurveError::Shape { values: self.values.len(), channels: self.channels });
        }
        if self.values.is_empty() {
            return Err(CurveError::Empty);
        }
        let is_rate = self.rate.is_finite() && self.rate > 0.0;
        if is_rate && self.values.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(CurveError::NotFinite) }
    }
}

impl Data for MotionCurve {
    const NAME: &'static str = "motion curve";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let (rate, step) = (30.0, rng.between(0.1, 0.3));
        let value = |k: usize| (step * k as f64).sin() + 0.3 * (0.37 * step * k as f64).sin();
        let values = (0..240).map(|k| (value(k) + rng.between(-0.01, 0.01)) as f32).collect();
        Self { rate, channels: 1, values, gaps: Vec::new() }
    }

    fn plot(&self) -> Option<String> {
        let line = |c: usize| {
            let points = self.channel(c).into_iter().enumerate().map(|(k, y)| [k as f64 / self.rate, y]);
            Line::new(format!("channel {c}"), points.collect())
        };
        let lines: Vec<Line> = (0..self.channels).map(line).collect();
        (self.frames() > 0).then(|| Chart::of("motion", ("time, s", false), ("value", false), lines).draw())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_gaps_are_bridged_and_long_ones_are_noted() {
        let nan = f32::NAN;
        let curve = MotionCurve::with_gaps(20.0, 1, vec![nan, 1.0, nan, 3.0, nan, nan, nan, 7.0, nan]);
        assert_eq!(curve.values, [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.0]);
        assert_eq!(curve.gaps, [(0, 1), (4, 7), (8, 9)]);
        let two = MotionCurve::with_gaps(20.0, 2, vec![0.0, 5.0, nan, 6.0, 2.0, 7.0, 9.0]);
        assert_eq!((two.frames(), two.frame(1), two.gaps.len()), (3, &[1.0, 6.0][..], 0));
        assert!(MotionCurve::with_gaps(20.0, 1, vec![nan; 3]).gaps == [(0, 3)]);
    }

    #[test]
    fn another_rate_keeps_times() {
        let curve = MotionCurve {
            rate: 4.0,
            channels: 2,
            values: (0..16).map(|k| k as f32).collect(),
            gaps: vec![(2, 4)],
        };
        let fast = curve.at_rate(8.0);
        assert_eq!((fast.frames(), fast.frame(3), fast.gaps.clone()), (16, &[3.0, 4.0][..], vec![(4, 8)]));
        assert_eq!((fast.frame(15), curve.at_rate(2.0).frame(1)), (&[14.0, 15.0][..], &[4.0, 5.0][..]));
        assert_eq!(curve.at_rate(4.0), curve);
    }

    #[test]
    fn curves_that_cannot_be_used_are_refused() {
        let error = |values: Vec<f32>, channels| {
            MotionCurve { rate: 10.0, channels, values, gaps: Vec::new() }.validate()
        };
        assert_eq!(error(vec![], 1), Err(CurveError::Empty));
        assert_eq!(error(vec![1.0; 3], 2).unwrap_err().to_string(), "the curve has 3 values for 2 channels");
        assert_eq!(error(vec![f32::NAN], 1), Err(CurveError::NotFinite));
        assert_eq!(error(vec![1.0; 4], 2), Ok(()));
    }
}
