//! The best path through the fragments that match.

use super::fragments::Candidate;
use crate::choices;
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::plot::{Chart, Line, grid};
use crate::soundtrack::motion::MotionCurve;
use crate::statistics::quantile;
use serde::{Deserialize, Serialize};

choices! {
    /// Quantity that a path optimises.
    pub enum PathObjective {
        /// The sum of distances and of the costs of breaks.
        Weighted,
        /// First the number of consecutive fragments, then the sum of distances.
        Lexicographic,
    }
}

/// Rules of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRules {
    /// Cost of a fragment that does not follow the one before it in the source, in medians of the distances.
    pub break_cost: f64,
    /// Quantity that the path optimises.
    pub objective: PathObjective,
}

impl Default for PathRules {
    fn default() -> Self {
        Self { break_cost: 0.5, objective: PathObjective::Weighted }
    }
}

/// The fragments of two motions, and a path through those of the source for each of the target.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FragmentPath {
    /// Frames per second of the source and of the target.
    pub rates: (f64, f64),
    /// The motion of the source, smoothed.
    pub source: Vec<f64>,
    /// The motion of the target, smoothed.
    pub target: Vec<f64>,
    /// Frames at which the source is cut, with its ends.
    pub source_cuts: Vec<usize>,
    /// Frames at which the target is cut, with its ends.
    pub target_cuts: Vec<usize>,
    /// For each fragment of the target, those of the source that were considered.
    pub candidates: Vec<Vec<Candidate>>,
    /// For each fragment of the target, that of the source.
    pub path: Vec<usize>,
    /// The sum of the distances on the path over their scale, and of the costs of breaks.
    pub cost: f64,
    /// Fragments that follow the one before them in the source.
    pub consecutive: usize,
}

/// The median distance, at least `least`.
fn scale_of(lists: &[Vec<Candidate>], least: f64) -> f64 {
    let mut all: Vec<f64> = lists.iter().flatten().map(|c| c.distance).collect();
    all.sort_by(f64::total_cmp);
    // Without distances the quantile is no number.
    quantile(&all, 0.5).max(least).max(f64::MIN_POSITIVE)
}

/// Returns the path with the least sum of distances, over their median, and of `break_cost` for each fragment that does not follow the one before it. Its cost
/// and the number of consecutive fragments come with it. `least` is the least median.
///
/// # Complexity
/// Candidates.
///
/// # Source
/// Pullen and Bregler, "Motion capture assisted animation" (SIGGRAPH 2002). The cost is a choice.
#[must_use]
pub fn best_path(lists: &[Vec<Candidate>], least: f64, rules: &PathRules) -> (Vec<usize>, f64, usize) {
    let scale = scale_of(lists, least);
    let total: f64 = lists.iter().flatten().map(|c| c.distance / scale).sum();
    let cost_of_break = match rules.objective {
        PathObjective::Weighted => rules.break_cost,
        // More than any difference of distances.
        PathObjective::Lexicographic => total + 1.0,
    };
    // For each candidate, the least cost and the candidate before it.
    let mut table: Vec<Vec<(f64, usize)>> = Vec::with_capacity(lists.len());
    for (i, list) in lists.iter().enumerate() {
        let row = match i.checked_sub(1).map(|before| (&table[before], &lists[before])) {
            None => list.iter().map(|c| (c.distance / scale, 0)).collect(),
            Some((costs, before)) => {
                let least = (0..costs.len()).min_by(|a, b| costs[*a].0.total_cmp(&costs[*b].0)).unwrap_or(0);
                let of = |c: &Candidate| {
                    let mut best = (costs.get(least).map_or(0.0, |c| c.0) + cost_of_break, least);
                    let previous = before.iter().position(|b| b.fragment + 1 == c.fragment);
                    if let Some(k) = previous.filter(|k| costs[*k].0 <= best.0) {
                        best = (costs[k].0, k);
                    }
                    (best.0 + c.distance / scale, best.1)
                };
                list.iter().map(of).collect()
            }
        };
        table.push(row);
    }
    let Some(last) = table.last().filter(|row| !row.is_empty()) else { return (Vec::new(), 0.0, 0) };
    let mut k = (0..last.len()).min_by(|a, b| last[*a].0.total_cmp(&last[*b].0)).unwrap_or(0);
    let mut path = Vec::with_capacity(lists.len());
    for (list, row) in lists.iter().zip(&table).rev() {
        path.push(list[k].fragment);
        k = row[k].1;
    }
    path.reverse();
    let consecutive = path.windows(2).filter(|pair| pair[0] + 1 == pair[1]).count();
    let breaks = path.len().saturating_sub(1) - consecutive;
    let distances = path.iter().zip(lists).filter_map(|(f, list)| list.iter().find(|c| c.fragment == *f));
    let cost = distances.map(|c| c.distance / scale).sum::<f64>() + rules.break_cost * breaks as f64;
    (path, cost, consecutive)
}

impl FragmentPath {
    /// Start and end of a fragment of the source, s.
    #[must_use]
    pub fn source_interval(&self, fragment: usize) -> (f64, f64) {
        let at = |k: usize| self.source_cuts.get(k).map_or(0.0, |frame| *frame as f64 / self.rates.0);
        (at(fragment), at(fragment + 1))
    }

