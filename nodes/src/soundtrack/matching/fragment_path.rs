//! The node `FragmentPath`.

use super::fragments::{Candidate, FragmentRules, candidates, deviation};
use super::path::{FragmentPath, PathObjective, PathRules, best_path};
use super::segmentation::{SegmentRules, SegmentVariant, cuts, smoothed};
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
    /// Finds for each part of a new animation the part of an earlier one that is most like it.
    ///
    /// Both motions are smoothed and cut where they turn. Each fragment of the target is compared with all fragments of the source, stretched
    /// to its length. A path through the closest ones prefers fragments that follow each other in the source.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 5.3, after Pullen and Bregler, "Motion capture assisted
    /// animation" (SIGGRAPH 2002).
    pub struct FragmentPathParams {
        /// Points at which motions are cut.
        variant: SegmentVariant = SegmentVariant::FirstDerivative;
        /// The channel of the motions.
        channel: usize = 0, unit "", range 0..=1024;
        /// Cutoff of the low-pass filter; at most 0.4 of the rate is used.
        cutoff: f64 = 4.0, unit "Hz", range 0.001..=1.0e6_f64;
        /// Derivatives below this share of the greatest count as 0.
        dead_band: f64 = 0.001, unit "", range 0.0..=1.0;
        /// Shortest fragment.
        shortest: f64 = 0.1, unit "s", range 0.0..=60.0;
        /// Number of the closest fragments that are considered.
        closest: usize = 5, unit "", range 1..=1000;
        /// Also consider the fragments that follow those of the fragment before.
        extend: bool = true;
        /// Compare motions relative to the mean of each fragment.
        relative: bool = false;
        /// Weight of the squared difference of the derivatives.
        derivative: f64 = 0.0, unit "", range 0.0..=1.0e6_f64;
        /// Weight of the difference of lengths.
        length: f64 = 0.1, unit "", range 0.0..=100.0;
        /// Cost of a fragment that does not follow the one before it in the source, in medians of the distances.
        break_cost: f64 = 0.5, unit "", range 0.0..=1000.0;
        /// Quantity that the path optimises.
        objective: PathObjective = PathObjective::Weighted;
    }
}
ports! {
    pub struct FragmentPathPorts / FragmentPathIo {
        in {
            /// The motion of the animation that has a soundtrack.
            source: Value<MotionCurve>,
            /// The motion of the new animation.
            target: Value<MotionCurve>,
        }
        out {
            /// The fragments and the path.
            path: Value<FragmentPath>,
        }
    }
}

/// The node over [`candidates`] and [`best_path`].
#[derive(Debug)]
pub struct FragmentPathNode;

/// Adds the successors of the candidates of each fragment to those of the next.
fn extended(
    mut lists: Vec<Vec<Candidate>>,
    fragments: usize,
    distance: impl Fn(usize, usize) -> f64,
) -> Vec<Vec<Candidate>> {
    let most = 2 * lists.first().map_or(0, Vec::len) + 64;
    for i in 1..lists.len() {
        let followers: Vec<usize> =
            lists[i - 1].iter().map(|c| c.fragment + 1).filter(|j| *j < fragments).collect();
        for j in followers {
            if !lists[i].iter().any(|c| c.fragment == j) {
                let distance = distance(i, j);
                lists[i].push(Candidate { fragment: j, distance });
            }
        }
        // Those that were added have successors too, but not without end.
        lists[i].truncate(most);
    }
    lists
}

impl FragmentPathParams {
    fn path(&self, source: &MotionCurve, target: &MotionCurve) -> FragmentPath {
        let segments = SegmentRules {
            variant: self.variant,
            cutoff: self.cutoff,
            dead_band: self.dead_band,
            shortest: self.shortest,
        };
        let smooth = |curve: &MotionCurve| smoothed(&curve.channel(self.channel), curve.rate, self.cutoff);
        let (a, b) = (smooth(source), smooth(target));
        let (source_cuts, target_cuts) = (cuts(&a, source.rate, &segments), cuts(&b, target.rate, &segments));
        let rules = FragmentRules {
            count: self.closest,
            derivative: self.derivative,
            length: self.length,
            is_relative: self.relative,
        };
        let mut lists = candidates((&a, &source_cuts), (&b, &target_cuts), &rules);
        if self.extend {
            let all = FragmentRules { count: usize::MAX, ..rules };
            lists = extended(lists, source_cuts.len() - 1, |i, j| {
                let one = candidates((&a, &source_cuts[j..j + 2]), (&b, &target_cuts[i..i + 2]), &all);
                one.first().and_then(|list| list.first()).map_or(f64::MAX, |c| c.distance)
            });
        }
        let path_rules = PathRules { break_cost: self.break_cost, objective: self.objective };
        let (path, cost, consecutive) = best_path(&lists, 1e-6 * deviation(&b), &path_rules);
        FragmentPath {
            rates: (source.rate, target.rate),
            source: a,
            target: b,
            source_cuts,
            target_cuts,
            candidates: lists,
            path,
            cost,
            consecutive,
        }
    }
}

