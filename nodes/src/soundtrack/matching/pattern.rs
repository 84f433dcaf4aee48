//! A part of a motion that others are compared with, and its comparison with one of them.

use super::dtw::{envelope, outside, squared_distance};
use crate::choices;
use crate::soundtrack::motion::{CurveError, MotionCurve};
use thiserror::Error;

choices! {
    /// Normalisation of a motion before it is compared.
    pub enum Normalisation {
        /// Its mean.
        Offset,
        /// Nothing.
        None,
        /// Its mean and its standard deviation.
        ZScore,
    }
}

/// Rules of a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QueryRules {
    /// Shortest interval, as a factor of the query.
    pub shortest: f64,
    /// Longest interval, as a factor of the query.
    pub longest: f64,
    /// Least similarity.
    pub threshold: f64,
    /// Deviation from a uniform change of tempo, as a share of the query.
    pub radius: f64,
    /// Normalisation of motions.
    pub normalisation: Normalisation,
    /// Try every length, not only those with the ratio of a fourth of an octave.
    pub exhaustive: bool,
    /// Greatest number of matches, the most similar ones; `None` for all.
    pub count: Option<usize>,
    /// Share of similar intervals that iterative deepening may miss; `None` for the exact search.
    pub tolerance: Option<f64>,
}

impl Default for QueryRules {
    fn default() -> Self {
        Self {
            shortest: 0.5,
            longest: 2.0,
            threshold: 0.7,
            radius: 0.1,
            normalisation: Normalisation::Offset,
            exhaustive: false,
            count: None,
            tolerance: None,
        }
    }
}

/// The reason why a query is impossible.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum QueryError {
    /// A curve is wrong.
    #[error("{0}")]
    Curve(#[from] CurveError),
    /// Other channels.
    #[error("the query has {query} channels, the motion {motion}")]
    Channels {
        /// Number of channels of the query.
        query: usize,
        /// Number of channels of the motion.
        motion: usize,
    },
    /// Other rates.
    #[error("the query has {query} frames a second, the motion {motion}")]
    Rates {
        /// Rate of the query.
        query: f64,
        /// Rate of the motion.
        motion: f64,
    },
    /// Outside of its curve, or too short.
    #[error(
        "the query is from {from} s to {to} s, and the curve ends at {end:.3} s; at least {MIN_FRAMES} frames are needed"
    )]
    Interval {
        /// Its start.
        from: f64,
        /// Its end.
        to: f64,
        /// End of the curve.
        end: f64,
    },
    /// It does not move.
    #[error("the motion from {from} s to {to} s is constant: no similarity to it is defined")]
    Flat {
        /// Its start.
        from: f64,
        /// Its end.
        to: f64,
    },
    /// It was stopped.
    #[error("stopped")]
    Stopped,
}

/// The least number of frames of a query.
const MIN_FRAMES: usize = 4;

/// Buffers of one comparison.
#[derive(Default)]
pub struct Scratch {
    /// Mean and factor of each channel.
    pub normal: Vec<(f32, f32)>,
    /// Extremes of the means of neighbouring windows.
    pub means: Vec<Option<[f32; 2]>>,
    /// The window that was written last.
    pub window: Vec<f32>,
    /// Piecewise means of it.
    pub pieces: Vec<f32>,
    /// Rows of dynamic time warping.
    pub rows: [Vec<f64>; 2],
}

/// Frames that the first bound is taken of.
pub const COARSE: usize = 16;

/// The frames of a window at the times of the frames of the query.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Frames of the window.
    pub len: usize,
    /// For each frame of the query, the frame of the window before it, and the share of the next.
    pub points: Vec<(usize, f32)>,
}

impl Grid {
    /// The frames of windows of a length.
    pub fn new(len: usize, frames: usize) -> Self {
        let point = |j: usize| {
            let at = j as f64 * (len - 1) as f64 / (frames - 1) as f64;
            let k = (at as usize).min(len.saturating_sub(2));
            (k, (at - k as f64) as f32)
        };
        Self { len, points: (0..frames).map(point).collect() }
    }
}

