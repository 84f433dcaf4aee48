//! Effect of a correspondence on the selection: units that are chosen differently without it, and changes of fallbacks and folds.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::unit::{Choice, NotFinite, Selector, SelectorParams, Units, selector};
use crate::warp::spline::Tps;
use crate::warp::spline::batch::warped;
use crate::warp::spline::tps::{Orientation, evenly_spaced};

/// Units that move less than this in feature space are as good as unmoved.
const MIN_DISPLACEMENT: f64 = 0.25;
/// Unchanged units within a range that do not split it.
const GAP: usize = 24;
/// Maximum number of units that are chosen again over all correspondences; of more, every second, third and so on.
const MAX_CHOICES: usize = 16_000;
/// Maximum number of units that are tested for folds.
const MAX_SURVEYED: usize = 1024;

/// Changes of the selection without a correspondence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Change of the share of units without a near enough match.
    pub delta_fallback: f64,
    /// Change of the share of the target where the warp folds over.
    pub delta_folds: f64,
    /// Share of the units whose warp moves by more than a quarter of a unit of feature space.
    pub moved: f64,
    /// Units of the target, from and to, for which another unit is chosen.
    pub ranges: Vec<[usize; 2]>,
}

/// A target as it sounds with all correspondences.
pub struct Baseline {
    dims: usize,
    target: Vec<f32>,
    warped: Vec<f32>,
    choices: Vec<Choice>,
    picks: Vec<u32>,
    folds: f64,
    /// Number of units that are examined for folds.
    surveyed: Vec<usize>,
    params: SelectorParams,
    selector: Box<dyn Selector>,
}

/// Ranges of units, each of `step` from those in the list; gaps up to [`GAP`] are closed.
fn ranges(changed: &[usize], step: usize, units: usize) -> Vec<[usize; 2]> {
    let mut ranges: Vec<[usize; 2]> = Vec::new();
    for unit in changed {
        let end = (unit + step).min(units);
        match ranges.last_mut() {
            Some(last) if *unit <= last[1] + GAP => last[1] = end,
            _ => ranges.push([*unit, end]),
        }
    }
    ranges
}

impl Baseline {
    /// Chooses units for the whole target, warped by `all`; `None` if there are no units.
    ///
    /// # Shapes
    /// `target: [units, d]`.
    ///
    /// # Errors
    /// Names a unit of the target whose features are not finite.
    pub fn new(
        target: Vec<f32>,
        all: &Tps,
        units: &Units<'_>,
        params: SelectorParams,
    ) -> Result<Option<Self>, NotFinite> {
        let Some(selector) = selector(units, params.clone()) else { return Ok(None) };
        let (dims, warped) = (units.dims, warped(&target, &[all]).concat());
        let surveyed: Vec<usize> = evenly_spaced(target.len() / dims.max(1), MAX_SURVEYED).collect();
        let folds = Orientation::new(&target, all, &surveyed).folds();
        let (choices, picks) = (Vec::new(), Vec::new());
        let mut this = Self { dims, target, warped, choices, picks, folds, surveyed, params, selector };
        let all = 0..this.len();
        this.choices = this.run(&this.warped, all, &[])?;
        this.picks = this.choices.iter().map(|choice| choice.unit).collect();
        Ok(Some(this))
    }

    /// Units of the target.
    #[must_use]
    pub fn len(&self) -> usize {
        self.warped.len() / self.dims.max(1)
    }

    /// Returns true if the target has no unit.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Picks with all correspondences.
    #[must_use]
    pub fn picks(&self) -> &[u32] {
        &self.picks
    }

    /// Share of units without a near enough match.
    #[must_use]
    pub fn fallback_share(&self) -> f64 {
        self.choices.iter().filter(|c| c.fallback).count() as f64 / self.len().max(1) as f64
    }

    /// Share of the target where the warp folds over.
    #[must_use]
    pub fn fold_share(&self) -> f64 {
        self.folds
    }

    /// The first unit that the choice for a unit compares.
    fn window_start(&self, unit: usize) -> usize {
        if self.params.causal { unit.saturating_sub(self.params.look) } else { unit }
    }

