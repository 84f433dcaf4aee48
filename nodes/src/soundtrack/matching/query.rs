//! A part of a motion that others are compared with.

use super::dtw::{envelope, outside, squared_distance};
use super::matches::MotionMatch;
use crate::choices;
use crate::soundtrack::motion::{CurveError, MotionCurve};
use thiserror::Error;

choices! {
    /// What is removed from a motion before it is compared.
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
    /// What is removed.
    pub normalisation: Normalisation,
    /// Try every length, and not only those with the ratio of a fourth of an octave.
    pub exhaustive: bool,
    /// Greatest number of matches, the most similar ones; `None` for all.
    pub count: Option<usize>,
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
        /// Those of the query.
        query: usize,
        /// Those of the motion.
        motion: usize,
    },
    /// Other rates.
    #[error("the query has {query} frames a second, the motion {motion}")]
    Rates {
        /// That of the query.
        query: f64,
        /// That of the motion.
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
    #[error("the motion from {from} s to {to} s is flat: nothing can be said to be similar to it")]
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
    means: Vec<Option<[f32; 2]>>,
    window: Vec<f32>,
}

/// Frames that the first bound is taken of.
pub const COARSE: usize = 16;

/// The frames of a window at the times of the frames of the query.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Frames of the window.
    pub len: usize,
    points: Vec<(usize, f32)>,
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

/// A query, ready for comparisons.
pub struct Query<'a> {
    curve: &'a MotionCurve,
    rules: QueryRules,
    /// Frames of the query.
    pub frames: usize,
    pub(super) values: Vec<f32>,
    envelope: Vec<[f32; 2]>,
    /// Frames in the order in which windows differ most.
    order: Vec<usize>,
    pub(super) radius: usize,
    /// Standard deviation of the query.
    pub(super) deviation: f64,
    /// Squared distance at the threshold.
    pub most: f64,
    /// Sums of values and of squares before each frame, by channel.
    sums: Vec<[f64; 2]>,
    /// Frames in gaps before each frame.
    gaps: Vec<u32>,
    /// Extremes of the motion from each frame to [`BLOCK`] frames later, by channel.
    extremes: Vec<[f32; 2]>,
}

/// Windows with neighbouring starts that are bounded at once.
pub const BLOCK: usize = 16;

/// Mean and factor that normalise a channel.
fn normaliser(rule: Normalisation, sums: [f64; 2], n: f64) -> (f32, f32) {
    let mean = sums[0] / n;
    let deviation = (sums[1] / n - mean * mean).max(0.0).sqrt();
    match rule {
        Normalisation::None => (0.0, 1.0),
        Normalisation::Offset => (mean as f32, 1.0),
        Normalisation::ZScore => (mean as f32, if deviation > 1e-9 { (1.0 / deviation) as f32 } else { 0.0 }),
    }
}

/// Extremes from each frame to [`BLOCK`] frames later: those within half of it of the frame in the middle.
fn ahead(curve: &MotionCurve) -> Vec<[f32; 2]> {
    let channels = curve.channels;
    let around = envelope(&curve.values, channels, BLOCK / 2);
    let frame = |k: usize| (k + BLOCK / 2).min(curve.frames().saturating_sub(1)) * channels;
    (0..curve.frames()).flat_map(|k| around[frame(k)..frame(k) + channels].iter().copied()).collect()
}

impl<'a> Query<'a> {
    /// Prepares a part of a motion for comparisons with another one.
    ///
    /// # Errors
    /// As [`find_matches`](super::search::find_matches).
    pub fn new(
        curve: &'a MotionCurve,
        source: &MotionCurve,
        (from, to): (f64, f64),
        rules: QueryRules,
    ) -> Result<Self, QueryError> {
        curve.validate()?;
        source.validate()?;
        let channels = curve.channels;
        if source.channels != channels {
            return Err(QueryError::Channels { query: source.channels, motion: channels });
        }
        if (source.rate - curve.rate).abs() > 1e-6 {
            return Err(QueryError::Rates { query: source.rate, motion: curve.rate });
        }
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
        let mut sums = vec![[0.0; 2]; channels];
        for (k, x) in curve.values.iter().enumerate() {
            let [sum, squares] = sums[k];
            sums.push([sum + f64::from(*x), squares + f64::from(*x).powi(2)]);
        }
        let mut gaps = vec![0; curve.frames() + 1];
        for (from, to) in &curve.gaps {
            gaps.get_mut(from + 1..=*to).into_iter().for_each(|gap| gap.fill(1));
        }
        let mut total = 0;
        gaps.iter_mut().for_each(|g| {
            total += *g;
            *g = total;
        });
        let limit: f64 = -rules.threshold.max(1e-12).ln() * deviation * (frames as f64).sqrt();
        Ok(Self {
            curve,
            rules,
            frames,
            values,
            envelope,
            order,
            radius,
            deviation,
            most: limit * limit,
            sums,
            gaps,
            extremes: ahead(curve),
        })
    }

