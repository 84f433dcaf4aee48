//! Unit selection by the best path to the latest known unit, as a node.

use super::candidates::{comparable, few_units_warning, no_unit, not_finite, units};
use super::channel_gate::{self, ChannelGates};
use super::counts::Counts;
use super::global::{FixedLag, PathCostParams, Table};
use super::picks::{Pick, PickFormat, Picks};
use super::selector::NotFinite;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::feature::Features;
use crate::unit::UnitDatabase;
use crate::{archive_state, impl_state, params, ports};

params! {
    /// Chooses units as `GlobalUnitSelector` does, but with a fixed lag after the target: for live use.
    ///
    /// Each unit is chosen by the best path to the latest known unit. A choice is final, so that the path is not quite the best:
    /// `GlobalUnitSelector(method: FixedLag)` states how often it differs for a target. Units in their cool-off are replaced. The
    /// cost of one step is constant and proportional to the size of the database. With the sound of the target at `target`,
    /// silence is skipped as in `UnitSelector`, at no cost.
    ///
    /// # Source
    /// Forney, "The Viterbi algorithm" (1973), section III.
    pub struct OnlineUnitSelectorParams {
        /// Time from a unit to its choice.
        lag: f64 = 0.05, unit "s", range 0.0..=10.0;
        /// Cost of a path.
        [group] cost: PathCostParams;
        /// Continue to choose while the target is silent; None: only for joint (binaural) units, as in `UnitConcatenator`.
        keep_room_tone: Option<bool> = None;
    }
}

ports! {
    pub struct OnlineUnitSelectorPorts / OnlineUnitSelectorIo {
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

/// The node over [`FixedLag`].
pub struct OnlineUnitSelector {
    channels: Vec<Channel>,
    window: Vec<f32>,
    /// Offsets of the units of the window from the current one.
    ahead: Vec<usize>,
    lag: usize,
    dims: usize,
    d_max: f64,
    /// Warning about a database with hardly more units than `cool_off` excludes.
    few_units: Option<String>,
    /// Gates that close where the target is silent.
    gates: Option<ChannelGates>,
    /// Units of the target, where it ends.
    length: Option<i64>,
}

/// One channel of the target.
struct Channel {
    path: FixedLag,
    counts: Counts,
}
impl_state!(Channel { path, counts });

fn lag(p: &OnlineUnitSelectorParams, rate: Rate) -> usize {
    (p.lag * rate.as_f64()).round() as usize
}

impl Node for OnlineUnitSelector {
    type Params = OnlineUnitSelectorParams;
    type Ports = OnlineUnitSelectorPorts;
    const NAME: &'static str = "OnlineUnitSelector";
    const VERSION: u32 = 4;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 50_000.0;

    fn shape(
        p: &OnlineUnitSelectorParams,
        s: &mut Shape<'_, '_, OnlineUnitSelectorPorts>,
    ) -> Result<(), Reject> {
        let features = s.input(OnlineUnitSelectorPorts::features);
        comparable(&features.format, s.value(OnlineUnitSelectorPorts::database), &p.cost.tags)?;
        channel_gate::check(&features, s.optional(OnlineUnitSelectorPorts::target).as_ref())?;
        let lag = lag(p, features.rate);
        s.lookaround(OnlineUnitSelectorPorts::features, 0, lag);
        s.lookaround(
            OnlineUnitSelectorPorts::target,
            0,
            channel_gate::target_look_ahead(features.format.conventions.unit, lag),
        );
        s.ends(features.end);
        s.output(OnlineUnitSelectorPorts::picks, features.rate, PickFormat::of(&features.format));
        Ok(())
    }

    fn build(p: &OnlineUnitSelectorParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let features = cx.input(OnlineUnitSelectorPorts::features);
        let db = cx.value(OnlineUnitSelectorPorts::database);
        let units = units(&features.format, &db, &p.cost.tags)?;
        let table = Table::new(&units).ok_or_else(no_unit)?;
        let path = p.cost.global(features.rate.as_f64());
        let (lag, dims) = (lag(p, features.rate), db.dims());
        let channel =
            |_| Channel { path: FixedLag::new(table.clone(), path, lag), counts: Counts::default() };
        let (vectors, target) = (features.format.vectors, cx.optional(OnlineUnitSelectorPorts::target));
        Ok(Self {
            gates: target.and_then(|_| ChannelGates::new(&db, features.rate, vectors, p.keep_room_tone, lag)),
            channels: (0..vectors).map(channel).collect(),
            window: Vec::with_capacity((lag + 1) * dims),
            ahead: Vec::with_capacity(lag + 1),
            lag,
            dims,
            d_max: p.cost.d_max,
            few_units: few_units_warning(&units, 0, p.cost.cool_off),
            length: features.items(),
        })
    }

    fn run(&mut self, mut io: OnlineUnitSelectorIo<'_>) -> Result<(), Fault> {
        let features = &io.features;
        let around = features.around();
        let vectors = self.channels.len().max(1);
        for (k, out) in io.picks.items().chunks_exact_mut(vectors).enumerate() {
            let at = features.first() + k as i64;
            let left = self.length.map_or(i64::MAX, |n| n - 1 - at);
            let known = self.lag.min(usize::try_from(left).unwrap_or(0));
            let here = features.behind() + k;
            for (vector, (channel, out)) in self.channels.iter_mut().zip(out).enumerate() {
                let Channel { path, counts } = channel;
                let mut gates = self.gates.as_mut().zip(io.target.as_ref());
                let mut is_closed =
                    |at| gates.as_mut().is_some_and(|(s, target)| s.is_closed(target, vector, at));
                if is_closed(at) {
                    *out = counts.inactive_pick();
                    continue;
                }
                self.window.clear();
                self.ahead.clear();
                // Units with a closed gate are no part of the path.
                self.ahead.extend((0..=known).filter(|k| *k == 0 || !is_closed(at + *k as i64)));
                for item in &self.ahead {
                    let from = (here + item) * features.width() + vector * self.dims;
                    self.window.extend_from_slice(around.get(from..from + self.dims).unwrap_or_default());
                }
                let chosen = path.choose(&self.window).map_err(|NotFinite(k)| {
                    let ahead = self.ahead.get(k as usize).copied().unwrap_or(0);
                    not_finite(features, at + ahead as i64)
                })?;
                *out = Pick::of_distance(chosen.d1, chosen.unit, self.d_max);
                counts.record(out);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: OnlineUnitSelectorIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Counts::summary(self.channels.iter().map(|c| c.counts), self.d_max);
        summary.extend(self.few_units.take().map(|text| ("warning", text.into())));
        let replaced: usize = self.channels.iter().map(|c| c.path.replaced()).sum();
        summary.push(("replaced", replaced.into()));
        let picked = Counts::picked(self.channels.iter().map(|c| c.counts));
        summary.push(("asleep_share", channel_gate::closed_share(self.gates.as_ref(), picked).into()));
        Ok(summary)
    }

    archive_state!(each channels, each gates);

    fn trial(rng: &mut Rng) -> (OnlineUnitSelectorParams, MemoryFiles) {
        let p = OnlineUnitSelectorParams::trial(rng);
        let params = OnlineUnitSelectorParams { lag: rng.between(0.0, 0.1), cost: p.cost.small(rng), ..p };
        (params, MemoryFiles::default())
    }
}