    /// The vectors that the choice for a unit compares.
    fn window<'a>(&self, warped: &'a [f32], unit: usize) -> &'a [f32] {
        let last = self.len().saturating_sub(1);
        let to = if self.params.causal { unit } else { (unit + self.params.look).min(last) };
        let from = self.window_start(unit);
        warped.get(from * self.dims..(to + 1) * self.dims).unwrap_or_default()
    }

    /// Chooses for units one after the other, after `before`.
    fn run(
        &self,
        warped: &[f32],
        units: std::ops::Range<usize>,
        before: &[u32],
    ) -> Result<Vec<Choice>, NotFinite> {
        let mut selector = self.selector.boxed_clone();
        selector.set_history(before);
        let choose = |unit: usize| {
            selector.choose(self.window(warped, unit)).map_err(|k| k.after(self.window_start(unit)))
        };
        units.map(choose).collect()
    }

    /// The picks that are still in their cool-off when unit `unit` is chosen.
    fn in_cool_off(&self, unit: usize) -> &[u32] {
        let from = unit.saturating_sub(self.params.cool_off.max(self.params.loop_guard + 4));
        self.picks.get(from..unit.min(self.picks.len())).unwrap_or_default()
    }

    /// Changes of the selection with each of other warps.
    ///
    /// Every unit that a warp moves is chosen again after the original choices of all units before it: the effect of one change on all later
    /// units through their cool-off is not counted. Of very many units, an even share is chosen again.
    ///
    /// # Errors
    /// Names a unit whose warped features are not finite.
    ///
    /// # Complexity
    /// O(units) kernels per node and warp, and at most 16,000 choices; on all cores.
    pub fn effects(&self, rest: &[Tps]) -> Result<Vec<Effect>, NotFinite> {
        let warped = warped(&self.target, &rest.iter().collect::<Vec<_>>());
        let moved: Vec<Vec<usize>> = warped.par_iter().map(|warped| self.moved(warped)).collect();
        let total: usize = moved.iter().map(Vec::len).sum();
        let step = total.div_ceil(MAX_CHOICES).max(1);
        let effect = |((warped, moved), tps): ((&Vec<f32>, &Vec<usize>), &Tps)| {
            let some: Vec<usize> = moved.iter().copied().filter(|unit| unit % step == 0).collect();
            let (changed, fallbacks) = self.choose_again(warped, &some)?;
            let per = moved.len() as f64 / some.len().max(1) as f64 / self.len().max(1) as f64;
            Ok(Effect {
                delta_fallback: fallbacks as f64 * per,
                delta_folds: Orientation::new(&self.target, tps, &self.surveyed).folds() - self.folds,
                moved: moved.len() as f64 / self.len().max(1) as f64,
                ranges: ranges(&changed, step, self.len()),
            })
        };
        warped.par_iter().zip(&moved).zip(rest).map(effect).collect()
    }

    /// Units that another warp moves.
    fn moved(&self, warped: &[f32]) -> Vec<usize> {
        let vectors = warped.chunks_exact(self.dims).zip(self.warped.chunks_exact(self.dims));
        let square = |(a, b): (&[f32], &[f32])| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum()
        };
        let far = vectors
            .map(square)
            .enumerate()
            .filter(|(_, square)| *square > MIN_DISPLACEMENT * MIN_DISPLACEMENT);
        far.map(|(unit, _)| unit).collect()
    }

    /// The units that are chosen differently, and the increase of fallbacks.
    fn choose_again(&self, warped: &[f32], some: &[usize]) -> Result<(Vec<usize>, i64), NotFinite> {
        let mut selector = self.selector.boxed_clone();
        let (mut changed, mut fallbacks) = (Vec::new(), 0);
        for &unit in some {
            selector.set_history(self.in_cool_off(unit));
            let window = self.window(warped, unit);
            let choice = selector.choose(window).map_err(|k| k.after(self.window_start(unit)))?;
            let Some(before) = self.choices.get(unit) else { continue };
            fallbacks += i64::from(choice.fallback) - i64::from(before.fallback);
            if choice.unit != before.unit {
                changed.push(unit);
            }
        }
        Ok((changed, fallbacks))
    }

    /// The picks of a stretch with another warp, chosen one after the other.
    ///
    /// # Errors
    /// Names a unit whose warped features are not finite.
    pub fn picks_with(&self, rest: &Tps, interval: std::ops::Range<usize>) -> Result<Vec<u32>, NotFinite> {
        let warped = warped(&self.target, &[rest]).concat();
        let before = self.in_cool_off(interval.start);
        let chosen = self.run(&warped, interval.start..interval.end.min(self.len()), before)?;
        Ok(chosen.into_iter().map(|choice| choice.unit).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::warp::diagnostics::LeaveOut;
    use crate::warp::{Pair, Stiffness, fit};

    /// A target that stays 40 units at each of five places, and a database that has the like 3 units to the right of each.
    struct World {
        target: Vec<f32>,
        database: Vec<f32>,
        pairs: Vec<(usize, Pair)>,
    }

    const PLACES: [[f64; 2]; 5] = [[-15.0, 0.0], [-5.0, 6.0], [0.0, -6.0], [6.0, 5.0], [12.0, -2.0]];

    fn world(bad: Option<usize>) -> World {
        let mut rng = Rng::new(5);
        let mut near = |place: [f64; 2], shift: f64| {
            [place[0] + shift + rng.between(-0.3, 0.3), place[1] + rng.between(-0.3, 0.3)]
        };
        let (mut target, mut database, mut pairs) = (Vec::new(), Vec::new(), Vec::new());
        for (k, place) in PLACES.into_iter().enumerate() {
            for unit in 0..40 {
                let (from, to) = (near(place, 0.0), near(place, 3.0));
                target.extend(from.map(|x| x as f32));
                database.extend(to.map(|x| x as f32));
                if unit < 10 {
                    let wrong = if bad == Some(k) { [-9.0, 8.0] } else { [0.0, 0.0] };
                    let to = [to[0] + wrong[0], to[1] + wrong[1]];
                    pairs.push((k, Pair { from: from.into(), to: to.into(), weight: 1.0 }));
                }
            }
        }
        World { target, database, pairs }
    }

    fn effects(world: &World, d_max: f64) -> (Baseline, Vec<Effect>) {
        let plain: Vec<Pair> = world.pairs.iter().map(|(_, pair)| pair.clone()).collect();
        let (all, _) = fit(&plain, 2, Stiffness::Lambda(300.0)).unwrap();
        let out = LeaveOut::new(&world.pairs, 2, 300.0).unwrap();
        let rest: Vec<Tps> = (0..5).map(|k| out.without(k).unwrap()).collect();
        let n = world.database.len() / 2;
        let units = Units::new(&world.database, 2, vec![(0, n)]);
        let params =
            SelectorParams { look: 2, d_max, cool_off: 5, loop_guard: 0, causal: false, effort: None };
        let baseline = Baseline::new(world.target.clone(), &all, &units, params).unwrap().unwrap();
        let effects = baseline.effects(&rest).unwrap();
        (baseline, effects)
    }

    #[test]
    fn dropping_a_bad_pair_mends_the_fallbacks_where_it_led_astray() {
        let (baseline, found) = effects(&world(Some(2)), 2.0);
        assert!(baseline.fallback_share() > 0.15, "{}", baseline.fallback_share());
        assert!(found[2].delta_fallback < -0.15, "{found:?}");
        let better = found.iter().enumerate().all(|(k, e)| k == 2 || e.delta_fallback > -0.05);
        assert!(better, "no other one mends it: {found:?}");
        // Its own stretch, units 80 to 120, is chosen for differently.
        assert!(found[2].ranges.iter().any(|[from, to]| *from <= 82 && *to >= 118), "{found:?}");
        let (good, found) = effects(&world(None), 2.0);
        assert_eq!(good.fallback_share(), 0.0);
        // Without a good one, units that only it determined may change, but nothing improves.
        assert!(found.iter().all(|e| e.delta_fallback >= 0.0), "{found:?}");
    }

    #[test]
    fn units_that_do_not_move_are_chosen_as_before() {
        let (baseline, _) = effects(&world(Some(1)), 2.0);
        let plain: Vec<Pair> = world(Some(1)).pairs.into_iter().map(|(_, pair)| pair).collect();
        let (all, _) = fit(&plain, 2, Stiffness::Lambda(300.0)).unwrap();
        let same = baseline.effects(std::slice::from_ref(&all)).unwrap().remove(0);
        assert_eq!(same, Effect::default());
        assert_eq!(baseline.picks_with(&all, 30..90).unwrap(), baseline.picks()[30..90]);
        // A warp that mirrors everything folds nothing; one that flattens everything folds it all.
        let mut other = Tps::identity(2);
        other.affine[2] = -2.0;
        assert_eq!(baseline.effects(&[other.clone()]).unwrap()[0].delta_folds, -baseline.fold_share());
        other.affine[2] = -1.0;
        assert_eq!(baseline.effects(&[other]).unwrap()[0].delta_folds, 1.0 - baseline.fold_share());
    }

    #[test]
    fn ranges_close_short_gaps_alone() {
        assert_eq!(ranges(&[3, 4, 20, 60, 61], 1, 100), [[3, 21], [60, 62]]);
        assert_eq!(ranges(&[0, 96], 8, 100), [[0, 8], [96, 100]]);
        assert_eq!(ranges(&[], 1, 10), Vec::<[usize; 2]>::new());
    }
}
