//! Contact points on the surface of an object.

use super::surface_view::SurfaceView;
use crate::contact::triangle::closest_point;
use crate::contact::vector::{cross, norm, scale, sub};
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A point on the surface: a triangle, and the weights of its corners.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
    surface: SurfaceView<'_>,
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
    let limit = max_off_surface * surface.extent();
    let mut all = Vec::with_capacity(count);
    for (index, point) in points.iter().enumerate() {
        let Some((contact, distance, nearest)) = nearest_of(surface, surface.triangles, *point) else {
            return Err(ContactError::None);
        };
        if distance > limit {
            return Err(ContactError::Far { index, distance, limit, nearest });
        }
        all.push(contact);
    }
    for &vertex in vertices {
        if vertex as usize >= surface.vertices.len() {
            return Err(ContactError::Vertex { found: vertex, count: surface.vertices.len() });
        }
        all.push(Contact { vertices: [vertex; 3], weights: [1.0, 0.0, 0.0], direction: [0.0; 3] });
    }
    for (index, contact) in all.iter_mut().enumerate() {
        let direction = directions.get(index).copied().unwrap_or_else(|| contact.inwards(surface));
        let long = norm(direction);
        if long <= 0.0 || !long.is_finite() {
            return Err(ContactError::Direction { index });
        }
        contact.direction = direction.map(|x| x / long);
    }
    Ok(all)
}

/// Points uniform over the area of the surface, each along the inward normal of its triangle.
///
/// # Complexity
/// O(triangles), and O(log triangles) for each point.
#[must_use]
pub fn random_contacts(surface: SurfaceView<'_>, count: usize, rng: &mut Rng) -> Vec<Contact> {
    let mut total = 0.0;
    let mut until = Vec::with_capacity(surface.triangles.len());
    for triangle in surface.triangles {
        let [a, b, c] = triangle.map(|i| surface.vertices[i as usize]);
        total += 0.5 * norm(cross(sub(b, a), sub(c, a)));
        until.push(total);
    }
    if total <= 0.0 {
        return Vec::new();
    }
    (0..count)
        .map(|_| {
            let at = rng.uniform() * total;
            let triangle = until.partition_point(|end| *end <= at).min(until.len() - 1);
            // Uniform in the triangle: the square root of one coordinate.
            let (r, t) = (rng.uniform().sqrt(), rng.uniform());
            let weights = [1.0 - r, r * (1.0 - t), r * t];
            let contact = Contact { vertices: surface.triangles[triangle], weights, direction: [0.0; 3] };
            let inwards = contact.inwards(surface);
            let length = norm(inwards);
            let direction = if length > 0.0 { inwards.map(|x| x / length) } else { [0.0, 0.0, 1.0] };
            Contact { direction, ..contact }
        })
        .collect()
}

impl Contact {
    /// The inward normal of the triangle, or of the vertex.
    pub(super) fn inwards(&self, surface: SurfaceView<'_>) -> [f64; 3] {
        let [a, b, c] = self.vertices.map(|i| surface.vertices[i as usize]);
        let outwards = if self.vertices[0] == self.vertices[1] {
            surface.normals[self.vertices[0] as usize]
        } else {
            cross(sub(b, a), sub(c, a))
        };
        outwards.map(|x| -x)
    }

    /// Modal impulse of each mode for an impulse of 1 N s along the direction, kg^(-1/2) N s.
    #[must_use]
    pub fn impulses(&self, surface: SurfaceView<'_>) -> Vec<f64> {
        let mut all = vec![0.0; surface.modes];
        for (axis, along) in self.direction.iter().enumerate() {
            self.add_shapes(surface, axis, *along, &mut all);
        }
        all
    }

    /// Adds `factor` times the displacement of each mode along an axis.
    pub fn add_shapes(&self, surface: SurfaceView<'_>, axis: usize, factor: f64, sums: &mut [f64]) {
        for (vertex, weight) in self.vertices.iter().zip(self.weights) {
            let shape = surface.shape(*vertex as usize, axis);
            sums.iter_mut().zip(shape).for_each(|(sum, x)| *sum += factor * weight * f64::from(*x));
        }
    }

    /// Position on the surface, m.
    #[must_use]
    pub fn position(&self, surface: SurfaceView<'_>) -> [f64; 3] {
        let corners = self.vertices.map(|i| surface.vertices[i as usize]);
        [0, 1, 2].map(|k| corners.iter().zip(self.weights).map(|(p, w)| p[k] * w).sum())
    }
}

/// The nearest point of some triangles of the surface with their inward normal as the direction, its distance and position; none without
/// triangles.
pub(super) fn nearest_of(
    surface: SurfaceView<'_>,
    triangles: &[[u32; 3]],
    point: [f64; 3],
) -> Option<(Contact, f64, [f64; 3])> {
    let closest = |t: &[u32; 3]| closest_point(point, t.map(|i| surface.vertices[i as usize]));
    let all = triangles.iter().map(|t| (t, closest(t)));
    let (vertices, found) = all.min_by(|a, b| a.1.squared_distance.total_cmp(&b.1.squared_distance))?;
    let mut contact = Contact { vertices: *vertices, weights: found.barycentric, direction: [0.0; 3] };
    let inwards = contact.inwards(surface);
    let length = norm(inwards);
    contact.direction = if length > 0.0 { scale(inwards, 1.0 / length) } else { [0.0, 0.0, 1.0] };
    Some((contact, found.squared_distance.sqrt(), found.point))
}