    /// Start and end of a fragment of the target, s.
    #[must_use]
    pub fn target_interval(&self, fragment: usize) -> (f64, f64) {
        let at = |k: usize| self.target_cuts.get(k).map_or(0.0, |frame| *frame as f64 / self.rates.1);
        (at(fragment), at(fragment + 1))
    }
}

impl FragmentPath {
    /// For each frame of the target, the frame of the source that the path leads to: the fragments of the source stretched to those of the target.
    #[must_use]
    pub fn frames(&self) -> MotionCurve {
        let mut values = Vec::with_capacity(self.target.len());
        for (i, fragment) in self.path.iter().enumerate() {
            let at = |cuts: &[usize], k: usize| cuts.get(k).copied().unwrap_or_default() as f64;
            let (from, to) = (at(&self.target_cuts, i), at(&self.target_cuts, i + 1));
            let (a, b) = (at(&self.source_cuts, *fragment), at(&self.source_cuts, fragment + 1));
            let frame = |k: f64| a + (k - from) / (to - from).max(1.0) * (b - a);
            values.extend((from as usize..to as usize).map(|k| frame(k as f64) as f32));
        }
        MotionCurve { rate: self.rates.1, channels: 1, values, gaps: Vec::new() }
    }
}

impl Data for FragmentPath {
    const NAME: &'static str = "fragment path";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let source: Vec<f64> = (0..60).map(|k| (0.2 * f64::from(k)).sin()).collect();
        let candidates: Vec<Vec<Candidate>> =
            (0..3).map(|k| vec![Candidate { fragment: k, distance: rng.uniform() }]).collect();
        Self {
            rates: (30.0, 30.0),
            target: source.clone(),
            source,
            source_cuts: vec![0, 20, 40, 60],
            target_cuts: vec![0, 20, 40, 60],
            candidates,
            path: vec![0, 1, 2],
            cost: 0.5,
            consecutive: 2,
        }
    }

    fn plot(&self) -> Option<String> {
        if self.path.is_empty() {
            return None;
        }
        let motion = |title: &str, x: &[f64], cuts: &[usize], rate: f64| {
            let point = |k: usize| [k as f64 / rate, x[k.min(x.len() - 1)]];
            let lines = vec![
                Line::new("motion", (0..x.len()).map(point).collect()),
                Line::dots("cuts", cuts.iter().map(|k| point(*k)).collect()),
            ];
            Chart::of(title, ("time, s", false), ("value", false), lines)
        };
        let middle = |(a, b): (f64, f64)| (a + b) / 2.0;
        let point = |i: usize, j: usize| [middle(self.target_interval(i)), middle(self.source_interval(j))];
        let all = self.candidates.iter().enumerate();
        let considered = all.flat_map(|(i, list)| list.iter().map(move |c| point(i, c.fragment))).collect();
        let chosen = self.path.iter().enumerate().map(|(i, j)| point(i, *j)).collect();
        let lines = vec![Line::dots("candidates", considered), Line::new("path", chosen)];
        let charts = [
            motion("source", &self.source, &self.source_cuts, self.rates.0),
            motion("target", &self.target, &self.target_cuts, self.rates.1),
            Chart::of("fragments", ("time in the target, s", false), ("time in the source, s", false), lines),
        ];
        Some(grid(&charts.each_ref().map(Chart::draw), 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lists(seed: u64, m: usize) -> Vec<Vec<Candidate>> {
        let mut rng = Rng::new(seed);
        (0..m)
            .map(|_| {
                let mut all: Vec<usize> = (0..6).collect();
                let one = |k: usize| Candidate { fragment: k, distance: rng.between(0.1, 2.0) };
                all.rotate_left(seed as usize % 5);
                all.truncate(4);
                all.into_iter().map(one).collect()
            })
            .collect()
    }

    #[test]
    fn no_other_path_is_better() {
        for seed in 0..20 {
            for objective in [PathObjective::Weighted, PathObjective::Lexicographic] {
                let lists = lists(seed, 6);
                let rules = PathRules { objective, ..PathRules::default() };
                let scale = scale_of(&lists, 0.0);
                let (path, cost, consecutive) = best_path(&lists, 0.0, &rules);
                let (mut least, mut most) = (f64::INFINITY, (0, f64::INFINITY));
                for code in 0..4_usize.pow(6) {
                    let picks: Vec<&Candidate> =
                        (0..6).map(|i| &lists[i][code / 4_usize.pow(i as u32) % 4]).collect();
                    let follows = picks.windows(2).filter(|p| p[0].fragment + 1 == p[1].fragment).count();
                    let sum: f64 = picks.iter().map(|c| c.distance / scale).sum();
                    least = least.min(sum + 0.5 * (5 - follows) as f64);
                    if follows > most.0 || follows == most.0 && sum < most.1 {
                        most = (follows, sum);
                    }
                }
                match objective {
                    PathObjective::Weighted => assert!((cost - least).abs() < 1e-9, "{seed}: {cost} {least}"),
                    PathObjective::Lexicographic => {
                        let sum = cost - 0.5 * (5 - consecutive) as f64;
                        assert!(consecutive == most.0 && (sum - most.1).abs() < 1e-9, "{seed} {path:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_and_one_fragment_have_paths() {
        assert_eq!(best_path(&[], 1.0, &PathRules::default()), (vec![], 0.0, 0));
        let one = vec![vec![Candidate { fragment: 3, distance: 0.0 }]];
        assert_eq!(best_path(&one, 1.0, &PathRules::default()), (vec![3], 0.0, 0));
    }
}
