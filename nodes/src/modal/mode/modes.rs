//! The modes of an object: frequencies, dampings, gains and phases.

use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::modal::residual::noise_band::{MAX_BANDS, NoiseBand};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Version of the format of [`Modes`].
pub const MODES_VERSION: u32 = 1;

/// Maximum number of modes of an object.
pub const MAX_MODES: usize = 1 << 20;

/// Frequencies, dampings and gains of the modes of one object.
///
/// The response to a unit impulse at contact point `p` is
/// `sum_i gains[p, i] exp(-dampings[i] t) sin(2 pi frequencies[i] t + phases[i])`, which does not depend on a sample rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Modes {
    /// [`MODES_VERSION`].
    pub version: u32,
    /// Name of the object.
    #[serde(default)]
    pub name: String,
    /// Frequencies in hertz, `[modes]`, above 0.
    pub frequencies: Vec<f64>,
    /// Decay rates of the amplitudes in 1/s, `[modes]`, above 0; a decay by 60 dB takes `6.908 / damping` seconds.
    pub dampings: Vec<f64>,
    /// Full scale per N s, `[points * modes]`, one row per contact point.
    pub gains: Vec<f32>,
    /// Phases in radians, `[modes]`; empty for sines, which start at 0.
    #[serde(default)]
    pub phases: Vec<f32>,
    /// Residual of the modes: noise in bands, at all contact points; empty if there is none.
    #[serde(default)]
    pub noise: Vec<NoiseBand>,
}

/// Error in modes.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModesError {
    /// Another version of the format.
    #[error("modes have version {found}; this reads version {MODES_VERSION}")]
    Version {
        /// The version found.
        found: u32,
    },
    /// No modes, or more than [`MAX_MODES`].
    #[error("{found} modes; 1 to {MAX_MODES} are needed")]
    Count {
        /// The number found.
        found: usize,
    },
    /// A field of the wrong length.
    #[error("`{field}` holds {found} values; {expected} are needed")]
    Length {
        /// Name of the field.
        field: &'static str,
        /// Values found.
        found: usize,
        /// The required length.
        expected: String,
    },
    /// A value out of range.
    #[error("`{field}` of mode {mode} is {found}; it must be finite{above}")]
    Value {
        /// Name of the field.
        field: &'static str,
        /// Index of the mode, from 0.
        mode: usize,
        /// The value.
        found: f64,
        /// The further condition.
        above: &'static str,
    },
    /// A value of a band of noise out of range.
    #[error("`{field}` of noise band {band} is {found}; it must be finite{above}")]
    Noise {
        /// Name of the field.
        field: &'static str,
        /// Index of the band, from 0.
        band: usize,
        /// The value.
        found: f64,
        /// The further condition.
        above: &'static str,
    },
}

impl Modes {
    /// Modes with one contact point, as sines.
    ///
    /// # Errors
    /// As [`validate`](Self::validate).
    pub fn new(
        name: impl Into<String>,
        frequencies: Vec<f64>,
        dampings: Vec<f64>,
        gains: Vec<f32>,
    ) -> Result<Self, ModesError> {
        let (version, phases, noise) = (MODES_VERSION, Vec::new(), Vec::new());
        let modes = Self { version, name: name.into(), frequencies, dampings, gains, phases, noise };
        modes.validate()?;
        Ok(modes)
    }

    /// Number of modes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.frequencies.len()
    }

    /// Returns true if there are no modes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.frequencies.is_empty()
    }

    /// Number of contact points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.gains.len() / self.len().max(1)
    }

    /// Gains at a contact point, `[modes]`; empty if the point does not exist.
    #[must_use]
    pub fn row(&self, point: usize) -> &[f32] {
        self.gains.chunks_exact(self.len().max(1)).nth(point).unwrap_or_default()
    }

    /// Checks the invariants that a [`Bank`](crate::modal::Bank) requires.
    ///
    /// # Errors
    /// The first field that is wrong, its value and the required one.
    pub fn validate(&self) -> Result<(), ModesError> {
        if self.version != MODES_VERSION {
            return Err(ModesError::Version { found: self.version });
        }
        let n = self.len();
        if !(1..=MAX_MODES).contains(&n) {
            return Err(ModesError::Count { found: n });
        }
        let length = |field, found: usize, fits: bool, expected: String| {
            if fits { Ok(()) } else { Err(ModesError::Length { field, found, expected }) }
        };
        length("dampings", self.dampings.len(), self.dampings.len() == n, n.to_string())?;
        let rows = !self.gains.is_empty() && self.gains.len().is_multiple_of(n);
        length("gains", self.gains.len(), rows, format!("{n} for each contact point"))?;
        let phases = self.phases.is_empty() || self.phases.len() == n;
        length("phases", self.phases.len(), phases, format!("none or {n}"))?;
        let value = |field, found: f64, mode, good: bool, above| {
            if good { Ok(()) } else { Err(ModesError::Value { field, mode, found, above }) }
        };
        for (i, (&f, &d)) in self.frequencies.iter().zip(&self.dampings).enumerate() {
            value("frequencies", f, i, f.is_finite() && f > 0.0, " and above 0 Hz")?;
            value(
                "dampings",
                d,
                i,
                d.is_finite() && d > 0.0,
                " and above 0 1/s, or the mode would never decay",
            )?;
        }
        for (i, &g) in self.gains.iter().enumerate() {
            value("gains", g.into(), i % n, g.is_finite(), "")?;
        }
        for (i, &p) in self.phases.iter().enumerate() {
            value("phases", p.into(), i, p.is_finite(), "")?;
        }
        let bands = self.noise.len();
        length("noise", bands, bands <= MAX_BANDS, format!("at most {MAX_BANDS} bands"))?;
        for (band, noise) in self.noise.iter().enumerate() {
            if let Some((field, found, above)) = noise.fault() {
                return Err(ModesError::Noise { field, band, found, above });
            }
        }
        Ok(())
    }

    /// Time in s in which the slowest mode decays by 60 dB.
    #[must_use]
    pub fn ring_time(&self) -> f64 {
        let slowest = self.dampings.iter().copied().fold(f64::INFINITY, f64::min);
        if slowest.is_finite() && slowest > 0.0 { 1000.0_f64.ln() / slowest } else { 0.0 }
    }
}

