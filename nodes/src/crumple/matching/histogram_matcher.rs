//! Matching of events with samples by energy, as a node.

use super::calibration::EnergyCalibration;
use super::energy_map::{EnergyMap, Mapping};
use super::matched_crumple::MatchedCrumple;
use super::nearest_sample::Nearest;
use super::rolling::Rolling;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Value};
use crate::core::random::{Random, Rng};
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, seconds};
use crate::crumple::bank::CrumpleBank;
use crate::crumple::events::Crumple;
use crate::{archive_state, params, ports};

params! {
    /// Assigns to every event a recorded sample of matching energy.
    ///
    /// The energy of an event has a rank in the calibration. That rank has an energy in the bank, and the sample of
    /// nearest energy is taken. Events below `e_min` of the calibration are dropped; events above its maximum get the
    /// strongest sample. A calibration with another `weight` is refused. A calibration of another mesh, frame rate or
    /// curvature method, or with a dead band that differs by more than a tenth, is used with a warning, because
    /// energies depend on all of them.
    ///
    /// With `adapt` the ranks are those among recent events, for live use and for motion unlike any calibration. The
    /// calibration is then only the initial distribution and optional. With `max_rate` the ranks are those among the
    /// events that are not dropped.
    ///
    /// # Randomness
    /// With `k_nearest` above 1, the choice is a function of the seed, the time of the event and its lowest vertex.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3,
    /// after Heeger and Bergen (1995) for the matching of histograms; ranks and adaptation are additions.
    pub struct HistogramMatcherParams {
        /// Comparison of energies of events and samples.
        mapping: Mapping = Mapping::Ecdf;
        /// Number of samples of nearest energy to choose from; the last choice is not repeated.
        k_nearest: usize = 1, unit "samples", range 1..=1000;
        /// Uses ranks among recent events.
        adapt: bool = false;
        /// Time after which the weight of an event is halved, with `adapt`.
        half_life: f64 = 60.0, unit "s", range 0.1..=86_400.0;
        /// Maximum number of events per second, with `adapt`; the weakest recent ones are dropped.
        max_rate: Option<f64> = None, unit "1/s", range 0.001..=100_000.0;
    }
}
ports! {
    pub struct HistogramMatcherPorts / HistogramMatcherIo {
        in {
            /// Events.
            events: Events<Crumple>,
            /// Bank of samples.
            bank: Value<CrumpleBank>,
            /// Energies of a whole take.
            calibration: Option<Value<EnergyCalibration>>,
        }
        out {
            /// The events with the indices of their samples.
            matched: Events<MatchedCrumple>,
        }
    }
}

/// The node `HistogramMatcher`.
pub struct HistogramMatcher {
    map: EnergyMap,
    nearest: Nearest,
    rolling: Option<Rolling>,
    calibration: Option<std::sync::Arc<EnergyCalibration>>,
    bank: u32,
    random: Random,
    params: HistogramMatcherParams,
    count: [u64; 3],
    /// Message about the first event that differs from those of the calibration.
    mismatch: Option<String>,
}

/// Indices in `count`: events matched, dropped as too weak, and above the calibration.
const MATCHED: usize = 0;
const DROPPED: usize = 1;
const ABOVE: usize = 2;

impl HistogramMatcher {
    /// Returns the rank of an event, `None` if it is too weak.
    fn rank(&mut self, tick: Tick, energy: f64) -> Option<f64> {
        let e_min = self.calibration.as_ref().map_or(0.0, |c| c.e_min);
        if energy < e_min {
            return None;
        }
        let Some(rolling) = &mut self.rolling else { return Some(self.map.rank(energy)) };
        let (time, max_rate) = (seconds(tick), self.params.max_rate);
        let rank = rolling.add(time, energy);
        let share = max_rate.map_or(1.0, |max_rate| max_rate / rolling.rate(time).max(1e-12)).min(1.0);
        // The rank among the remaining events: dropped ones are in no distribution.
        (1.0 - rank < share).then(|| 1.0 - (1.0 - rank) / share)
    }

    /// Returns an event with its sample, `None` if it is too weak.
    fn matched(&mut self, tick: Tick, event: &Crumple) -> Option<MatchedCrumple> {
        let Some(rank) = self.rank(tick, event.energy) else {
            self.count[DROPPED] += 1;
            return None;
        };
        let calibrated = self.calibration.as_ref().map(|c| &c.energies).filter(|_| self.rolling.is_none());
        let above = calibrated
            .is_some_and(|energies| energies.last().is_none_or(|strongest| event.energy > *strongest));
        self.count[ABOVE] += u64::from(above);
        let wanted = self.map.wanted(rank);
        let draw = self.random.uniform(event.id, tick as u64, 0);
        let sample = self.nearest.pick(wanted, self.params.k_nearest, draw)?;
        self.count[MATCHED] += 1;
        Some(MatchedCrumple::new(event, sample as u32, wanted, self.bank))
    }
}

