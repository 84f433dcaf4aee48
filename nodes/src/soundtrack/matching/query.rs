//! A query over a motion.

use super::deepening::Deepening;
use super::dtw::envelope;
use super::matches::MotionMatch;
use super::pattern::{COARSE, Grid, Normalisation, Pattern, QueryError, QueryRules, Scratch, normaliser};
use super::windows::Windows;
use crate::soundtrack::motion::MotionCurve;

/// Windows with neighbouring starts that are bounded at once.
pub const BLOCK: usize = 16;

/// A query, ready for comparisons with all parts of a motion.
pub struct Query<'a> {
    curve: &'a MotionCurve,
    /// The query itself.
    pub pattern: Pattern,
    /// The windows of the motion.
    pub windows: Windows<'a>,
    /// Extremes of the motion from each frame to [`BLOCK`] frames later, by channel.
    extremes: Vec<[f32; 2]>,
    /// Leaves out windows, with a tolerance.
    deepening: Option<Deepening>,
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
        interval: (f64, f64),
        rules: QueryRules,
    ) -> Result<Self, QueryError> {
        curve.validate()?;
        let channels = curve.channels;
        if source.channels != channels {
            return Err(QueryError::Channels { query: source.channels, motion: channels });
        }
        if (source.rate - curve.rate).abs() > 1e-6 {
            return Err(QueryError::Rates { query: source.rate, motion: curve.rate });
        }
        let pattern = Pattern::new(source, interval, rules)?;
        let windows = Windows::new(curve, rules.normalisation);
        let mut query = Self { curve, pattern, windows, extremes: ahead(curve), deepening: None };
        let grids = query.grids();
        let tolerance = rules.tolerance.filter(|_| !grids.is_empty());
        query.deepening =
            tolerance.map(|tolerance| Deepening::learn(&query.pattern, &query.windows, &grids, tolerance));
        Ok(query)
    }

    /// The lengths of windows.
    pub fn grids(&self) -> Vec<Grid> {
        let lengths = self.pattern.lengths(self.curve.frames());
        lengths.into_iter().map(|len| Grid::new(len, self.pattern.frames)).collect()
    }

    /// The squared distance of the window that [`full_bound`](Pattern::full_bound) has written, if it does not exceed `most` and is not left out by
    /// its piecewise means.
    pub fn distance(&self, scratch: &mut Scratch, most: f64) -> Option<f64> {
        let is_left = self.deepening.as_ref().is_none_or(|deepening| deepening.passes(scratch));
        if is_left { self.pattern.written_distance(scratch, most) } else { None }
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
        means.extend((0..channels).map(|c| match self.pattern.rules.normalisation {
            Normalisation::None => Some([0.0; 2]),
            // The factor of each window is another one.
            Normalisation::ZScore => None,
            Normalisation::Offset => {
                let mean = |k: usize| {
                    let [sum, _] = self.windows.sums(grid, k, c);
                    normaliser(Normalisation::Offset, [sum, 0.0], grid.len as f64).0
                };
                let all = (start..start + count).map(mean);
                Some(all.fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], m| [a.min(m), b.max(m)]))
            }
        }));
        let mut bound = 0.0;
        let ends = [0, self.pattern.frames - 1].map(|j| (j, true));
        for (j, is_end) in ends.into_iter().chain(self.pattern.order.iter().take(COARSE).map(|j| (*j, false)))
        {
            if bound > most {
                break;
            }
            for (c, means) in means.iter().enumerate() {
                let Some([least, greatest]) = *means else { return 0.0 };
                let k = j * channels + c;
                let [low, high] = if is_end { [self.pattern.values[k]; 2] } else { self.pattern.envelope[k] };
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

    /// The match of a window with a squared distance.
    pub fn found(&self, grid: &Grid, start: usize, squared: f64) -> MotionMatch {
        let at = |k: usize| k as f64 / self.curve.rate;
        MotionMatch {
            from: at(start),
            to: at(start + grid.len),
            similarity: self.pattern.similarity(squared),
        }
    }
}
