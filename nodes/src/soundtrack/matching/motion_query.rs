//! The node `MotionQuery`.

use super::matches::MotionMatches;
use super::overlap::greatest_sum;
use super::pattern::{QueryError, QueryRules};
use super::query_params::QueryParams;
use super::search::{best_matches, find_matches};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::soundtrack::motion::MotionCurve;
use crate::{params, ports};

params! {
    /// Finds all parts of a motion that are similar to one part of it, or of another motion.
    ///
    /// The query is an interval of `source`, or else of `motion`. Parts from half to twice its length are stretched to it and compared by
    /// dynamic time warping. The similarity is 1 for equal motions and falls with the distance relative to the extent of the query. Parts that
    /// overlap a more similar one are left out.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 5.2. The similarity is a choice; the search is exact
    /// without `tolerance`.
    pub struct MotionQueryParams {
        /// The query.
        [group] query: QueryParams;
        /// Compare parts of all lengths, not only of nine.
        exhaustive: bool = false;
        /// Choose the matches with the greatest sum of similarities, instead of the most similar first.
        optimal: bool = false;
        /// Greatest number of matches, the most similar ones; None for all.
        count: Option<usize> = None, unit "", range 1..=1_000_000;
        /// Leave out parts by the distances of their piecewise means, as the paper does: the share of similar parts that may be missed. None: search
        /// exactly, which is about as fast.
        tolerance: Option<f64> = None, unit "", range 0.000001..=0.5;
    }
}
ports! {
    pub struct MotionQueryPorts / MotionQueryIo {
        in {
            /// The motion that is searched.
            motion: Value<MotionCurve>,
            /// The motion that the query is of, if it is another one.
            source: Option<Value<MotionCurve>>,
        }
        out {
            /// The matches.
            matches: Value<MotionMatches>,
        }
    }
}

/// The node over [`best_matches`].
#[derive(Debug)]
pub struct MotionQuery;

impl Func for MotionQuery {
    type Params = MotionQueryParams;
    type Ports = MotionQueryPorts;
    const NAME: &'static str = "MotionQuery";

    fn eval(p: &MotionQueryParams, cx: &Build<'_>, mut io: MotionQueryIo<'_>) -> Result<Summary, Fault> {
        let rules = QueryRules {
            exhaustive: p.exhaustive,
            count: p.count,
            tolerance: p.tolerance,
            ..p.query.rules()
        };
        let source = io.source.unwrap_or(io.motion);
        let interval = p.query.interval();
        let found = match p.optimal {
            true => find_matches(io.motion, source, interval, rules, cx.monitor)
                .map(|all| greatest_sum(all, p.count)),
            false => best_matches(io.motion, source, interval, rules, cx.monitor),
        };
        let matches = found.map_err(|e| match e {
            QueryError::Stopped => Fault::stopped(),
            QueryError::Interval { .. } | QueryError::Flat { .. } => {
                Fault::new("F157", e.to_string()).at("from")
            }
            _ => Fault::new("F157", e.to_string()).at("motion"),
        })?;
        let least = matches.iter().map(|m| m.similarity).fold(1.0, f64::min);
        let mut summary: Summary =
            vec![("matches", matches.len().into()), ("least_similarity", least.into())];
        if matches.is_empty() {
            let text = format!("nothing is as similar as {}: give a lower `threshold`", p.query.threshold);
            summary.push(("warning", text.into()));
        }
        io.matches.set(MotionMatches { query: interval, threshold: p.query.threshold, matches });
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (MotionQueryParams, MemoryFiles) {
        let p = MotionQueryParams::trial(rng);
        let query = p.query.clone().for_trial(rng);
        (MotionQueryParams { query, exhaustive: false, ..p }, MemoryFiles::default())
    }
}
