//! The energies of a whole take: what counts as weak, and what as strong.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::histogram::hazen;
use crate::core::content::{altered_content, content_digest};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::core::time::{TICKS_PER_SECOND, Tick};
use crate::crumple::events::{Crumple, Weight};
use crate::curvature::Method;
use crate::impl_state;
use crate::plot::{Axis, Line, chart};

/// Version of the fields of [`EnergyCalibration`].
pub const CALIBRATION_VERSION: u32 = 1;
/// Energies that are kept one by one; of more, quantiles.
const MOST: usize = 4096;
/// Quantiles that are kept of more energies.
const QUANTILES: usize = 1024;

/// Below which energy events are dropped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Floor {
    /// Below this energy.
    Absolute(f64),
    /// So many hundredths of all events, the weakest.
    Percentile(f64),
    /// All but the strongest that make so many events per second.
    Rate(f64),
}

/// Energies of the events of one take, to be matched with those of a bank of samples.
///
/// Three takes of one jacket in the paper have floors of 98902, 172875 and 906402: a floor belongs to a mesh and a motion, so it
/// is measured, and stored with what it was measured on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnergyCalibration {
    /// [`CALIBRATION_VERSION`].
    pub version: u32,
    /// What energies are a sum over; unknown where there was no event.
    pub weight: Option<Weight>,
    /// Energy below which events are dropped.
    pub e_min: f64,
    /// How it was chosen.
    pub floor: Floor,
    /// Energies from `e_min` on, sorted; where there are more than 4096, 1024 quantiles of them.
    pub energies: Vec<f64>,
    /// Events from `e_min` on.
    pub events: u64,
    /// Events below.
    pub dropped: u64,
    /// Length of the take, s.
    pub seconds: f64,
    /// Events from `e_min` on per second.
    pub rate: f64,
    /// Frames per second of the motion; 0 where there was no event.
    pub fps: f64,
    /// Digest of the mesh; 0 where there was no event.
    pub mesh: u32,
    /// How curvature was measured; unknown where there was no event, where nothing was measured, and in older files.
    #[serde(default)]
    pub method: Option<Method>,
    /// Dead band of the curvature, 1/m; unknown where there was no event and in older files.
    #[serde(default)]
    pub h_eps: Option<f32>,
    /// Digest of what the numbers above depend on: version, weight, floor, frames per second, mesh, method and dead band.
    pub conventions: String,
    /// Digest of all of the above, so that a change by hand is seen; empty where none was written.
    #[serde(default)]
    pub content: String,
}

/// Why a calibration cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// Written by other code.
    #[error("`version` is {found}; this reads {CALIBRATION_VERSION}: measure it again")]
    Version {
        /// The version found.
        found: u32,
    },
    /// A number that cannot be.
    #[error("`{field}` is {found}; {wanted}")]
    Number {
        /// Field.
        field: &'static str,
        /// What it holds.
        found: f64,
        /// What it must be.
        wanted: &'static str,
    },
    /// An energy out of order.
    #[error("energy {index} is {found}; they have to be finite, at least `e_min` and sorted")]
    Energy {
        /// Its place.
        index: usize,
        /// Its value.
        found: f64,
    },
    /// Fields that were changed by hand.
    #[error(
        "`conventions` is {found}, and the fields that it belongs to give {wanted}: they were changed after it was measured"
    )]
    Conventions {
        /// What the file says.
        found: String,
        /// What its fields give.
        wanted: String,
    },
    /// Events of another kind.
    #[error(
        "`weight` of the calibration is {calibrated:?}, of the events {found:?}: measure it on events of the same kind"
    )]
    Weight {
        /// That of the calibration.
        calibrated: Weight,
        /// That of the events.
        found: Weight,
    },
}

/// Frames per second of the motion that an event comes from, to a millionth: intervals are whole ticks.
fn frame_rate(event: &Crumple) -> f64 {
    (TICKS_PER_SECOND as f64 / (event.interval.max(1) as f64) * 1e4).round() / 1e4
}

