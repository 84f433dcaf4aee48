//! Curvatures, the items of streams between nodes.

use serde::{Deserialize, Serialize};

use crate::core::item::Item;
use crate::core::random::Rng;
use crate::mesh::{Mesh, MeshFormat};

/// Discretisation of mean curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Method {
    #[default]
    /// Cotangent Laplacian over mixed areas, projected on the normal.
    Cotan,
    /// Angles between the triangles at each edge, over mixed areas.
    Dihedral,
}

/// Curvature, area, normal and position of one vertex in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Curvature {
    /// Signed mean curvature, 1/m: above 0 where the surface is convex outwards.
    pub h: f64,
    /// Area of the vertex, m^2.
    pub area: f64,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Position, m.
    pub position: [f32; 3],
    /// False where the curvature is not defined: at a boundary, at a non-manifold vertex and at an isolated one.
    pub valid: bool,
    /// Measure of the curvature.
    pub method: Method,
}

/// The curvature of a moving mesh, frame by frame: one [`Curvature`] per vertex.
#[derive(Debug)]
pub struct Curvatures;

impl Item for Curvatures {
    type Elem = Curvature;
    type Format = MeshFormat;
    const NAME: &'static str = "curvature";
    const COLUMNS: &'static [&'static str] = &["h", "area", "nx", "ny", "nz", "x", "y", "z", "valid"];

    fn width(format: &MeshFormat) -> usize {
        Mesh::width(format)
    }

    fn describe(format: &MeshFormat) -> String {
        Mesh::describe(format)
    }

    fn trial_format(rng: &mut Rng) -> MeshFormat {
        Mesh::trial_format(rng)
    }

    fn trial(format: &MeshFormat, index: usize, rng: &mut Rng) -> Curvature {
        let h = if rng.below(6) == 0 { 0.0 } else { rng.between(-5.0, 5.0) };
        let position = Mesh::trial(format, index, rng);
        Curvature {
            h,
            area: rng.between(1e-5, 1e-3),
            normal: [0.0, 0.0, 1.0],
            position,
            valid: rng.below(8) > 0,
            method: Method::default(),
        }
    }

    fn finite(c: &Curvature) -> bool {
        let mut vectors = c.normal.into_iter().chain(c.position);
        c.h.is_finite() && c.area.is_finite() && vectors.all(f32::is_finite)
    }

    fn poison() -> Curvature {
        Curvature { h: f64::NAN, area: f64::NAN, valid: true, ..Curvature::default() }
    }

    fn numbers(c: &Curvature, out: &mut Vec<f32>) {
        let Curvature { h, area, normal: [nx, ny, nz], position: [x, y, z], valid, .. } = *c;
        out.extend([h as f32, area as f32, nx, ny, nz, x, y, z, f32::from(u8::from(valid))]);
    }
}
