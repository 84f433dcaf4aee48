//! The node around [`EnergyMap`] and [`Rolling`].

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
    /// Gives every crumple a recorded sample of matching energy.
    ///
    /// What is as strong among the events as a sample among the samples belongs together: the energy of an event has a rank in the
    /// calibration, that rank has an energy in the bank, and the sample of the nearest energy is taken. Events below the
    /// calibration's `e_min` are dropped; above its strongest, the bank's strongest is taken. A calibration on energies that are summed otherwise
    /// is refused; one of another mesh or frame rate, of curvature that was measured otherwise, or of a dead band that differs by more
    /// than a tenth is used, and a note says so, since energies depend on all of them.
    ///
    /// With `adapt` the ranks are those among the events of late, each event judged by what came before it, for live use and
    /// for motion that is unlike any calibration; then a calibration is only a start, and may be left out. Of the events that
    /// `max_rate` leaves, the weakest gets a weak sample too.
    ///
    /// # Randomness
    /// With `k_nearest` above 1, the choice follows from the seed, the time of the event and its lowest vertex.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3, after Heeger and Bergen
    /// (1995) for the matching of histograms; ranks and adaption are additions.
    pub struct HistogramMatcherParams {
        /// How energies of events and of samples are compared.
        mapping: Mapping = Mapping::Ecdf;
        /// How many samples of nearest energy to choose from, never the last one again.
        k_nearest: usize = 1, unit "samples", range 1..=1000;
        /// Whether ranks are those of late.
        adapt: bool = false;
        /// How long until an event counts half, with `adapt`.
        half_life: f64 = 60.0, unit "s", range 0.1..=86_400.0;
        /// Events per second above which the weakest of late are dropped, with `adapt`.
        max_rate: Option<f64> = None, unit "1/s", range 0.001..=100_000.0;
    }
}
ports! {
    pub struct HistogramMatcherPorts / HistogramMatcherIo {
        in {
            /// The events.
            events: Events<Crumple>,
            /// The samples.
            bank: Value<CrumpleBank>,
            /// Energies of a whole take.
            calibration: Option<Value<EnergyCalibration>>,
        }
        out {
            /// The same events with the numbers of their samples.
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
    /// How events differ from those of the calibration, once any did.
    odd: Option<String>,
}

/// Events matched, dropped as too weak, and outside of the calibration: places in `count`.
const MATCHED: usize = 0;
const DROPPED: usize = 1;
const OUTSIDE: usize = 2;

impl HistogramMatcher {
    /// Rank of an event, `None` where it is too weak.
    fn rank(&mut self, tick: Tick, energy: f64) -> Option<f64> {
        let e_min = self.calibration.as_ref().map_or(0.0, |c| c.e_min);
        if energy < e_min {
            return None;
        }
        let Some(rolling) = &mut self.rolling else { return Some(self.map.rank(energy)) };
        let (time, most) = (seconds(tick), self.params.max_rate);
        let rank = rolling.add(time, energy);
        let share = most.map_or(1.0, |most| most / rolling.rate(time).max(1e-12)).min(1.0);
        // Among those that are left: what is too weak counts in no distribution.
        (1.0 - rank < share).then(|| 1.0 - (1.0 - rank) / share)
    }

    fn matched(&mut self, tick: Tick, event: &Crumple) -> Option<MatchedCrumple> {
        let Some(rank) = self.rank(tick, event.energy) else {
            self.count[DROPPED] += 1;
            return None;
        };
        let known = self.calibration.as_ref().map(|c| &c.energies).filter(|_| self.rolling.is_none());
        let outside = known.is_some_and(|known| known.last().is_none_or(|most| event.energy > *most));
        self.count[OUTSIDE] += u64::from(outside);
        let wanted = self.map.wanted(rank);
        let rng = self.random.uniform(event.id, tick as u64, 0);
        let sample = self.nearest.pick(wanted, self.params.k_nearest, rng)?;
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
            let message = "without a calibration nothing says which events are strong";
            let help = "link an EnergyCalibration, or set `adapt: true`";
            s.wrong(Reject::new("F106", message).at("calibration").help(help));
        }
        if !p.adapt && p.max_rate.is_some() {
            let message = "`max_rate` works with `adapt: true` only";
            let help = "give the rate to EnergyCalibration, or set `adapt: true`";
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
            odd: None,
        })
    }

    fn run(&mut self, mut io: HistogramMatcherIo<'_>) -> Result<(), Fault> {
        for (tick, event) in io.events.events() {
            if !(event.energy.is_finite() && event.energy >= 0.0) {
                let message =
                    format!("an event has the energy {}; it must be finite and not below 0", event.energy);
                return Err(Fault::new("F106", message).at("events").when(*tick));
            }
            if let Some(c) = &self.calibration {
                c.accepts(event.weight)
                    .map_err(|e| Fault::new("F106", e.to_string()).at("calibration").when(*tick))?;
                if self.odd.is_none() && self.rolling.is_none() {
                    self.odd = c.differs(event);
                }
            }
            if let Some(matched) = self.matched(*tick, event) {
                io.matched.push(*tick, matched);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: HistogramMatcherIo<'_>) -> Result<Summary, Fault> {
        let [matched, dropped, outside] = self.count;
        let mut told: Summary = vec![
            ("matched", matched.into()),
            ("dropped", dropped.into()),
            ("above_calibration", outside.into()),
        ];
        let odd = self.odd.take().map(|text| {
            format!("{text}: what is strong there may not be strong here; measure it on this motion, or set `adapt: true`")
        });
        told.extend(odd.map(|text| ("warning", text.into())));
        Ok(told)
    }

    fn adopt(&mut self, old: &mut Self) {
        if let (Some(new), Some(old)) = (&mut self.rolling, &old.rolling) {
            new.take_state(old);
        }
        self.count = old.count;
    }

    archive_state!(nearest, each rolling, count, odd);

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