impl Node for HistogramMatcher {
    type Params = HistogramMatcherParams;
    type Ports = HistogramMatcherPorts;
    const NAME: &'static str = "HistogramMatcher";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 1000.0;

    fn shape(p: &HistogramMatcherParams, s: &mut Shape<'_, '_, HistogramMatcherPorts>) -> Result<(), Reject> {
        if !p.adapt && !s.linked(HistogramMatcherPorts::calibration) {
            let message = "a calibration is needed to rank events by energy";
            let help = "link an EnergyCalibration, or set `adapt: true`";
            s.wrong(Reject::new("F106", message).at("calibration").help(help));
        }
        if !p.adapt && p.max_rate.is_some() {
            let message = "`max_rate` needs `adapt: true`";
            let help = "set `rate` of EnergyCalibration, or set `adapt: true`";
            s.wrong(Reject::new("F106", message).at("max_rate").help(help));
        }
        Ok(())
    }

    fn build(p: &HistogramMatcherParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let bank = cx.value(HistogramMatcherPorts::bank);
        bank.validate().map_err(|e| Fault::new("F106", e.to_string()).at("bank"))?;
        let calibration = cx.optional_value(HistogramMatcherPorts::calibration);
        if let Some(c) = &calibration {
            c.validate().map_err(|e| Fault::new("F106", e.to_string()).at("calibration"))?;
        }
        let energies = calibration.as_ref().map_or(&[][..], |c| &c.energies);
        let rolling = p.adapt.then(|| {
            let mut rolling = Rolling::new(p.half_life);
            rolling.seed(energies, calibration.as_ref().map_or(0.0, |c| c.rate));
            rolling
        });
        Ok(Self {
            map: EnergyMap::new(energies, &bank.energies, p.mapping),
            nearest: Nearest::new(&bank),
            rolling,
            calibration,
            bank: bank.id(),
            random: cx.random,
            params: p.clone(),
            count: [0; 3],
            mismatch: None,
        })
    }

    fn run(&mut self, mut io: HistogramMatcherIo<'_>) -> Result<(), Fault> {
        for (tick, event) in io.events.events() {
            if !(event.energy.is_finite() && event.energy >= 0.0) {
                let message =
                    format!("an event has the energy {}; energies are finite and not negative", event.energy);
                return Err(Fault::new("F106", message).at("events").when(*tick));
            }
            if let Some(c) = &self.calibration {
                c.check_weight(event.weight)
                    .map_err(|e| Fault::new("F106", e.to_string()).at("calibration").when(*tick))?;
                if self.mismatch.is_none() && self.rolling.is_none() {
                    self.mismatch = c.mismatch(event);
                }
            }
            if let Some(matched) = self.matched(*tick, event) {
                io.matched.push(*tick, matched);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: HistogramMatcherIo<'_>) -> Result<Summary, Fault> {
        let [matched, dropped, above] = self.count;
        let mut summary: Summary = vec![
            ("matched", matched.into()),
            ("dropped", dropped.into()),
            ("above_calibration", above.into()),
        ];
        let mismatch = self.mismatch.take().map(|text| {
            format!("{text}: their energies may not be comparable; measure the calibration on this motion, or set `adapt: true`")
        });
        summary.extend(mismatch.map(|text| ("warning", text.into())));
        Ok(summary)
    }

    fn adopt(&mut self, old: &mut Self) {
        if let (Some(new), Some(old)) = (&mut self.rolling, &old.rolling) {
            new.take_state(old);
        }
        self.count = old.count;
    }

    archive_state!(nearest, each rolling, count, mismatch);

    fn trial(rng: &mut Rng) -> (HistogramMatcherParams, MemoryFiles) {
        let p = HistogramMatcherParams::trial(rng);
        let max_rate = p.max_rate.filter(|_| p.adapt).map(|_| rng.between(5.0, 200.0));
        let k_nearest = 1 + rng.below(4);
        (
            HistogramMatcherParams { k_nearest, max_rate, half_life: rng.between(0.1, 2.0), ..p },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests;