/// The query.
pub struct Pattern {
    /// The rules.
    pub rules: QueryRules,
    /// Numbers of a frame.
    pub channels: usize,
    /// Frames of the query.
    pub frames: usize,
    /// Its values, normalised.
    pub values: Vec<f32>,
    /// Extremes within the radius of each frame.
    pub envelope: Vec<[f32; 2]>,
    /// Frames in the order in which windows differ most.
    pub order: Vec<usize>,
    /// Frames that a frame may be off.
    pub radius: usize,
    /// Standard deviation of the query.
    pub deviation: f64,
    /// Squared distance at the threshold.
    pub most: f64,
}

/// Mean and factor that normalise a channel.
pub fn normaliser(rule: Normalisation, sums: [f64; 2], n: f64) -> (f32, f32) {
    let mean = sums[0] / n;
    let deviation = (sums[1] / n - mean * mean).max(0.0).sqrt();
    match rule {
        Normalisation::None => (0.0, 1.0),
        Normalisation::Offset => (mean as f32, 1.0),
        Normalisation::ZScore => (mean as f32, if deviation > 1e-9 { (1.0 / deviation) as f32 } else { 0.0 }),
    }
}

impl Pattern {
    /// Prepares a part of a motion.
    ///
    /// # Errors
    /// An interval that is not of the motion or too short, and one that is flat.
    pub fn new(source: &MotionCurve, (from, to): (f64, f64), rules: QueryRules) -> Result<Self, QueryError> {
        source.validate()?;
        let channels = source.channels;
        let (start, end) = ((from * source.rate).round(), (to * source.rate).round());
        let fits = start >= 0.0 && end - start >= MIN_FRAMES as f64 && end <= source.frames() as f64;
        if !fits {
            return Err(QueryError::Interval { from, to, end: source.seconds() });
        }
        let (start, end) = (start as usize, end as usize);
        let frames = end - start;
        let mut values = source.values[start * channels..end * channels].to_vec();
        let mut variance = 0.0;
        for c in 0..channels {
            let of =
                |x: &[f32]| x.iter().skip(c).step_by(channels).map(|x| f64::from(*x)).collect::<Vec<f64>>();
            let own = of(&values);
            let sums = [own.iter().sum(), own.iter().map(|x| x * x).sum()];
            let (mean, factor) = normaliser(rules.normalisation, sums, frames as f64);
            values.iter_mut().skip(c).step_by(channels).for_each(|x| *x = (*x - mean) * factor);
            let own = of(&values);
            let mean = own.iter().sum::<f64>() / frames as f64;
            variance += own.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / frames as f64;
        }
        let deviation = variance.sqrt();
        let scale =
            source.values[start * channels..end * channels].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        if deviation <= 1e-7 * f64::from(scale).max(1e-30) {
            return Err(QueryError::Flat { from, to });
        }
        let radius = (rules.radius * frames as f64).round() as usize;
        let envelope = envelope(&values, channels, radius);
        let far = |j: usize| -> f64 {
            envelope[j * channels..(j + 1) * channels].iter().map(|e| outside(0.0, *e)).sum()
        };
        let mut order: Vec<usize> = (1..frames - 1).collect();
        order.sort_by(|a, b| far(*b).total_cmp(&far(*a)).then(a.cmp(b)));
        let limit: f64 = -rules.threshold.max(1e-12).ln() * deviation * (frames as f64).sqrt();
        Ok(Self { rules, channels, frames, values, envelope, order, radius, deviation, most: limit * limit })
    }

    /// The lengths of windows of up to `most` frames.
    pub fn lengths(&self, most: usize) -> Vec<usize> {
        let n = self.frames as f64;
        let (short, long) = (self.rules.shortest * n, self.rules.longest * n);
        let mut all: Vec<usize> = if self.rules.exhaustive {
            (short.ceil() as usize..=long.floor() as usize).collect()
        } else {
            let steps = (4.0 * (long / short).log2()).round().max(0.0) as usize;
            (0..=steps).map(|k| (short * 2_f64.powf(k as f64 / 4.0)).round() as usize).collect()
        };
        all.retain(|len| (2..=most).contains(len));
        all.dedup();
        all
    }

