//! Calibration: the distribution of the energies of a whole take, and the energy below which events are dropped.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::histogram::hazen;
use crate::core::content::{altered_content, content_digest};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::core::time::{TICKS_PER_SECOND, Tick};
use crate::crumple::buckling::buckle::frames_of_change;
use crate::crumple::events::{Crumple, Weight};
use crate::curvature::Method;
use crate::impl_state;
use crate::plot::{Axis, Line, chart};

/// Version of the format of [`EnergyCalibration`].
pub const CALIBRATION_VERSION: u32 = 1;
/// Maximum number of energies that are stored; of more energies, quantiles are stored.
const MAX_ENERGIES: usize = 4096;
/// Number of stored quantiles.
const QUANTILES: usize = 1024;

/// Rule for the energy below which events are dropped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Floor {
    /// This energy.
    Absolute(f64),
    /// Percentile of all events.
    Percentile(f64),
    /// The energy above which there is this number of events per second.
    Rate(f64),
}

/// Energies of the events of a take, for matching with those of a bank.
///
/// The floor depends on mesh and motion: three takes of one jacket in the paper have floors of 98902, 172875 and
/// 906402. It is therefore measured, and stored with the properties of the events.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnergyCalibration {
    /// [`CALIBRATION_VERSION`].
    pub version: u32,
    /// Weight of a vertex in energies; unknown without events.
    pub weight: Option<Weight>,
    /// Energy below which events are dropped.
    pub e_min: f64,
    /// Rule for `e_min`.
    pub floor: Floor,
    /// Sorted energies from `e_min`; 1024 quantiles if there are more than 4096.
    pub energies: Vec<f64>,
    /// Number of events from `e_min`.
    pub events: u64,
    /// Number of events below `e_min`.
    pub dropped: u64,
    /// Length of the take, s.
    pub seconds: f64,
    /// Events from `e_min` per second.
    pub rate: f64,
    /// Frames per second of the motion; 0 without events.
    pub fps: f64,
    /// Digest of the mesh; 0 without events.
    pub mesh: u32,
    /// Method of the curvature measurement; unknown without events or measurement, and in older files.
    #[serde(default)]
    pub method: Option<Method>,
    /// Dead band of the curvature, 1/m; unknown without events and in older files.
    #[serde(default)]
    pub h_eps: Option<f32>,
    /// Digest of version, weight, floor, frames per second, mesh, method and dead band.
    pub conventions: String,
    /// Digest of all other fields, which detects changes by hand; empty if none was written.
    #[serde(default)]
    pub content: String,
}

/// Reasons why a calibration cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// Another version of the format.
    #[error("`version` is {found}; {CALIBRATION_VERSION} is needed: measure the calibration again")]
    Version {
        /// Version found.
        found: u32,
    },
    /// A number out of range.
    #[error("`{field}` is {found}; {wanted}")]
    Number {
        /// Name of the field.
        field: &'static str,
        /// Value found.
        found: f64,
        /// Values that it can have.
        wanted: &'static str,
    },
    /// An energy out of order or range.
    #[error("energy {index} is {found}; energies are finite, at least `e_min` and sorted")]
    Energy {
        /// Index of the energy.
        index: usize,
        /// Value found.
        found: f64,
    },
    /// Fields that were changed by hand.
    #[error("`conventions` is {found}, its fields give {wanted}: they were changed after the measurement")]
    Conventions {
        /// Digest in the file.
        found: String,
        /// Digest of the fields.
        wanted: String,
    },
    /// Events with another weight.
    #[error(
        "`weight` of the calibration is {calibrated:?}, of the events {found:?}: measure the calibration on events of the same `weight`"
    )]
    Weight {
        /// Weight in the calibration.
        calibrated: Weight,
        /// Weight in the events.
        found: Weight,
    },
}

/// Returns the frames per second of the motion of an event, rounded to 1e-4 because intervals are whole ticks.
fn frame_rate(event: &Crumple) -> f64 {
    (TICKS_PER_SECOND as f64 / (event.interval.max(1) as f64) * 1e4).round() / 1e4
}