    /// The lengths of windows, in frames.
    pub fn lengths(&self) -> Vec<usize> {
        let (n, most) = (self.frames as f64, self.curve.frames());
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

    /// The number of windows of a length.
    pub fn starts(&self, grid: &Grid) -> usize {
        self.curve.frames() + 1 - grid.len
    }

    /// Finds the normalisation of each channel of a window; returns false if the window has a gap.
    pub fn normalise(&self, grid: &Grid, start: usize, scratch: &mut Scratch) -> bool {
        let channels = self.curve.channels;
        scratch.normal.clear();
        scratch.normal.extend((0..channels).map(|c| {
            let (a, b) = (self.sums[start * channels + c], self.sums[(start + grid.len) * channels + c]);
            normaliser(self.rules.normalisation, [b[0] - a[0], b[1] - a[1]], grid.len as f64)
        }));
        self.gaps[start + grid.len] == self.gaps[start]
    }

    /// A number of a window that is stretched to the query and normalised.
    #[inline]
    fn value(&self, grid: &Grid, start: usize, normal: &[(f32, f32)], j: usize, c: usize) -> f32 {
        let (k, t) = grid.points[j];
        let at = (start + k) * self.curve.channels + c;
        let (a, b) = (self.curve.values[at], self.curve.values[at + self.curve.channels]);
        let (mean, factor) = normal[c];
        (a + t * (b - a) - mean) * factor
    }

    /// A lower bound of the squared distances of up to [`BLOCK`] windows with consecutive starts. It stops above `most`.
    pub fn block_bound(
        &self,
        grid: &Grid,
        start: usize,
        count: usize,
        scratch: &mut Scratch,
        most: f64,
    ) -> f64 {
        let channels = self.curve.channels;
        // Extremes of the means.
        let means = &mut scratch.means;
        means.clear();
        means.extend((0..channels).map(|c| match self.rules.normalisation {
            Normalisation::None => Some([0.0; 2]),
            // The factor of each window is another one.
            Normalisation::ZScore => None,
            Normalisation::Offset => {
                let mean = |k: usize| {
                    let (a, b) = (self.sums[k * channels + c], self.sums[(k + grid.len) * channels + c]);
                    normaliser(Normalisation::Offset, [b[0] - a[0], 0.0], grid.len as f64).0
                };
                let all = (start..start + count).map(mean);
                Some(all.fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], m| [a.min(m), b.max(m)]))
            }
        }));
        let mut bound = 0.0;
        let ends = [0, self.frames - 1].map(|j| (j, true));
        for (j, is_end) in ends.into_iter().chain(self.order.iter().take(COARSE).map(|j| (*j, false))) {
            if bound > most {
                break;
            }
            for (c, means) in means.iter().enumerate() {
                let Some([least, greatest]) = *means else { return 0.0 };
                let k = j * channels + c;
                let [low, high] = if is_end { [self.values[k]; 2] } else { self.envelope[k] };
                let [from, to] = self.extremes[(start + grid.points[j].0) * channels + c];
                // Differences of numbers of these intervals, but for rounding.
                let gap = (low - (to - least)).max((from - greatest) - high);
                let sure =
                    f64::from(gap - 1e-5 * (gap + to.abs() + from.abs() + least.abs() + greatest.abs()));
                bound += sure.max(0.0).powi(2);
            }
        }
        bound
    }

    /// A lower bound of the squared distance of a window, from its ends and `points` more frames. It stops above `most`.
    ///
    /// The ends are matched with the ends of the query, and every other frame with one within the radius.
    pub fn bound(&self, grid: &Grid, start: usize, normal: &[(f32, f32)], points: usize, most: f64) -> f64 {
        let channels = self.curve.channels;
        let mut bound = 0.0;
        for j in [0, self.frames - 1] {
            for c in 0..channels {
                let x = self.value(grid, start, normal, j, c);
                bound += f64::from(x - self.values[j * channels + c]).powi(2);
            }
        }
        for j in self.order.iter().take(points) {
            if bound > most {
                break;
            }
            for c in 0..channels {
                let x = self.value(grid, start, normal, *j, c);
                bound += outside(x, self.envelope[j * channels + c]);
            }
        }
        bound
    }

    /// Writes a window that is normalised.
    fn write(&self, grid: &Grid, start: usize, scratch: &mut Scratch) {
        let Scratch { normal, window, .. } = scratch;
        window.clear();
        for j in 0..self.frames {
            window.extend((0..self.curve.channels).map(|c| self.value(grid, start, normal, j, c)));
        }
    }

    /// A better lower bound of the squared distance of a window, if it does not exceed `most`.
    pub fn full_bound(&self, grid: &Grid, start: usize, scratch: &mut Scratch, most: f64) -> Option<f64> {
        let own = self.bound(grid, start, &scratch.normal, usize::MAX, most);
        if own > most {
            return None;
        }
        self.write(grid, start, scratch);
        let other = envelope(&scratch.window, self.curve.channels, self.radius);
        let other: f64 = other.iter().zip(&self.values).map(|(e, x)| outside(*x, *e)).sum();
        (other <= most).then_some(own.max(other))
    }

    /// The squared distance of a window, if it does not exceed `most`.
    pub fn distance(&self, grid: &Grid, start: usize, scratch: &mut Scratch, most: f64) -> Option<f64> {
        self.write(grid, start, scratch);
        squared_distance(&self.values, &scratch.window, self.curve.channels, self.radius, most)
    }

    /// The match of a window with a squared distance.
    pub fn found(&self, grid: &Grid, start: usize, squared: f64) -> MotionMatch {
        let similarity = (-squared.sqrt() / (self.frames as f64).sqrt() / self.deviation).exp();
        let at = |k: usize| k as f64 / self.curve.rate;
        MotionMatch { from: at(start), to: at(start + grid.len), similarity }
    }
}
