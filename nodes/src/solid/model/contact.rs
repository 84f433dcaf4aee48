//! Contact points on the surface of an object.

use super::modal_model::ModalModel;
use crate::contact::triangle::closest_point;
use crate::contact::vector::{cross, norm, sub};
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
        let long = norm(direction);
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
            cross(sub(b, a), sub(c, a))
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
    let closest = |t: &[u32; 3]| closest_point(point, t.map(|i| model.vertices[i as usize]));
    let all = model.triangles.iter().map(|t| (t, closest(t)));
    let nearest = all.min_by(|a, b| a.1.squared_distance.total_cmp(&b.1.squared_distance));
    let Some((vertices, found)) = nearest else {
        let nowhere = Contact { vertices: [0; 3], weights: [1.0, 0.0, 0.0], direction: [0.0; 3] };
        return (nowhere, f64::INFINITY, point);
    };
    let contact = Contact { vertices: *vertices, weights: found.barycentric, direction: [0.0; 3] };
    (contact, found.squared_distance.sqrt(), found.point)
}
