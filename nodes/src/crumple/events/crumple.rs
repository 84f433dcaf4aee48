//! Crumples: the events of buckling cloth.

use serde::{Deserialize, Serialize};

use crate::choices;
use crate::core::item::Event;
use crate::core::random::Rng;
use crate::core::time::{Rate, Tick};
use crate::curvature::Method;

/// What the energy of an event is a sum over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Weight {
    /// Vertices: the paper's sum, in 1/m^2, which grows with the density of the mesh.
    None,
    /// Area, in m^2: about the same for every mesh of the same cloth.
    #[default]
    Area,
}

choices! { @param Weight {
    /// Vertices: the paper's sum, which grows with the density of the mesh; its values of `e_min` belong to it.
    None,
    /// Area: about the same for every mesh of one cloth.
    Area,
} }

/// One place of a cloth that snaps: connected vertices that change side together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Crumple {
    /// The lowest of its vertices: with the time, its identity.
    pub id: u32,
    /// 1 where it snaps outwards, -1 inwards.
    pub sign: i8,
    /// Squared sum of the changes of mean curvature, weighted as `weight` says.
    pub energy: f64,
    /// What `energy` is a sum over.
    pub weight: Weight,
    /// Vertices in it.
    pub vertices: u32,
    /// Area of it, m^2.
    pub area: f32,
    /// Number of its material.
    pub material: u16,
    /// Its centre, m.
    pub position: [f32; 3],
    /// Its mean normal.
    pub normal: [f32; 3],
    /// Ticks from one frame of the motion to the next.
    pub interval: Tick,
    /// Digest of the mesh that it comes from.
    pub mesh: u32,
    /// How curvature was measured, where it was.
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
