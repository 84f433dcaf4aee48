//! Parameters of inverse Fourier transform noise.

use serde::{Deserialize, Serialize};

use super::clip_timing::MotionAt;
use super::window::Window;
use crate::friction::model::Gain;
use crate::{choices, params};

/// Magnitude of a bin around its expected value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Magnitude {
    /// The expected value.
    Fixed,
    /// Rayleigh distributed, as in Gaussian noise.
    Rayleigh,
}

choices! { @param Magnitude {
    /// Every bin has the magnitude of the model, as in the paper.
    Fixed,
    /// Magnitudes are Rayleigh distributed around that of the model, as in Gaussian noise.
    Rayleigh,
} }

/// Grouping of vertices into sound sources.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Emitters {
    /// Vertices in one cell of a grid share phases. Without positions all vertices share phases.
    Clustered {
        /// Maximum number of clusters.
        max: usize,
        /// Edge length of a cell, in metres.
        cell: f32,
    },
    /// Every vertex has phases of its own: the slow reference.
    PerVertex,
}

impl Emitters {
    /// Magnitude with which the noise is as lively as the sum of its vertices: many independent phases add up to Rayleigh
    /// distributed magnitudes (central limit theorem), which one draw of phases for a cluster lacks.
    #[must_use]
    pub fn magnitude(self) -> Magnitude {
        match self {
            Self::Clustered { .. } => Magnitude::Rayleigh,
            Self::PerVertex => Magnitude::Fixed,
        }
    }
}

impl Default for Emitters {
    fn default() -> Self {
        Self::Clustered { max: 64, cell: 0.1 }
    }
}

choices! {
    /// Grouping of vertices into sound sources.
    pub enum EmitterKind {
        /// The powers of the vertices of a cluster are added before phases are drawn: one transform per clip. For
        /// `IftNoise`, which has no positions, all vertices are one cluster.
        Clustered,
        /// Every vertex has phases of its own: the slow reference.
        PerVertex,
    }
}

/// Level of a vertex as a function of its area.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum AreaWeight {
    /// Power in proportion to area: the level does not depend on the resolution of the mesh.
    #[default]
    Sqrt,
    /// Independent of area.
    None,
}

choices! { @param AreaWeight {
    /// Power in proportion to the area of a vertex: the level does not depend on the resolution of the mesh.
    Sqrt,
    /// Independent of area, as in the paper: four times the vertices are 6 dB louder.
    None,
} }

/// Parameters of [`IftNoise`](super::IftNoise).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct IftNoiseParams {
    /// Length of a clip in seconds, rounded to an even number of samples.
    pub clip: f64,
    /// Crossfade between clips.
    pub window: Window,
    /// Magnitude of a bin around its expected value; `None`: [`Emitters::magnitude`].
    pub magnitude: Option<Magnitude>,
    /// Grouping of vertices into sound sources.
    pub emitters: Emitters,
    /// Level of a vertex as a function of its area.
    pub area_weight: AreaWeight,
    /// Level of spectra between measured speeds.
    pub gain: Gain,
}

impl Default for IftNoiseParams {
    fn default() -> Self {
        Self {
            clip: 0.050,
            window: Window::default(),
            magnitude: None,
            emitters: Emitters::default(),
            area_weight: AreaWeight::default(),
            gain: Gain::default(),
        }
    }
}

params! {
    /// Clips of the noise.
    pub struct ClipParams {
        /// Crossfade between clips.
        window: Window = Window::SqrtTriangle;
        /// Magnitude of a bin around its expected value; None: `Rayleigh` for `Clustered`, because the sum of many vertices is
        /// Gaussian noise, and `Fixed` for `PerVertex`.
        magnitude: Option<Magnitude> = None;
        /// Grouping of vertices into sound sources.
        emitters: EmitterKind = EmitterKind::Clustered;
    }
}

params! {
    /// Level of the noise of each vertex.
    pub struct VertexLevelParams {
        /// Time within a clip at which all inputs are sampled.
        motion_at: MotionAt = MotionAt::Centre;
        /// Level of a vertex as a function of its area.
        area_weight: AreaWeight = AreaWeight::Sqrt;
        /// Level of spectra between measured speeds.
        gain: Gain = Gain::Rms;
        /// Factor on the output. Changes while the graph runs are linear ramps of 10 ms.
        level: f32 = 1.0, unit "", range 0.0..=1000.0;
    }
}