impl Modes {
    /// Figures of the modes for the report of a run.
    pub(in crate::modal) fn summary(&self) -> Summary {
        let lowest = self.frequencies.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = self.frequencies.iter().copied().fold(0.0, f64::max);
        vec![
            ("modes", self.len().into()),
            ("contact_points", self.points().into()),
            ("lowest_hz", lowest.into()),
            ("highest_hz", highest.into()),
            ("ring_time_s", self.ring_time().into()),
        ]
    }
}

impl Data for Modes {
    const NAME: &'static str = "modes";

    fn trial(rng: &mut Rng) -> Self {
        let n = 1 + rng.below(40);
        let mut each = |low: f64, high: f64, n: usize| -> Vec<f64> {
            (0..n).map(|_| rng.between(low.ln(), high.ln()).exp()).collect()
        };
        let (frequencies, dampings) = (each(1.0, 600.0, n), each(3.0, 300.0, n));
        let points = 1 + rng.below(3);
        let gains = (0..n * points).map(|_| rng.between(-1.0, 1.0) as f32).collect();
        let phases = (0..n * rng.below(2)).map(|_| rng.between(-3.0, 3.0) as f32).collect();
        let bands = rng.below(4);
        let mut band = |k: usize| {
            let (low, damping, gain) =
                (100.0 * (k + 1) as f64, rng.between(5.0, 300.0), rng.between(0.0, 0.5) as f32);
            NoiseBand { low, high: 1.3 * low, damping, gain }
        };
        let noise = (0..bands).map(&mut band).collect();
        Self { version: MODES_VERSION, name: "trial".into(), frequencies, dampings, gains, phases, noise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modes() -> Modes {
        Modes::new("bar", vec![100.0, 270.0], vec![5.0, 9.0], vec![1.0, 0.5, 0.25, -0.5]).unwrap()
    }

    #[test]
    fn rows_of_gains_are_contact_points() {
        let m = modes();
        assert_eq!((m.len(), m.points()), (2, 2));
        assert_eq!((m.row(1), m.row(2)), (&[0.25, -0.5][..], &[][..]));
        assert!((m.ring_time() - 6.907_755 / 5.0).abs() < 1e-6);
    }

    #[test]
    fn modes_survive_serialisation() {
        let m = modes();
        let bytes = postcard::to_allocvec(&m).unwrap();
        assert_eq!(postcard::from_bytes::<Modes>(&bytes).unwrap(), m);
        let json = serde_json::to_string(&m).unwrap();
        assert_eq!(serde_json::from_str::<Modes>(&json).unwrap(), m);
    }

    #[test]
    fn errors_name_the_field_and_the_mode() {
        let m = Modes { dampings: vec![5.0, 0.0], ..modes() };
        let text = m.validate().unwrap_err().to_string();
        assert!(text.contains("`dampings` of mode 1 is 0"), "{text}");
        let m = Modes { gains: vec![1.0; 3], ..modes() };
        assert!(m.validate().unwrap_err().to_string().contains("2 for each contact point"));
        let m = Modes { frequencies: vec![f64::NAN, 1.0], ..modes() };
        assert!(matches!(m.validate(), Err(ModesError::Value { field: "frequencies", mode: 0, .. })));
        let band = NoiseBand { low: 100.0, high: 90.0, damping: 5.0, gain: 1.0 };
        let m = Modes { noise: vec![band], ..modes() };
        let text = m.validate().unwrap_err().to_string();
        assert!(text.contains("`high` of noise band 0 is 90"), "{text}");
        assert!(
            Modes { noise: vec![band; 33], ..modes() }
                .validate()
                .unwrap_err()
                .to_string()
                .contains("at most 32")
        );
        let m = Modes { version: 7, ..modes() };
        assert_eq!(m.validate(), Err(ModesError::Version { found: 7 }));
        assert!(Modes::new("none", vec![], vec![], vec![]).is_err());
    }
}
