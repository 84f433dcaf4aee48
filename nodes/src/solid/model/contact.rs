//! Contact points on the surface of an object.

use super::super::mesh::tet_mesh::{cross, dot, minus};
use super::modal_model::{ModalModel, length};
use thiserror::Error;

/// A point on the surface: a triangle, and the weights of its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Vertices of the triangle.
    pub vertices: [u32; 3],
    /// Their weights, which add up to 1.
    pub weights: [f64; 3],
    /// Unit vector along which the impulse acts.
    pub direction: [f64; 3],
}

/// Error in a contact point.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ContactError {
    /// A point away from the surface.
    #[error(
        "point {index} is {distance:.4} m from the surface, more than {limit:.4} m; the nearest point of the surface is {nearest:.4?}"
    )]
    Far {
        /// Index of the point.
        index: usize,
        /// Its distance, m.
        distance: f64,
        /// The largest distance, m.
        limit: f64,
        /// The nearest point.
        nearest: [f64; 3],
    },
    /// A vertex that does not exist.
    #[error("there is no vertex {found}; the surface has {count}, counted from 0")]
    Vertex {
        /// Number of the vertex.
        found: u32,
        /// Number of vertices.
        count: usize,
    },
    /// A direction without length.
    #[error("direction {index} has no length")]
    Direction {
        /// Index of the direction.
        index: usize,
    },
    /// A number of directions that does not fit.
    #[error("there are {found} directions for {points} contact points; none, or one for each, are needed")]
    Directions {
        /// Number of directions.
        found: usize,
        /// Number of points.
        points: usize,
    },
    /// No contact point.
    #[error("there is no contact point: give `points` or `vertices`")]
    None,
}

/// The contacts at positions and at vertices, in this order; without directions each acts along the inward normal.
///
/// # Errors
/// A point farther from the surface than `max_off_surface` times the extent of the object, and lists that do not fit.
///
/// # Complexity
/// O(points * triangles).
pub fn contacts(
    model: &ModalModel,
    points: &[[f64; 3]],
    vertices: &[u32],
    directions: &[[f64; 3]],
    max_off_surface: f64,
) -> Result<Vec<Contact>, ContactError> {
    let count = points.len() + vertices.len();
    if count == 0 {
        return Err(ContactError::None);
    }
    if !directions.is_empty() && directions.len() != count {
        return Err(ContactError::Directions { found: directions.len(), points: count });
    }
    let limit = max_off_surface * model.extent();
    let mut all = Vec::with_capacity(count);
    for (index, point) in points.iter().enumerate() {
        let (contact, distance, nearest) = project(model, *point);
        if distance > limit {
            return Err(ContactError::Far { index, distance, limit, nearest });
        }
        all.push(contact);
    }
    for &vertex in vertices {
        if vertex as usize >= model.vertices.len() {
            return Err(ContactError::Vertex { found: vertex, count: model.vertices.len() });
        }
        all.push(Contact { vertices: [vertex; 3], weights: [1.0, 0.0, 0.0], direction: [0.0; 3] });
    }
    for (index, contact) in all.iter_mut().enumerate() {
        let direction = directions.get(index).copied().unwrap_or_else(|| contact.inwards(model));
        let long = length(direction);
        if long <= 0.0 || !long.is_finite() {
            return Err(ContactError::Direction { index });
        }
        contact.direction = direction.map(|x| x / long);
    }
    Ok(all)
}

impl Contact {
    /// The inward normal of the triangle, or of the vertex.
    fn inwards(&self, model: &ModalModel) -> [f64; 3] {
        let [a, b, c] = self.vertices.map(|i| model.vertices[i as usize]);
        let outwards = if self.vertices[0] == self.vertices[1] {
            model.normals[self.vertices[0] as usize]
        } else {
            cross(minus(b, a), minus(c, a))
        };
        outwards.map(|x| -x)
    }

    /// Modal impulse of each mode for an impulse of 1 N s along the direction, kg^(-1/2) N s.
    #[must_use]
    pub fn impulses(&self, model: &ModalModel) -> Vec<f64> {
        let mut all = vec![0.0; model.len()];
        for (vertex, weight) in self.vertices.iter().zip(self.weights) {
            for (axis, along) in self.direction.iter().enumerate() {
                let factor = weight * along;
                let shape = model.shape(*vertex as usize, axis);
                all.iter_mut().zip(shape).for_each(|(sum, x)| *sum += factor * f64::from(*x));
            }
        }
        all
    }
}

/// The nearest point of the surface, its distance and position.
fn project(model: &ModalModel, point: [f64; 3]) -> (Contact, f64, [f64; 3]) {
    let mut best =
        (Contact { vertices: [0; 3], weights: [1.0, 0.0, 0.0], direction: [0.0; 3] }, f64::INFINITY, point);
    for vertices in &model.triangles {
        let corners = vertices.map(|i| model.vertices[i as usize]);
        let weights = nearest(corners, point);
        let at: [f64; 3] = std::array::from_fn(|k| (0..3).map(|i| weights[i] * corners[i][k]).sum());
        let distance = length(minus(at, point));
        if distance < best.1 {
            best = (Contact { vertices: *vertices, weights, direction: [0.0; 3] }, distance, at);
        }
    }
    best
}

/// Barycentric coordinates of the point of a triangle that is nearest to `p`.
///
/// # Source
/// Ericson, "Real-Time Collision Detection" (2005), section 5.1.5.
fn nearest([a, b, c]: [[f64; 3]; 3], p: [f64; 3]) -> [f64; 3] {
    let (ab, ac) = (minus(b, a), minus(c, a));
    let (ap, bp, cp) = (minus(p, a), minus(p, b), minus(p, c));
    let (d1, d2, d3, d4, d5, d6) =
        (dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}
