//! Hard constraints that cannot hold together.

use super::directive::{Directive, NEVER};
use super::model::SoundScore;
use super::node_set::NodeSet;
use super::source_set::SourceSet;
use crate::artefact::text::{Location, TextError};
use crate::soundtrack::wavelet::WaveletTree;
use std::collections::HashSet;

/// A hard constraint: its times, in s, its set, and its location in the score.
#[derive(Clone, Copy)]
struct Hard {
    from: f64,
    to: f64,
    set: usize,
    location: Location,
}

/// All constraints of weight 1 or -1, in order of time.
fn hard(all: &[Directive], weight: f64) -> Vec<Hard> {
    let of = |one: &Directive| {
        let (set, location) = (one.set, one.location);
        one.curve.plateaus(weight).into_iter().map(move |(from, to)| Hard { from, to, set, location })
    };
    let mut all: Vec<Hard> = all.iter().flat_map(of).collect();
    all.sort_by(|a, b| a.from.total_cmp(&b.from));
    all
}

/// A score with its sets of sounds.
pub struct Conflicts<'a> {
    /// The score, for names.
    pub score: &'a SoundScore,
    /// The sets.
    pub sets: &'a [SourceSet],
    /// The tree of the recordings.
    pub tree: &'a WaveletTree,
    /// True if several sounds may have the weight 1 at a time.
    pub morphs: bool,
}

impl Conflicts<'_> {
    fn names(&self, set: usize) -> String {
        self.sets.get(set).map(|s| self.score.names(&s.sources)).unwrap_or_default()
    }

    /// Checks that no two sounds are hard inclusions at one time, unless they morph, and that hard inclusions and exclusions leave candidates at each time.
    ///
    /// # Errors
    /// The first conflict, at the later of its targets.
    pub fn check(&self, all: &[Directive]) -> Result<(), TextError> {
        let (inclusions, exclusions) = (hard(all, 1.0), hard(all, -1.0));
        if !self.morphs {
            self.check_inclusions(&inclusions)?;
        }
        let mut times: Vec<f64> = inclusions.iter().chain(&exclusions).flat_map(|c| [c.from, c.to]).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        // Each combination that occurs is looked at once.
        let mut found = HashSet::new();
        let (mut next, mut active): ([usize; 2], [Vec<Hard>; 2]) = ([0; 2], [Vec::new(), Vec::new()]);
        for pair in times.windows(2) {
            for (k, all) in [&inclusions, &exclusions].into_iter().enumerate() {
                while let Some(one) = all.get(next[k]).filter(|one| one.from <= pair[0]) {
                    active[k].push(*one);
                    next[k] += 1;
                }
                active[k].retain(|one| one.to > pair[0]);
            }
            let [included, excluded] = &active;
            let mut out: Vec<usize> = excluded.iter().map(|c| c.set).collect();
            out.sort_unstable();
            out.dedup();
            let wanted = included.iter().map(Some).chain(included.is_empty().then_some(None));
            for one in wanted {
                let set = one.map(|c| c.set);
                if out.is_empty() || !found.insert((set, out.clone())) {
                    continue;
                }
                if let Some(what) = self.impossible(set, &out) {
                    let location = one.or(excluded.last()).map(|c| c.location).unwrap_or_default();
                    let until = if pair[1] < NEVER { format!("to {} s", pair[1]) } else { "on".to_owned() };
                    let message = format!("impossible from {} s {until}: {what}", pair[0]);
                    return Err(TextError::new(location, message));
                }
            }
        }
        Ok(())
    }

    fn check_inclusions(&self, inclusions: &[Hard]) -> Result<(), TextError> {
        let mut last: Option<Hard> = None;
        for one in inclusions {
            if let Some(last) = last.filter(|last| one.from < last.to && one.set != last.set) {
                let message = format!(
                    "{} has the weight 1 from {} s to {} s, where {} has it too ({}); one output cannot be both: give one of them a weight \
                     below 1",
                    self.names(one.set),
                    one.from,
                    one.to.min(last.to),
                    self.names(last.set),
                    last.location
                );
                return Err(TextError::new(one.location, message));
            }
            last = Some(last.filter(|last| last.to > one.to).unwrap_or(*one));
        }
        Ok(())
    }

    /// Returns the reason why hard constraints leave no node whose children could be chosen; `None` if they leave one.
    fn impossible(&self, included: Option<usize>, excluded: &[usize]) -> Option<String> {
        let level = (self.tree.depth as usize).saturating_sub(2);
        let everything = NodeSet::new(vec![(0, self.tree.nodes(level) as u32)]);
        let wanted =
            included.and_then(|set| self.sets.get(set)).map_or(&everything, |set| &set.included[level]);
        let out = excluded.iter().filter_map(|set| self.sets.get(*set)).map(|set| &set.excluded[level]);
        let left = wanted.without(&NodeSet::union(out));
        if left.iter().any(|node| !self.tree.is_masked(level, node)) {
            return None;
        }
        let names: Vec<String> = excluded.iter().map(|set| self.names(*set)).collect();
        let names = names.join(" and ");
        Some(match included {
            Some(set) => format!("{} has the weight 1, and is excluded by {names}", self.names(set)),
            None => format!("{names} are excluded, and nothing else is left"),
        })
    }
}
