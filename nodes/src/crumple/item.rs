//! What travels between the nodes of crumpling.

use serde::{Deserialize, Serialize};

use super::buckle::Buckle;
use crate::core::item::{Event, Item};
use crate::core::random::Rng;
use crate::core::time::{Rate, Tick};
use crate::curvature::Method;
use crate::mesh::{Mesh, MeshFormat};

/// The vertices of a cloth that snap from one side to the other, frame by frame.
#[derive(Debug)]
pub struct Buckles;

impl Item for Buckles {
    type Elem = Buckle;
    type Format = MeshFormat;
    const NAME: &'static str = "buckles";
    const COLUMNS: &'static [&'static str] = &["label", "delta", "area", "nx", "ny", "nz", "x", "y", "z"];

    fn width(format: &MeshFormat) -> usize {
        Mesh::width(format)
    }

    fn describe(format: &MeshFormat) -> String {
        Mesh::describe(format)
    }

    fn trial_format(rng: &mut Rng) -> MeshFormat {
        Mesh::trial_format(rng)
    }

    fn trial(format: &MeshFormat, place: usize, rng: &mut Rng) -> Buckle {
        let label = [-1, 0, 0, 1][rng.below(4)];
        Buckle {
            label,
            delta: f64::from(label) * rng.between(0.1, 5.0),
            area: rng.between(1e-5, 1e-3),
            normal: [0.0, 0.0, 1.0],
            position: Mesh::trial(format, place, rng),
            h_eps: 0.0,
            method: Method::default(),
        }
    }

    fn finite(b: &Buckle) -> bool {
        let places = b.normal.into_iter().chain(b.position);
        b.delta.is_finite() && b.area.is_finite() && places.into_iter().all(f32::is_finite)
    }

    fn poison() -> Buckle {
        Buckle { label: 1, delta: f64::NAN, area: f64::NAN, ..Buckle::default() }
    }

    fn numbers(b: &Buckle, out: &mut Vec<f32>) {
        let Buckle { label, delta, area, normal: [nx, ny, nz], position: [x, y, z], .. } = *b;
        out.extend([f32::from(label), delta as f32, area as f32, nx, ny, nz, x, y, z]);
    }
}

/// What the energy of an event is a sum over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Weight {
    /// Vertices: the paper's sum, in 1/m^2, which grows with the density of the mesh.
    None,
    /// Area, in m^2: about the same for every mesh of the same cloth.
    #[default]
    Area,
}

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

/// A crumple and the recorded sample that is to sound for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchedCrumple {
    /// The lowest vertex of the crumple: with the time, its identity.
    pub id: u32,
    /// Number of the sample in the bank, quietest first.
    pub sample: u32,
    /// Energy that the sample should have, full scale^2 times samples.
    pub wanted: f64,
    /// Digest of the bank that `sample` counts in.
    pub bank: u32,
    /// Energy of the crumple.
    pub energy: f64,
    /// 1 where it snaps outwards, -1 inwards.
    pub sign: i8,
    /// Number of its material.
    pub material: u16,
    /// Its centre, m.
    pub position: [f32; 3],
    /// Its mean normal.
    pub normal: [f32; 3],
    /// Ticks from one frame of the motion to the next.
    pub interval: Tick,
}

impl Event for MatchedCrumple {
    const NAME: &'static str = "matched crumples";

    fn trial(rng: &mut Rng) -> Self {
        let crumple = Crumple::trial(rng);
        Self::new(&crumple, rng.below(3) as u32, rng.between(0.001, 10.0), super::bank::trial_bank().id())
    }
}

impl MatchedCrumple {
    /// A crumple for which a sample of a bank is to sound.
    #[must_use]
    pub fn new(crumple: &Crumple, sample: u32, wanted: f64, bank: u32) -> Self {
        let Crumple { id, energy, sign, material, position, normal, interval, .. } = *crumple;
        Self { id, sample, wanted, bank, energy, sign, material, position, normal, interval }
    }
}