/// Collects the energies of a take.
#[derive(Clone, Debug, Default)]
pub struct EnergyMeter {
    energies: Vec<f64>,
    first: Option<Crumple>,
}
impl_state!(EnergyMeter { energies, first });

impl EnergyMeter {
    /// Adds an event.
    ///
    /// # Errors
    /// An event whose energy is a sum over something else than that of the first.
    pub fn add(&mut self, event: &Crumple) -> Result<(), CalibrationError> {
        let first = self.first.get_or_insert(*event);
        if first.weight != event.weight {
            return Err(CalibrationError::Weight { calibrated: first.weight, found: event.weight });
        }
        self.energies.push(event.energy);
        Ok(())
    }

    /// The calibration of a take of `seconds`.
    ///
    /// # Complexity
    /// O(n log n) for n events.
    #[must_use]
    pub fn finish(mut self, seconds: f64, floor: Floor) -> EnergyCalibration {
        self.energies.sort_unstable_by(f64::total_cmp);
        let all = self.energies.len();
        let e_min = match floor {
            Floor::Absolute(e) => e,
            Floor::Percentile(p) => hazen(&self.energies, 0.01 * p),
            Floor::Rate(rate) => {
                let wanted = (rate * seconds).round().max(1.0) as usize;
                if wanted < all { self.energies[all - wanted] } else { 0.0 }
            }
        };
        let dropped = self.energies.partition_point(|e| *e < e_min);
        let kept = self.energies.split_off(dropped);
        let events = kept.len() as u64;
        let at = |k: usize| hazen(&kept, (k as f64 + 0.5) / QUANTILES as f64);
        let energies = if kept.len() > MOST { (0..QUANTILES).map(at).collect() } else { kept };
        let calibration = EnergyCalibration {
            version: CALIBRATION_VERSION,
            weight: self.first.map(|event| event.weight),
            e_min,
            floor,
            energies,
            events,
            dropped: dropped as u64,
            seconds,
            rate: if seconds > 0.0 { events as f64 / seconds } else { 0.0 },
            fps: self.first.as_ref().map_or(0.0, frame_rate),
            mesh: self.first.map_or(0, |event| event.mesh),
            method: self.first.and_then(|event| event.method),
            h_eps: self.first.map(|event| event.h_eps),
            conventions: String::new(),
            content: String::new(),
        };
        calibration.sealed()
    }
}

impl EnergyCalibration {
    fn digest(&self) -> String {
        let mut text =
            format!("{} {:?} {:?} {} {}", self.version, self.weight, self.floor, self.fps, self.mesh);
        // Older files know neither, and keep their digest.
        if self.method.is_some() || self.h_eps.is_some() {
            text += &format!(" {:?} {:?}", self.method, self.h_eps);
        }
        blake3::hash(text.as_bytes()).to_hex()[..16].to_owned()
    }

    fn content(&self) -> String {
        let plain = Self { content: String::new(), ..self.clone() };
        content_digest(&plain, &["\"method\":null,", "\"h_eps\":null,"])
    }

    /// The same with the digests of what it holds.
    pub(super) fn sealed(mut self) -> Self {
        self.conventions = self.digest();
        self.content = self.content();
        self
    }

    /// What tells that a calibration of a file is not the one that was written, if anything.
    #[must_use]
    pub fn altered(&self) -> Option<String> {
        altered_content(&self.content, &self.content(), "measure it")
    }

    /// Whether all of it can be what a measurement gives.
    ///
    /// # Errors
    /// Names the field.
    pub fn validate(&self) -> Result<(), CalibrationError> {
        if self.version != CALIBRATION_VERSION {
            return Err(CalibrationError::Version { found: self.version });
        }
        for (field, found) in
            [("e_min", self.e_min), ("seconds", self.seconds), ("rate", self.rate), ("fps", self.fps)]
        {
            if !(found.is_finite() && found >= 0.0) {
                return Err(CalibrationError::Number {
                    field,
                    found,
                    wanted: "it must be finite and not below 0",
                });
            }
        }
        let mut last = self.e_min;
        for (index, &found) in self.energies.iter().enumerate() {
            if !(found.is_finite() && found >= last) {
                return Err(CalibrationError::Energy { index, found });
            }
            last = found;
        }
        if self.energies.len() as u64 > self.events {
            let found = self.events as f64;
            return Err(CalibrationError::Number {
                field: "events",
                found,
                wanted: "there are more energies",
            });
        }
        let wanted = self.digest();
        if self.conventions != wanted {
            return Err(CalibrationError::Conventions {
                found: self.conventions.chars().take(40).collect(),
                wanted,
            });
        }
        Ok(())
    }