/// Interval over which changes of curvature are measured at a frame rate, s.
fn change_interval(fps: f64) -> f64 {
    frames_of_change(fps) as f64 / fps
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
    /// When the weight of the event differs from that of the first.
    pub fn add(&mut self, event: &Crumple) -> Result<(), CalibrationError> {
        let first = self.first.get_or_insert(*event);
        if first.weight != event.weight {
            return Err(CalibrationError::Weight { calibrated: first.weight, found: event.weight });
        }
        self.energies.push(event.energy);
        Ok(())
    }

    /// Returns the calibration of a take of `seconds`.
    ///
    /// # Complexity
    /// O(n log n) for n events.
    #[must_use]
    pub fn finish(mut self, seconds: f64, floor: Floor) -> EnergyCalibration {
        self.energies.sort_unstable_by(f64::total_cmp);
        let total = self.energies.len();
        let e_min = match floor {
            Floor::Absolute(e) => e,
            Floor::Percentile(p) => hazen(&self.energies, 0.01 * p),
            Floor::Rate(rate) => {
                let wanted = (rate * seconds).round().max(1.0) as usize;
                if wanted < total { self.energies[total - wanted] } else { 0.0 }
            }
        };
        let dropped = self.energies.partition_point(|e| *e < e_min);
        let audible = self.energies.split_off(dropped);
        let events = audible.len() as u64;
        let quantile = |k: usize| hazen(&audible, (k as f64 + 0.5) / QUANTILES as f64);
        let energies =
            if audible.len() > MAX_ENERGIES { (0..QUANTILES).map(quantile).collect() } else { audible };
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
    /// Returns the digest for `conventions`.
    fn digest(&self) -> String {
        let mut text =
            format!("{} {:?} {:?} {} {}", self.version, self.weight, self.floor, self.fps, self.mesh);
        // Older files have neither field, and their digest is without them.
        if self.method.is_some() || self.h_eps.is_some() {
            text += &format!(" {:?} {:?}", self.method, self.h_eps);
        }
        blake3::hash(text.as_bytes()).to_hex()[..16].to_owned()
    }

    /// Returns the digest for `content`.
    fn content(&self) -> String {
        let plain = Self { content: String::new(), ..self.clone() };
        content_digest(&plain, &["\"method\":null,", "\"h_eps\":null,"])
    }

    /// Returns the calibration with the digests of its content.
    pub(super) fn sealed(mut self) -> Self {
        self.conventions = self.digest();
        self.content = self.content();
        self
    }

    /// Returns an error message if the calibration differs from its content digest.
    #[must_use]
    pub fn altered(&self) -> Option<String> {
        altered_content(&self.content, &self.content(), "measure it")
    }

    /// Checks all fields.
    ///
    /// # Errors
    /// Names the first wrong field.
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
                    wanted: "it must be finite and not negative",
                });
            }
        }
        let mut previous = self.e_min;
        for (index, &found) in self.energies.iter().enumerate() {
            if !(found.is_finite() && found >= previous) {
                return Err(CalibrationError::Energy { index, found });
            }
            previous = found;
        }
        if self.energies.len() as u64 > self.events {
            let found = self.events as f64;
            return Err(CalibrationError::Number {
                field: "events",
                found,
                wanted: "it must be at least the number of `energies`",
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

    /// Returns a message if an event differs from those of the calibration in mesh, curvature method, dead band or in the interval
    /// over which its change of curvature was measured, which follows from the frame rate. Dead bands may differ by a tenth, because they can be measured on each take.
    #[must_use]
    pub fn mismatch(&self, event: &Crumple) -> Option<String> {
        let fps = frame_rate(event);
        if self.weight.is_some() && self.mesh != event.mesh {
            let (found, calibrated) = (event.mesh, self.mesh);
            return Some(format!("`mesh` of the calibration is {calibrated}, of the events {found}"));
        }
        // Whole ticks resolve the frame rate to about a millionth.
        if self.fps > 0.0 && (change_interval(self.fps) / change_interval(fps) - 1.0).abs() > 1e-5 {
            return Some(format!("`fps` of the calibration is {}, of the events {fps}", self.fps));
        }
        if let (Some(calibrated), Some(found)) = (self.method, event.method)
            && calibrated != found
        {
            return Some(format!("`method` of the calibration is {calibrated:?}, of the events {found:?}"));
        }
        let (calibrated, found) = (self.h_eps?, event.h_eps);
        ((calibrated - found).abs() > 0.1 * calibrated.max(found))
            .then(|| format!("`h_eps` of the calibration is {calibrated}, of the events {found}"))
    }

    /// Checks that the weight of events equals that of the calibration.
    ///
    /// # Errors
    /// [`CalibrationError::Weight`] if it differs.
    pub fn check_weight(&self, weight: Weight) -> Result<(), CalibrationError> {
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

    /// Draws the fraction of events against energy.
    fn plot(&self) -> Option<String> {
        let (low, high) = (self.energies.first()?.max(1e-300), self.energies.last()?.max(1e-300));
        let n = self.energies.len() as f64;
        let points = self.energies.iter().zip(1..).map(|(e, k)| [*e, f64::from(k) / n]).collect();
        let unit = if self.weight == Some(Weight::None) { "1/m²" } else { "m²" };
        let x = Axis { label: format!("energy, {unit}"), range: [0.9 * low, 1.1 * high], log: true };
        let y = Axis { label: "share of events".into(), range: [0.0, 1.0], log: false };
        let title = format!("{} events in {:.1} s", self.events, self.seconds);
        Some(chart(&title, &x, &y, &[Line::new(format!("from {:.3e}", self.e_min), points)]))
    }
}

/// Summary of a calibration for the report.
pub(super) fn calibration_summary(c: &EnergyCalibration) -> Summary {
    let mut summary: Summary = vec![
        ("events", c.events.into()),
        ("dropped", c.dropped.into()),
        ("e_min", c.e_min.into()),
        ("events_per_second", c.rate.into()),
    ];
    let silent = match (c.events, c.dropped) {
        (0, 0) => Some(
            "the cloth never snaps, so its sound is silent: `h_eps` of BuckleDetector may be too high, or \
             `metres_per_unit` of the mesh wrong",
        ),
        (0, _) => Some("all events are below `e_min`, so the sound is silent"),
        _ => None,
    };
    summary.extend(silent.map(|text| ("warning", text.into())));
    summary
}

#[cfg(test)]
mod tests;