    /// A number of a window that is stretched to the query and normalised.
    #[inline]
    fn value(&self, grid: &Grid, window: &[f32], normal: &[(f32, f32)], j: usize, c: usize) -> f32 {
        let (k, t) = grid.points[j];
        let at = k * self.channels + c;
        let (a, b) = (window[at], window[at + self.channels]);
        let (mean, factor) = normal[c];
        (a + t * (b - a) - mean) * factor
    }

    /// A lower bound of the squared distance of a window, from its ends and `points` more frames. It stops above `most`.
    ///
    /// The ends are matched with the ends of the query, and every other frame with one within the radius.
    pub fn bound(&self, grid: &Grid, window: &[f32], normal: &[(f32, f32)], points: usize, most: f64) -> f64 {
        let channels = self.channels;
        let mut bound = 0.0;
        for j in [0, self.frames - 1] {
            for c in 0..channels {
                let x = self.value(grid, window, normal, j, c);
                bound += f64::from(x - self.values[j * channels + c]).powi(2);
            }
        }
        for j in self.order.iter().take(points) {
            if bound > most {
                break;
            }
            for c in 0..channels {
                let x = self.value(grid, window, normal, *j, c);
                bound += outside(x, self.envelope[j * channels + c]);
            }
        }
        bound
    }

    /// Writes a window that is normalised.
    pub fn write(&self, grid: &Grid, window: &[f32], scratch: &mut Scratch) {
        let Scratch { normal, window: out, .. } = scratch;
        out.clear();
        for j in 0..self.frames {
            out.extend((0..self.channels).map(|c| self.value(grid, window, normal, j, c)));
        }
    }

    /// A better lower bound of the squared distance of a window, if it does not exceed `most`.
    pub fn full_bound(&self, grid: &Grid, window: &[f32], scratch: &mut Scratch, most: f64) -> Option<f64> {
        let own = self.bound(grid, window, &scratch.normal, usize::MAX, most);
        if own > most {
            return None;
        }
        self.write(grid, window, scratch);
        let other = envelope(&scratch.window, self.channels, self.radius);
        let other: f64 = other.iter().zip(&self.values).map(|(e, x)| outside(*x, *e)).sum();
        (other <= most).then_some(own.max(other))
    }

    /// The squared distance of a window, if it does not exceed `most`.
    pub fn distance(&self, grid: &Grid, window: &[f32], scratch: &mut Scratch, most: f64) -> Option<f64> {
        self.write(grid, window, scratch);
        self.written_distance(scratch, most)
    }

    /// The squared distance of the window that was written last, if it does not exceed `most`.
    pub fn written_distance(&self, scratch: &mut Scratch, most: f64) -> Option<f64> {
        let Scratch { window, rows, .. } = scratch;
        squared_distance(&self.values, window, self.channels, self.radius, most, rows)
    }

    /// The similarity at a squared distance.
    pub fn similarity(&self, squared: f64) -> f64 {
        (-squared.sqrt() / (self.frames as f64).sqrt() / self.deviation).exp()
    }

    /// The squared distance of one window, of frames of all channels, if it does not exceed `most`; `None` too if a number is not finite.
    pub fn compare(&self, grid: &Grid, window: &[f32], scratch: &mut Scratch, most: f64) -> Option<f64> {
        let n = grid.len as f64;
        scratch.normal.clear();
        for c in 0..self.channels {
            let own = window.iter().skip(c).step_by(self.channels).map(|x| f64::from(*x));
            let sums = own.fold([0.0; 2], |[a, b], x| [a + x, b + x * x]);
            if !sums[1].is_finite() {
                return None;
            }
            scratch.normal.push(normaliser(self.rules.normalisation, sums, n));
        }
        if self.bound(grid, window, &scratch.normal, usize::MAX, most) > most {
            return None;
        }
        self.distance(grid, window, scratch, most)
    }
}
