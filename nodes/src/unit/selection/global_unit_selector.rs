//! Global unit selection, as a node.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::candidates::{comparable, few_units_warning, no_unit, not_finite, units};
use super::channel_gate::{self, ChannelGates};
use super::counts::Counts;
use super::global::{
    BeamParams, FixedLag, GlobalParams, Joins, Path, PathCostParams, Table, beam, difference, exact,
};
use super::greedy;
use super::picks::{Pick, PickFormat, Picks};
use super::selector::{NotFinite, SelectorParams, Units};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{In, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::feature::Features;
use crate::unit::UnitDatabase;
use crate::{archive_state, choices, params, ports};

choices! {
    /// Search for the path through the units.
    pub enum Method {
        /// The best path of all, where every jump costs the same.
        Exact,
        /// The best path among candidates, where a join also costs for its audible differences.
        Beam,
        /// The choices of `OnlineUnitSelector`; the summary states how often they differ from the best path.
        FixedLag,
    }
}

params! {
    /// Chooses the sequence of units of a database that is most similar to a target in sound and continuity.
    ///
    /// A path costs the distance of each unit from the target, and `switch_cost` for each unit that does not follow the one
    /// before it in its recording. `UnitSelector` looks a few units ahead; this node finds the cheapest path for the entire target.
    /// It reads all features first, so the target has to end, and it does not run live. Units beyond `d_max` are marked as
    /// fallbacks. `cool_off` and `loop_guard` are not part of the search: units that recur too early get a surcharge and are
    /// searched again in at most 20 rounds, then replaced. The summary states the cost of the path, and the cost without the two. Every channel
    /// chooses independently. With the sound of the target at `target`, silence is skipped as in `UnitSelector`.
    ///
    /// # Source
    /// Viterbi (1967); Grice, Hughey and Speck, "Reduced space sequence alignment" (1997) for the memory; Hunt and Black, "Unit
    /// selection in a concatenative speech synthesis system using a large speech database" (1996) for `Beam`. In place of
    /// algorithm 1 of An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012).
    pub struct GlobalUnitSelectorParams {
        /// Search for the path.
        method: Method = Method::Exact;
        /// Cost of a path.
        [group] cost: PathCostParams;
        /// Number of nearest units that are tried for each target (`Beam`).
        candidates: usize = 64, unit "units", range 1..=1024_usize;
        /// Cost of a feature distance of 1 at a join, between the unit that would follow and the one that follows (`Beam`).
        feature_cost: f64 = 0.3, unit "", range 0.0..=1000.0;
        /// Cost of a step of level by a factor of e at a join (`Beam`).
        level_cost: f64 = 0.2, unit "", range 0.0..=1000.0;
        /// Cost of a join without a zero crossing near it (`Beam`).
        crossing_cost: f64 = 0.2, unit "", range 0.0..=1000.0;
        /// Time from a unit to its choice (`FixedLag`).
        lag: f64 = 0.05, unit "s", range 0.0..=10.0;
        /// Continue to choose while the target is silent; None: only for joint (binaural) units, as in `UnitConcatenator`.
        keep_room_tone: Option<bool> = None;
    }
}

ports! {
    pub struct GlobalUnitSelectorPorts / GlobalUnitSelectorIo {
        in {
            /// Features of the target, computed as those of the database.
            features: Stream<Features>,
            /// Units to choose from.
            database: Value<UnitDatabase>,
            /// Sound of the target: nothing is chosen while the output is faded out because the target is silent.
            target: Option<Stream<f32>>,
        }
        out {
            /// The chosen units.
            picks: Stream<Picks>,
        }
    }
}

/// Number of units after the current one that the initial choice of [`Method::Beam`] compares.
const GREEDY_LOOK: usize = 5;

/// The node over [`exact()`], [`beam()`] and [`FixedLag`].
pub struct GlobalUnitSelector {
    params: GlobalUnitSelectorParams,
    path: GlobalParams,
    db: Arc<UnitDatabase>,
    table: Table,
    vectors: usize,
    /// Units that `FixedLag` looks ahead.
    lag: usize,
    /// Gates that close where the target is silent.
    gates: Option<ChannelGates>,
    length: i64,
    /// The first unit of the target that was received, once there is one.
    first: Option<i64>,
    /// The choices for the whole take, channel after channel for each unit.
    picks: Vec<Pick>,
    counts: Vec<Counts>,
    totals: Totals,
    /// Warning about a database with hardly more units than `cool_off` excludes.
    few_units: Option<String>,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Totals {
    cost: f64,
    free_cost: f64,
    repeats: usize,
    rounds: usize,
    replaced: usize,
    differs: f64,
}

/// Levels and zero crossings of the units, for the cost of joins.
fn joins(db: &UnitDatabase, table: &Table) -> Joins {
    let (unit, near) = (db.unit(), db.unit() / 2);
    let crosses = |from: usize, to: usize| {
        (0..db.channels()).all(|channel| {
            let x = db.channel(channel).get(from..to).unwrap_or_default();
            x.windows(2).any(|pair| (pair[0] < 0.0) != (pair[1] < 0.0))
        })
    };
    let mut joins = Joins::default();
    for j in (0..table.count()).map(|column| table.unit(column) as usize) {
        let segment = db.segment_of(j).and_then(|k| db.segments.get(k)).map_or(0..0, |s| s.range());
        let (start, end) = (j * unit, (j + 1) * unit);
        let samples = (0..db.channels()).flat_map(|c| db.channel(c).get(start..end).unwrap_or_default());
        let energy: f64 = samples.map(|&x| f64::from(x).powi(2)).sum();
        let level = (energy / (unit * db.channels()) as f64).max(1e-10).ln() / 2.0;
        joins.levels.push(level as f32);
        joins.leaves.push(crosses(end.saturating_sub(1), (end + near).min(segment.end * unit)));
        joins.enters.push(crosses(start.saturating_sub(near).max(segment.start * unit), start + 1));
    }
    joins
}

impl GlobalUnitSelector {
    /// Reads all features and chooses for every unit whose gate is open.
    fn solve(&mut self, features: &In<'_, Features>, target: Option<&In<'_, f32>>) -> Result<(), Fault> {
        let first = features.first();
        let items = usize::try_from(self.length - first).unwrap_or(0);
        let (width, dims) = (features.width(), self.table.dims());
        let take = features.around().get(features.behind() * width..).unwrap_or_default();
        self.picks = vec![Pick::default(); items * self.vectors];
        for vector in 0..self.vectors {
            let mut gates = self.gates.as_mut().zip(target);
            let mut is_closed =
                |at| gates.as_mut().is_some_and(|(s, target)| s.is_closed(target, vector, at));
            let awake: Vec<usize> = (0..items).filter(|k| !is_closed(first + *k as i64)).collect();
            let own = awake.iter().filter_map(|k| take.get(k * width + vector * dims..)?.get(..dims));
            let target: Vec<f32> = own.flatten().copied().collect();
            let path = self.path(&target).map_err(|NotFinite(k)| {
                not_finite(features, first + awake.get(k as usize).map_or(0, |k| *k as i64))
            })?;
            self.totals.cost += path.cost;
            self.totals.free_cost += path.free_cost;
            self.totals.repeats += path.repeats;
            self.totals.rounds += path.rounds;
            self.totals.replaced += path.replaced;
            self.write(vector, &awake, &target, &path.units);
        }
        self.first = Some(first);
        Ok(())
    }

    /// Writes the picks of one channel; `awake` are the indices of the units that are chosen for, `target` their features.
    fn write(&mut self, vector: usize, awake: &[usize], target: &[f32], units: &[u32]) {
        let Some(counts) = self.counts.get_mut(vector) else { return };
        let mut chosen = awake.iter().zip(target.chunks_exact(self.table.dims())).zip(units).peekable();
        for (k, out) in self.picks.iter_mut().skip(vector).step_by(self.vectors).enumerate() {
            let Some(((_, features), &unit)) = chosen.next_if(|((at, _), _)| **at == k) else {
                *out = counts.inactive_pick();
                continue;
            };
            let column = self.table.column(unit).unwrap_or(0);
            *out = Pick::of_distance(self.table.distance(features, column), unit, self.params.cost.d_max);
            counts.record(out);
        }
    }

    fn path(&mut self, target: &[f32]) -> Result<Path, NotFinite> {
        match self.params.method {
            Method::Exact => exact(&self.table, target, &self.path, None),
            Method::Beam => self.beam(target),
            Method::FixedLag => self.run_fixed_lag(target),
        }
    }

    fn beam(&self, target: &[f32]) -> Result<Path, NotFinite> {
        let p = &self.params;
        let params = BeamParams {
            path: self.path,
            candidates: p.candidates,
            feature: p.feature_cost,
            level: p.level_cost,
            crossing: p.crossing_cost,
        };
        let look_ahead = SelectorParams {
            look: GREEDY_LOOK,
            d_max: p.cost.d_max,
            cool_off: p.cost.cool_off,
            loop_guard: self.path.loop_guard,
            causal: false,
            effort: None,
        };
        let dims = self.table.dims();
        let mut choices = Vec::new();
        // Only what the tags allow is in the table.
        let allowed = (0..self.db.len()).map(|unit| self.table.column(unit as u32).is_some()).collect();
        let set = Units { allowed, ..Units::from(&*self.db) };
        if let Some(mut selector) = greedy::selector(&set, look_ahead) {
            for from in (0..target.len()).step_by(dims) {
                let to = (from + (GREEDY_LOOK + 1) * dims).min(target.len());
                let window = target.get(from..to).unwrap_or_default();
                let chosen = selector.choose(window).map_err(|k| k.after(from / dims))?;
                choices.push(chosen.unit);
            }
        }
        beam(&self.table, &joins(&self.db, &self.table), target, &choices, &params)
    }

    /// Chooses with a fixed lag.
    fn run_fixed_lag(&mut self, target: &[f32]) -> Result<Path, NotFinite> {
        let best = exact(&self.table, target, &self.path, None)?;
        let dims = self.table.dims();
        let mut online = FixedLag::new(self.table.clone(), self.path, self.lag);
        let mut columns = Vec::new();
        for from in (0..target.len()).step_by(dims) {
            let to = (from + (self.lag + 1) * dims).min(target.len());
            let window = target.get(from..to).unwrap_or_default();
            let unit = online.choose(window).map_err(|k| k.after(from / dims))?.unit;
            columns.push(self.table.column(unit).unwrap_or(0));
        }
        let units: Vec<u32> = columns.iter().map(|&column| self.table.unit(column)).collect();
        self.totals.differs += difference(&units, &best.units) / self.vectors as f64;
        let cost = self.table.cost(target, &columns, &self.path);
        Ok(Path { units, cost, free_cost: best.free_cost, replaced: online.replaced(), ..Path::default() })
    }
}

impl Node for GlobalUnitSelector {
    type Params = GlobalUnitSelectorParams;
    type Ports = GlobalUnitSelectorPorts;
    const NAME: &'static str = "GlobalUnitSelector";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Offline;
    const COST: f64 = 100_000.0;

    fn shape(
        p: &GlobalUnitSelectorParams,
        s: &mut Shape<'_, '_, GlobalUnitSelectorPorts>,
    ) -> Result<(), Reject> {
        let features = s.input(GlobalUnitSelectorPorts::features);
        comparable(&features.format, s.value(GlobalUnitSelectorPorts::database), &p.cost.tags)?;
        let Some(items) = features.items() else {
            let message = "the best path needs the whole take, and `features` does not end";
            return Err(Reject::new("F075", message)
                .at("features")
                .help("use OnlineUnitSelector, which decides a little after the target, or UnitSelector"));
        };
        channel_gate::check(&features, s.optional(GlobalUnitSelectorPorts::target).as_ref())?;
        let items = items.max(0) as usize;
        s.lookaround(GlobalUnitSelectorPorts::features, 0, items);
        s.lookaround(
            GlobalUnitSelectorPorts::target,
            0,
            channel_gate::target_look_ahead(features.format.conventions.unit, items),
        );
        s.ends(features.end);
        s.output(GlobalUnitSelectorPorts::picks, features.rate, PickFormat::of(&features.format));
        Ok(())
    }

    fn build(p: &GlobalUnitSelectorParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let features = cx.input(GlobalUnitSelectorPorts::features);
        let db = cx.value(GlobalUnitSelectorPorts::database);
        let units = units(&features.format, &db, &p.cost.tags)?;
        let table = Table::new(&units).ok_or_else(no_unit)?;
        let few_units = few_units_warning(&units, 0, p.cost.cool_off);
        let target = cx.optional(GlobalUnitSelectorPorts::target);
        let vectors = features.format.vectors;
        Ok(Self {
            gates: target.and_then(|_| ChannelGates::new(&db, features.rate, vectors, p.keep_room_tone, 0)),
            path: p.cost.global(features.rate.as_f64()),
            db,
            table,
            vectors,
            lag: (p.lag * features.rate.as_f64()).round() as usize,
            length: features.items().unwrap_or(0),
            first: None,
            picks: Vec::new(),
            counts: vec![Counts::default(); vectors],
            totals: Totals::default(),
            few_units,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: GlobalUnitSelectorIo<'_>) -> Result<(), Fault> {
        if self.first.is_none() {
            self.solve(&io.features, io.target.as_ref())?;
        }
        let skipped = usize::try_from(io.features.first() - self.first.unwrap_or(0)).unwrap_or(0);
        let picks = self.picks.get(skipped * self.vectors..).unwrap_or_default();
        io.picks.items().iter_mut().zip(picks).for_each(|(out, pick)| *out = *pick);
        Ok(())
    }

    fn finish(&mut self, _: GlobalUnitSelectorIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Counts::summary(self.counts.iter().copied(), self.params.cost.d_max);
        summary.extend(self.few_units.take().map(|text| ("warning", text.into())));
        summary.extend([
            ("cost", self.totals.cost.into()),
            ("free_cost", self.totals.free_cost.into()),
            ("repeats", self.totals.repeats.into()),
            ("rounds", self.totals.rounds.into()),
            ("replaced", self.totals.replaced.into()),
        ]);
        let picked = Counts::picked(self.counts.iter().copied());
        summary.push(("asleep_share", channel_gate::closed_share(self.gates.as_ref(), picked).into()));
        if self.params.method == Method::FixedLag {
            summary.push(("differs", self.totals.differs.into()));
        }
        Ok(summary)
    }

    archive_state!(each gates, first, picks, counts, totals);

    fn trial(rng: &mut Rng) -> (GlobalUnitSelectorParams, MemoryFiles) {
        let p = GlobalUnitSelectorParams::trial(rng);
        let params = GlobalUnitSelectorParams {
            candidates: 1 + p.candidates % 30,
            lag: p.lag % 0.2,
            cost: p.cost.small(rng),
            ..p
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