impl Func for FragmentPathNode {
    type Params = FragmentPathParams;
    type Ports = FragmentPathPorts;
    const NAME: &'static str = "FragmentPath";

    fn eval(p: &FragmentPathParams, _: &Build<'_>, mut io: FragmentPathIo<'_>) -> Result<Summary, Fault> {
        for (port, curve) in [("source", io.source), ("target", io.target)] {
            curve.validate().map_err(|e| Fault::new("F157", e.to_string()).at(port))?;
            if p.channel >= curve.channels {
                let message = format!(
                    "`channel` is {}, and the motion has {} channels, counted from 0",
                    p.channel, curve.channels
                );
                return Err(Fault::new("F157", message).at(port));
            }
        }
        let path = p.path(io.source, io.target);
        let mut summary: Summary = vec![
            ("source_fragments", (path.source_cuts.len() - 1).into()),
            ("target_fragments", path.path.len().into()),
            ("consecutive", path.consecutive.into()),
            ("cost", path.cost.into()),
        ];
        if path.path.len() < 2 {
            let text = "the new motion is one fragment: it does not turn, or is too short";
            summary.push(("warning", text.into()));
        }
        io.path.set(path);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (FragmentPathParams, MemoryFiles) {
        let p = FragmentPathParams::trial(rng);
        (
            FragmentPathParams { channel: 0, cutoff: rng.between(1.0, 8.0), shortest: 0.1, closest: 5, ..p },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;

    fn params() -> FragmentPathParams {
        FragmentPathParams::read(&|_| None).unwrap()
    }

    #[test]
    fn a_motion_against_itself_is_the_identity() {
        let motion = MotionCurve::trial(&mut Rng::new(5));
        for variant in [SegmentVariant::FirstDerivative, SegmentVariant::SecondDerivative] {
            let path = FragmentPathParams { variant, ..params() }.path(&motion, &motion);
            let m = path.path.len();
            assert!(m > 4 && path.path == (0..m).collect::<Vec<_>>(), "{:?}", path.path);
            assert!(path.consecutive == m - 1 && path.cost < 1e-9, "{}", path.cost);
            assert!(path.frames().values.iter().enumerate().all(|(k, x)| *x == k as f32));
        }
        // With an offset too, if it is relative.
        let mut higher = motion.clone();
        higher.values.iter_mut().for_each(|x| *x += 10.0);
        let path = FragmentPathParams { relative: true, ..params() }.path(&motion, &higher);
        assert_eq!(path.path, (0..path.path.len()).collect::<Vec<_>>());
    }

    #[test]
    fn a_motion_that_was_cut_and_rearranged_is_put_together_again() {
        let motion = MotionCurve::trial(&mut Rng::new(8));
        let path = params().path(&motion, &motion);
        let cuts = &path.source_cuts;
        // The second half of the fragments, and then the first.
        let middle = cuts[cuts.len() / 2];
        let mut values = motion.values[middle..].to_vec();
        values.extend(&motion.values[..middle]);
        let target = MotionCurve { values, ..motion.clone() };
        let found = params().path(&motion, &target);
        let wrong = (0..found.path.len()).filter(|i| {
            let ((a, b), (c, _)) = (found.target_interval(*i), found.source_interval(found.path[*i]));
            let expected = (a + b) / 2.0 + middle as f64 / motion.rate;
            let own = (c + (b - a) / 2.0 - expected).rem_euclid(motion.seconds());
            own.min(motion.seconds() - own) > 0.2
        });
        assert!(wrong.count() <= 2, "{:?}", found.path);
        assert!(found.consecutive + 4 >= found.path.len());
    }
}
