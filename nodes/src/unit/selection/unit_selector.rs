//! Unit selection as a node.

use super::candidates::{allowed, comparable, few_units_warning, no_unit, not_finite, units};
use super::channel_gate::{self, ChannelGates};
use super::counts::Counts;
use super::greedy::selector;
use super::picks::{Pick, PickFormat, Picks};
use super::selector::{NotFinite, Selector, SelectorParams, Units};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::{In, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::state::{StateArchive, Stateful};
use crate::feature::Features;
use crate::unit::UnitDatabase;
use crate::{archive_state, params, ports};

params! {
    /// Chooses, for each unit of a target, the unit of a database that is most similar to it in sound and continuity.
    ///
    /// Among all units within `d_max` it takes the one with the least sum of distances over itself and the next `look` units.
    /// If there is none, it takes the nearest unit and marks it as a fallback. The summary states their share: more than a few
    /// mean that the database lacks sounds of the target. The search is exact and needs no table of distances. Of equally good
    /// units it prefers the one that follows the last pick.
    ///
    /// Every channel of the target chooses independently. It chooses from the same channel of the recordings if these have as
    /// many channels; otherwise all channels choose from the same units, a sound in the middle may wander, and a note
    /// reports it.
    ///
    /// With the sound of the target at `target`, a channel chooses nothing while the output of `UnitConcatenator` is faded out
    /// because the target is silent. When the target sounds again, the choice continues with its history. The summary states the
    /// share of units that this saved.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), algorithm 1, completed
    /// where it is undefined: units in their cool-off are excluded before the search, windows never leave a recording and
    /// shorten at the end of the target, and if every unit is in its cool-off, the least recently used one is taken.
    /// `causal`, `loop_guard` and `tags` are additions.
    pub struct UnitSelectorParams {
        /// Number of units after the current one that are also compared.
        look: usize = 5, unit "units", range 0..=1000_usize;
        /// Greatest distance of the features of similar sounds; with the default features 2.0 is 5 dB.
        d_max: f64 = 2.0, unit "", range 0.0..=1_000_000.0;
        /// Number of targets for which a chosen unit is not chosen again.
        cool_off: usize = 20, unit "units", range 0..=1_000_000_usize;
        /// Time within which the last four picks are not repeated in order; 0 allows it, as in the paper.
        loop_guard: f64 = 0.5, unit "s", range 0.0..=60.0;
        /// Compare units before the current one in place of units after it, so that there is no look-ahead.
        causal: bool = false;
        /// Choose only from recordings with one of these tags; empty for all.
        tags: Vec<Text> = Vec::new();
        /// Each channel chooses only from the same channel of the recordings; None: if they have as many channels.
        own_channels: Option<bool> = None;
        /// Maximal number of units and groups of units that one choice examines; 0 for no limit. A search that exceeds it continues
        /// the run of units: 2500 keep a choice below 0.2 ms on a core of a server, for live use. The limit counts work and not
        /// time, so that the result is the same on every machine. The summary states how often it applies (`cut_share`).
        effort: usize = 0, unit "units", range 0..=1_000_000_000_usize;
        /// Continue to choose while the target is silent; None: only for joint (binaural) units, as in `UnitConcatenator`.
        keep_room_tone: Option<bool> = None;
    }
}

ports! {
    pub struct UnitSelectorPorts / UnitSelectorIo {
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

/// The node over [`Selector`].
pub struct UnitSelector {
    channels: Vec<Channel>,
    look: usize,
    causal: bool,
    dims: usize,
    d_max: f64,
    /// Warning about a database with hardly more units than `cool_off` excludes.
    few_units: Option<String>,
    /// Gates that close where the target is silent.
    gates: Option<ChannelGates>,
    /// Number of units of the target, if it ends.
    length: Option<i64>,
}

struct Channel {
    selector: Box<dyn Selector>,
    window: Vec<f32>,
    picks: Vec<Pick>,
    counts: Counts,
}

impl Stateful for Channel {
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        self.selector.archive_state(archive)?;
        self.counts.archive_state(archive)
    }
}

impl Channel {
    /// Chooses for all items of a window.
    fn choose(
        &mut self,
        vector: usize,
        features: &In<'_, Features>,
        mut asleep: impl FnMut(i64) -> bool,
        node: &Layout,
    ) -> Result<(), Fault> {
        self.picks.clear();
        let around = features.around();
        for k in 0..features.len() {
            let at = features.first() + k as i64;
            if asleep(at) {
                self.picks.push(self.counts.inactive_pick());
                continue;
            }
            let most = if node.causal { at } else { node.length.map_or(i64::MAX, |n| n - 1 - at) };
            let look = node.look.min(usize::try_from(most).unwrap_or(0));
            let here = features.behind() + k;
            let first = if node.causal { here - look } else { here };
            self.window.clear();
            for item in first..=first + look {
                let from = item * features.width() + vector * node.dims;
                self.window.extend_from_slice(around.get(from..from + node.dims).unwrap_or_default());
            }
            let chosen = self.selector.choose(&self.window).map_err(|NotFinite(k)| {
                let before = if node.causal { look as i64 } else { 0 };
                not_finite(features, at - before + k as i64)
            })?;
            let pick = Pick {
                unit: chosen.unit as i32,
                fallback: chosen.fallback,
                asleep: false,
                d1: chosen.d1 as f32,
                d2: chosen.d2 as f32,
            };
            self.counts.record(&pick);
            self.counts.cut += u64::from(chosen.cut);
            self.picks.push(pick);
        }
        Ok(())
    }
}

struct Layout {
    look: usize,
    causal: bool,
    dims: usize,
    length: Option<i64>,
}

/// Units that a channel of the target may choose from.
fn own(db: &UnitDatabase, allowed: &[bool], vector: usize) -> Vec<bool> {
    let mut out = vec![false; allowed.len()];
    for segment in db.segments.iter().filter(|s| s.channel as usize == vector) {
        out[segment.range()].copy_from_slice(&allowed[segment.range()]);
    }
    out
}

/// Returns true if each channel chooses from the same channel of the recordings.
fn own_channels(p: &UnitSelectorParams, db: &UnitDatabase, vectors: usize) -> Result<bool, Reject> {
    let allowed = allowed(db, &p.tags);
    let open = |unit: u32| allowed.get(unit as usize).copied().unwrap_or(false);
    let has = |vector: usize| db.segments.iter().any(|s| s.channel as usize == vector && open(s.start));
    let missing = (0..vectors).find(|vector| !has(*vector));
    match (p.own_channels, missing) {
        (Some(true), Some(vector)) => {
            let message = format!("no recording of the database has a channel {vector}, counted from 0");
            let help = "give recordings of as many channels, or `own_channels: false`";
            Err(Reject::new("F101", message).at("own_channels").help(help))
        }
        (wanted, _) => Ok(vectors > 1 && wanted.unwrap_or(missing.is_none())),
    }
}

impl Node for UnitSelector {
    type Params = UnitSelectorParams;
    type Ports = UnitSelectorPorts;
    const NAME: &'static str = "UnitSelector";
    const VERSION: u32 = 6;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 500.0;

    fn shape(p: &UnitSelectorParams, s: &mut Shape<'_, '_, UnitSelectorPorts>) -> Result<(), Reject> {
        let features = s.input(UnitSelectorPorts::features);
        let format = &features.format;
        comparable(format, s.value(UnitSelectorPorts::database), &p.tags)?;
        // Recordings that are not computed yet may have as many channels.
        let own = match s.value(UnitSelectorPorts::database) {
            Some(db) => own_channels(p, &db, format.vectors)?,
            None => p.own_channels != Some(false),
        };
        if format.vectors > 1 && !own {
            s.note("all channels choose from the same units: a sound in the middle may wander; Mfcc(channels: SharedMid) or Joint keep it");
        }
        channel_gate::check(&features, s.optional(UnitSelectorPorts::target).as_ref())?;
        s.lookaround(
            UnitSelectorPorts::target,
            0,
            channel_gate::target_look_ahead(format.conventions.unit, 0),
        );
        s.ends(features.end);
        let (past, ahead) = if p.causal { (p.look, 0) } else { (0, p.look) };
        s.lookaround(UnitSelectorPorts::features, past, ahead);
        s.output(UnitSelectorPorts::picks, features.rate, PickFormat::of(format));
        Ok(())
    }

    fn build(p: &UnitSelectorParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let features = cx.input(UnitSelectorPorts::features);
        let db = cx.value(UnitSelectorPorts::database);
        let units = units(&features.format, &db, &p.tags)?;
        let params = SelectorParams {
            look: p.look,
            d_max: p.d_max,
            cool_off: p.cool_off,
            loop_guard: (p.loop_guard * features.rate.as_f64()).round() as usize,
            causal: p.causal,
            effort: (p.effort > 0).then_some(p.effort),
        };
        let vectors = features.format.vectors;
        let mut few_units = few_units_warning(&units, p.look, p.cool_off);
        let selectors = if own_channels(p, &db, vectors)? {
            let of = |vector| {
                let own = Units { allowed: own(&db, &units.allowed, vector), ..units.clone() };
                few_units = few_units.take().or_else(|| few_units_warning(&own, p.look, p.cool_off));
                selector(&own, params.clone())
            };
            (0..vectors).map(of).collect::<Option<Vec<_>>>()
        } else {
            let one = selector(&units, params);
            one.map(|one| (1..vectors).map(|_| one.boxed_clone()).chain([one.boxed_clone()]).collect())
        };
        let target = cx.optional(UnitSelectorPorts::target);
        let channel =
            |selector| Channel { selector, window: Vec::new(), picks: Vec::new(), counts: Counts::default() };
        let channels: Option<Vec<Channel>> =
            selectors.map(|selectors| selectors.into_iter().map(channel).collect());
        Ok(Self {
            channels: channels.ok_or_else(no_unit)?,
            look: p.look,
            causal: p.causal,
            dims: db.dims(),
            d_max: p.d_max,
            few_units,
            gates: target.and_then(|_| ChannelGates::new(&db, features.rate, vectors, p.keep_room_tone, 0)),
            length: features.items(),
        })
    }

    fn run(&mut self, mut io: UnitSelectorIo<'_>) -> Result<(), Fault> {
        let layout = Layout { look: self.look, causal: self.causal, dims: self.dims, length: self.length };
        let (features, target) = (&io.features, io.target.as_ref());
        for (vector, channel) in self.channels.iter_mut().enumerate() {
            let mut gates = self.gates.as_mut().zip(target);
            let asleep = |at| gates.as_mut().is_some_and(|(s, target)| s.is_closed(target, vector, at));
            channel.choose(vector, features, asleep, &layout)?;
        }
        let width = self.channels.len();
        let out = io.picks.items();
        for (vector, channel) in self.channels.iter().enumerate() {
            for (out, pick) in out.iter_mut().skip(vector).step_by(width).zip(&channel.picks) {
                *out = *pick;
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: UnitSelectorIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Counts::summary(self.channels.iter().map(|channel| channel.counts), self.d_max);
        summary.extend(self.few_units.take().map(|text| ("warning", text.into())));
        let picked = Counts::picked(self.channels.iter().map(|channel| channel.counts));
        let cut: u64 = self.channels.iter().map(|channel| channel.counts.cut).sum();
        summary.push(("cut_share", (cut as f64 / picked.max(1) as f64).into()));
        summary.push(("asleep_share", channel_gate::closed_share(self.gates.as_ref(), picked).into()));
        Ok(summary)
    }

    archive_state!(each channels, each gates);

    fn trial(rng: &mut Rng) -> (UnitSelectorParams, MemoryFiles) {
        let p = UnitSelectorParams::trial(rng);
        let params = UnitSelectorParams {
            look: p.look % 6,
            d_max: rng.between(0.0, 9.0),
            cool_off: p.cool_off % 40,
            loop_guard: p.loop_guard % 0.5,
            tags: Vec::new(),
            own_channels: None,
            ..p
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
