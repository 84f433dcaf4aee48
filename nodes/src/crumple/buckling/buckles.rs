//! Buckling vertices as items of a stream.

use super::buckle::Buckle;
use crate::core::item::Item;
use crate::core::random::Rng;
use crate::curvature::Method;
use crate::mesh::{Mesh, MeshFormat};

/// The buckling of each vertex of a cloth, frame by frame.
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

    fn trial(format: &MeshFormat, index: usize, rng: &mut Rng) -> Buckle {
        let label = [-1, 0, 0, 1][rng.below(4)];
        Buckle {
            label,
            delta: f64::from(label) * rng.between(0.1, 5.0),
            area: rng.between(1e-5, 1e-3),
            normal: [0.0, 0.0, 1.0],
            position: Mesh::trial(format, index, rng),
            h_eps: 0.0,
            method: Method::default(),
        }
    }

    fn finite(b: &Buckle) -> bool {
        let coordinates = b.normal.into_iter().chain(b.position);
        b.delta.is_finite() && b.area.is_finite() && coordinates.into_iter().all(f32::is_finite)
    }

    fn poison() -> Buckle {
        Buckle { label: 1, delta: f64::NAN, area: f64::NAN, ..Buckle::default() }
    }

    fn numbers(b: &Buckle, out: &mut Vec<f32>) {
        let Buckle { label, delta, area, normal: [nx, ny, nz], position: [x, y, z], .. } = *b;
        out.extend([f32::from(label), delta as f32, area as f32, nx, ny, nz, x, y, z]);
    }
}
