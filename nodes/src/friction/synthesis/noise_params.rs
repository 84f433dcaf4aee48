//! Parameters of friction noise.

use serde::{Deserialize, Serialize};

use super::window::Window;
use crate::choices;
use crate::friction::model::Gain;

/// Magnitude of a bin around its expected value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Magnitude {
    /// Always the expected value.
    #[default]
    Fixed,
    /// Rayleigh distributed, as in Gaussian noise.
    Rayleigh,
}

choices! { @param Magnitude {
    /// Every bin has the magnitude that the model says, as in the paper.
    Fixed,
    /// Magnitudes are Rayleigh distributed around it, as in Gaussian noise.
    Rayleigh,
} }

/// How vertices become sound sources.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Emitters {
    /// Vertices in one cell of a grid share phases; without positions all vertices do.
    Clustered {
        /// Largest number of clusters.
        max: usize,
        /// Edge of a cell, in metres.
        cell: f32,
    },
    /// Every vertex has phases of its own: the reference, and slow.
    PerVertex,
}

impl Default for Emitters {
    fn default() -> Self {
        Self::Clustered { max: 64, cell: 0.1 }
    }
}

choices! {
    /// How vertices become sound sources.
    pub enum EmitterKind {
        /// The powers of vertices that are heard from one place are added before phases are drawn: one transform per clip. For
        /// `IftNoise`, which knows no places, that is all of them.
        Clustered,
        /// Every vertex has phases of its own: the reference, and slow.
        PerVertex,
    }
}

/// How loud a vertex is for the area that it stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum AreaWeight {
    /// Power in proportion to area, so that a finer mesh is not louder.
    #[default]
    Sqrt,
    /// Every vertex alike.
    None,
}

choices! { @param AreaWeight {
    /// Power in proportion to the area of cloth that a vertex stands for, so that a finer mesh is not louder.
    Sqrt,
    /// Every vertex alike, as in the paper: four times the vertices are 6 dB louder.
    None,
} }

/// Parameters of [`IftNoise`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IftNoiseParams {
    /// Length of a clip in seconds, rounded to an even number of samples.
    pub clip: f64,
    /// Cross-fade between clips.
    pub window: Window,
    /// Magnitude of a bin around its expected value.
    pub magnitude: Magnitude,
    /// How vertices become sound sources.
    pub emitters: Emitters,
    /// How loud a vertex is for its area.
    pub area_weight: AreaWeight,
    /// Level of spectra between measured speeds.
    pub gain: Gain,
}

impl Default for IftNoiseParams {
    fn default() -> Self {
        Self {
            clip: 0.050,
            window: Window::default(),
            magnitude: Magnitude::default(),
            emitters: Emitters::default(),
            area_weight: AreaWeight::default(),
            gain: Gain::default(),
        }
    }
}
