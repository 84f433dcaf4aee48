//! A material: its damping, its elastic constants and their provenance.

use crate::core::node::Summary;
use crate::material::damping::DampingModel;
use crate::material::estimation::report::REPORTED_HZ;
use serde::{Deserialize, Serialize};

/// Format of a material that this code reads and writes.
pub const MATERIAL_VERSION: u32 = 1;

/// Elastic constants and density.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Elastic {
    /// Young's modulus, Pa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Density, kg/m^3.
    pub density: f64,
    /// Provenance of these.
    pub source: String,
}

/// A 95 % interval of a parameter of the damping, in the unit of the parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// Name of the parameter.
    pub parameter: String,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The fit that a damping comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitOrigin {
    /// Name of the estimator.
    pub estimator: String,
    /// Number of points.
    pub points: u32,
    /// Number of recordings.
    pub recordings: u32,
    /// Standard deviation of the noise, 1/s.
    pub noise: f64,
    /// Mean damping by the supports, 1/s.
    pub support: f64,
}

/// A material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Damping `c` of its modes.
    pub damping: DampingModel,
    /// Elastic constants, if they are known.
    pub elastic: Option<Elastic>,
    /// Intervals of the parameters of the damping.
    pub uncertainty: Vec<Uncertainty>,
    /// The fit, if it is from one.
    pub fit: Option<FitOrigin>,
    /// Provenance of the damping.
    pub source: String,
    /// Licence of the file.
    pub licence: String,
}

impl Material {
    /// A material of a damping alone.
    #[must_use]
    pub fn new(name: impl Into<String>, damping: DampingModel) -> Self {
        Self {
            name: name.into(),
            damping,
            elastic: None,
            uncertainty: Vec::new(),
            fit: None,
            source: String::new(),
            licence: String::new(),
        }
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let t60: Vec<f64> =
            REPORTED_HZ.iter().map(|f| libm::log(1000.0) / self.damping.decay(*f).max(1e-12)).collect();
        vec![
            ("material", self.name.as_str().into()),
            ("t60_s_at_100_300_1k_3k_10k_hz", serde_json::json!(t60)),
        ]
    }
}
