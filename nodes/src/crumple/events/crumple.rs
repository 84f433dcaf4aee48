//! Crumples: the events of buckling cloth.

use serde::{Deserialize, Serialize};

use crate::choices;
use crate::core::item::Event;
use crate::core::random::Rng;
use crate::core::time::{Rate, Tick};
use crate::curvature::Method;

/// Weight of a vertex in the energy of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Weight {
    /// 1 per vertex, as in the paper: energies in 1/m^2, which increase with the resolution of the mesh.
    None,
    /// The area of the vertex: energies in m^2, about equal for all meshes of a cloth.
    #[default]
    Area,
}

choices! { @param Weight {
    /// 1 per vertex, as in the paper, with which its values of `e_min` can be used. Energies increase with the
    /// resolution of the mesh.
    None,
    /// The area of the vertex: energies are about equal for all meshes of a cloth.
    Area,
} }

/// An event: connected vertices that buckle together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Crumple {
    /// Lowest vertex; with the time it identifies the event.
    pub id: u32,
    /// 1 outwards, -1 inwards.
    pub sign: i8,
    /// Squared sum of the changes of mean curvature, weighted by `weight`.
    pub energy: f64,
    /// Weight of a vertex in `energy`.
    pub weight: Weight,
    /// Number of vertices.
    pub vertices: u32,
    /// Area, m^2.
    pub area: f32,
    /// Index of the material.
    pub material: u16,
    /// Centre, m.
    pub position: [f32; 3],
    /// Mean normal.
    pub normal: [f32; 3],
    /// Frame interval of the motion, in ticks.
    pub interval: Tick,
    /// Digest of the mesh.
    pub mesh: u32,
    /// Method of the curvature measurement, if it was measured.
    pub method: Option<Method>,
    /// Dead band of the curvature, 1/m.
    pub h_eps: f32,
}

impl Event for Crumple {
    const NAME: &'static str = "crumples";

    fn trial(rng: &mut Rng) -> Self {
        Self {
            id: rng.below(1000) as u32,
            sign: [-1, 1][rng.below(2)],
            energy: 10_f64.powf(rng.between(-8.0, 4.0)),
            weight: Weight::Area,
            vertices: 1 + rng.below(50) as u32,
            area: rng.between(0.0, 0.1) as f32,
            material: rng.below(3) as u16,
            position: [rng.uniform() as f32, rng.uniform() as f32, rng.uniform() as f32],
            normal: [0.0, 0.0, 1.0],
            interval: Rate::hz([24, 30, 60][rng.below(3)]).span(1),
            mesh: 7,
            method: Some(Method::Cotan),
            h_eps: 0.4,
        }
    }
}