    /// How an event was found otherwise than those of the calibration, where they cannot be told apart by their energies: on another
    /// mesh, at another frame rate, by another kind of curvature, or with a dead band that differs by more than a tenth (one that
    /// is measured on each take is never quite the same).
    #[must_use]
    pub fn differs(&self, event: &Crumple) -> Option<String> {
        let fps = frame_rate(event);
        if self.weight.is_some() && self.mesh != event.mesh {
            let (found, own) = (event.mesh, self.mesh);
            return Some(format!("`mesh` of the calibration is {own}, of the events {found}"));
        }
        // A millionth is all that whole ticks know.
        if self.fps > 0.0 && (self.fps - fps).abs() > 2e-4 {
            return Some(format!("`fps` of the calibration is {}, of the events {fps}", self.fps));
        }
        if let (Some(own), Some(found)) = (self.method, event.method)
            && own != found
        {
            return Some(format!("`method` of the calibration is {own:?}, of the events {found:?}"));
        }
        let (own, found) = (self.h_eps?, event.h_eps);
        ((own - found).abs() > 0.1 * own.max(found))
            .then(|| format!("`h_eps` of the calibration is {own}, of the events {found}"))
    }

    /// Refuses events whose energies are no match for these.
    ///
    /// # Errors
    /// Names the field that differs.
    pub fn accepts(&self, weight: Weight) -> Result<(), CalibrationError> {
        match self.weight {
            Some(calibrated) if calibrated != weight => {
                Err(CalibrationError::Weight { calibrated, found: weight })
            }
            _ => Ok(()),
        }
    }
}

impl Data for EnergyCalibration {
    const NAME: &'static str = "energy calibration";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let mut meter = EnergyMeter::default();
        for _ in 0..rng.below(50) {
            let event = <Crumple as crate::core::item::Event>::trial(rng);
            let interval: Tick = 11_760_000;
            meter.add(&Crumple { interval, weight: Weight::Area, ..event }).ok();
        }
        meter.finish(2.0, Floor::Percentile(rng.between(0.0, 90.0)))
    }

    /// Share of events against energy.
    fn plot(&self) -> Option<String> {
        let (low, high) = (self.energies.first()?.max(1e-300), self.energies.last()?.max(1e-300));
        let n = self.energies.len() as f64;
        let points = self.energies.iter().zip(1..).map(|(e, k)| [*e, f64::from(k) / n]).collect();
        let unit = if self.weight == Some(Weight::None) { "1/m²" } else { "m²" };
        let x = Axis { label: format!("energy, {unit}"), range: [0.9 * low, 1.1 * high], log: true };
        let y = Axis { label: "share of events".into(), range: [0.0, 1.0], log: false };
        let title = format!("{} events in {:.1} s", self.events, self.seconds);
        Some(chart(&title, &x, &y, &[Line { label: format!("from {:.3e}", self.e_min), points }]))
    }
}

/// Figures of a calibration for the report.
pub(super) fn calibration_summary(c: &EnergyCalibration) -> Summary {
    let mut told: Summary = vec![
        ("events", c.events.into()),
        ("dropped", c.dropped.into()),
        ("e_min", c.e_min.into()),
        ("events_per_second", c.rate.into()),
    ];
    let silent = match (c.events, c.dropped) {
        (0, 0) => Some(
            "the cloth never snaps, and what this calibrates is silent: is `h_eps` of BuckleDetector too high, or \
             `metres_per_unit` of the mesh not right?",
        ),
        (0, _) => Some("no event is strong enough: what this calibrates is silent"),
        _ => None,
    };
    told.extend(silent.map(|text| ("warning", text.into())));
    told
}

#[cfg(test)]
mod tests;
