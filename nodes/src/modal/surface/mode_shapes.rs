//! Shapes of the modes of an object on its surface.

use super::contact::Contact;
use super::surface_view::SurfaceView;
use crate::core::fault::Reject;
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::modal::mode::modes::{MAX_MODES, Modes};
use serde::{Deserialize, Serialize};

/// The shapes of the modes of one object, in the order of its [`Modes`].
///
/// An impulse `J` in N s at a point of the surface excites mode `i` by `gains[i] (phi_i . J)`, in full scale; the displacement `phi_i` there
/// is interpolated between the corners of the triangle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeShapes {
    /// Positions of the vertices, m.
    pub vertices: Vec<[f64; 3]>,
    /// Triangles over the vertices, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Outward unit normals at the vertices.
    pub normals: Vec<[f64; 3]>,
    /// Displacements, `[vertices][3][modes]`, kg^(-1/2).
    pub shapes: Vec<f32>,
    /// Full scale per modal impulse, `[modes]`, in kg^(1/2) / (N s).
    pub gains: Vec<f32>,
}

impl ModeShapes {
    /// Number of modes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.gains.len()
    }

    /// Returns true if there are no modes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.gains.is_empty()
    }

    /// The surface with its shapes.
    #[must_use]
    pub fn surface(&self) -> SurfaceView<'_> {
        SurfaceView {
            vertices: &self.vertices,
            triangles: &self.triangles,
            normals: &self.normals,
            shapes: &self.shapes,
            modes: self.len(),
        }
    }

    /// Gain of each mode for an impulse of 1 N s along the direction of a contact point, in full scale, into `gains`.
    pub fn gains_at(&self, contact: &Contact, modal: &mut [f64], gains: &mut [f32]) {
        modal.fill(0.0);
        for (axis, along) in contact.direction.iter().enumerate() {
            contact.add_shapes(self.surface(), axis, *along, modal);
        }
        for ((gain, modal), factor) in gains.iter_mut().zip(&*modal).zip(&self.gains) {
            *gain = (modal * f64::from(*factor)) as f32;
        }
    }

    /// Largest gain of each mode for an impulse of 1 N s along the normal, at any vertex.
    ///
    /// # Complexity
    /// O(vertices * modes).
    #[must_use]
    pub fn reach(&self) -> Vec<f32> {
        let mut reach = vec![0.0_f32; self.len()];
        for vertex in 0..self.vertices.len() {
            let along = self.surface().along_normal(vertex);
            reach.iter_mut().zip(along).for_each(|(reach, x)| *reach = reach.max(x.abs() as f32));
        }
        reach.iter_mut().zip(&self.gains).for_each(|(reach, gain)| *reach *= gain.abs());
        reach
    }

    /// The error for shapes that belong to other modes.
    pub(in crate::modal) fn mismatch(&self, modes: &Modes) -> Option<Reject> {
        if self.len() != modes.len() {
            let message = format!("shapes of {} modes for {} modes", self.len(), modes.len());
            let reject = Reject::new("F078", message).at("shapes");
            return Some(reject.help("link both outputs of one ModelModes"));
        }
        self.validate().err().map(|e| Reject::new("F078", e).at("shapes"))
    }

    /// Checks lengths and ranges.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn validate(&self) -> Result<(), String> {
        let (m, s) = (self.len(), self.vertices.len());
        let check = |good: bool, what: &str| {
            if good { Ok(()) } else { Err(format!("shapes of modes have a wrong field: {what}")) }
        };
        check((1..=MAX_MODES).contains(&m), "`gains` has no modes, or too many")?;
        check(s > 0 && !self.triangles.is_empty(), "there is no surface")?;
        check(self.normals.len() == s, "length of `normals`")?;
        check(
            s.checked_mul(3).and_then(|n| n.checked_mul(m)) == Some(self.shapes.len()),
            "length of `shapes`",
        )?;
        let inside = self.triangles.iter().flatten().all(|c| (*c as usize) < s);
        check(inside, "`triangles` name missing vertices")?;
        let points = self.vertices.iter().chain(&self.normals).flatten();
        check(points.into_iter().all(|x| x.is_finite()), "a vertex is not finite")?;
        check(self.shapes.iter().chain(&self.gains).all(|x| x.is_finite()), "a shape is not finite")
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        vec![
            ("modes", self.len().into()),
            ("surface_vertices", self.vertices.len().into()),
            ("extent_m", self.surface().extent().into()),
        ]
    }
}

impl Data for ModeShapes {
    const NAME: &'static str = "mode shapes";

    /// A tetrahedron of 0.1 m with random shapes.
    fn trial(rng: &mut Rng) -> Self {
        let size = 0.1;
        let vertices = vec![[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
        let third = 1.0 / 3.0_f64.sqrt();
        let normals = vec![[-third; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let modes = 1 + rng.below(20);
        let mut list = |n: usize| (0..n).map(|_| rng.between(-2.0, 2.0) as f32).collect::<Vec<f32>>();
        let (shapes, gains) = (list(12 * modes), list(modes));
        Self { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], normals, shapes, gains }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_of_trials_are_valid_and_errors_name_the_field() {
        for seed in 0..10 {
            let shapes = ModeShapes::trial(&mut Rng::new(seed));
            shapes.validate().unwrap();
            let wrong = ModeShapes { shapes: vec![0.0; 5], ..shapes.clone() };
            assert!(wrong.validate().unwrap_err().contains("`shapes`"));
            let wrong = ModeShapes { triangles: vec![[0, 1, 9]], ..shapes };
            assert!(wrong.validate().unwrap_err().contains("`triangles`"));
        }
    }

    #[test]
    fn gains_are_interpolated_between_corners_along_the_direction() {
        let shapes = ModeShapes {
            shapes: (0..12).map(|k| k as f32).collect(),
            gains: vec![2.0],
            ..ModeShapes::trial(&mut Rng::new(1))
        };
        let contact =
            Contact { vertices: [0, 1, 3], weights: [0.5, 0.25, 0.25], direction: [0.0, 0.0, -1.0] };
        let (mut modal, mut gains) = ([0.0], [0.0]);
        shapes.gains_at(&contact, &mut modal, &mut gains);
        // Displacements along z of the vertices: 2, 5, 11.
        assert_eq!(gains, [-2.0 * (0.5 * 2.0 + 0.25 * 5.0 + 0.25 * 11.0)]);
        assert_eq!(contact.position(shapes.surface()), [0.025, 0.0, 0.025]);
    }
}
