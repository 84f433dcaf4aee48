//! The nearest point of a surface, by a bounding volume hierarchy.

use super::contact::{Contact, nearest_of};
use super::surface_view::SurfaceView;
use crate::contact::broad_phase::bvh::Bvh;
use crate::contact::vector::{norm, sub};

/// Finds the points of one surface that are nearest to given points.
#[derive(Clone, Debug)]
pub struct SurfaceIndex {
    bvh: Bvh,
    /// Some point of the surface.
    anchor: [f64; 3],
}

/// Distance in m beyond which nothing is found: its square is far from the limits of single precision.
const FARTHEST: f64 = 1e12;

impl SurfaceIndex {
    /// An index over the triangles of a surface.
    ///
    /// # Complexity
    /// O(triangles log triangles).
    #[must_use]
    pub fn new(surface: SurfaceView<'_>) -> Self {
        let positions: Vec<[f32; 3]> = surface.vertices.iter().map(|p| p.map(|x| x as f32)).collect();
        let anchor = surface.triangles.first().and_then(|t| surface.vertices.get(t[0] as usize));
        Self { bvh: Bvh::new(&positions, surface.triangles), anchor: anchor.copied().unwrap_or_default() }
    }

    /// The nearest point of the surface with its inward normal as the direction, and its distance in m; none if the
    /// position is not finite or farther than 10^12 m.
    ///
    /// # Complexity
    /// Expected O(log triangles) near the surface.
    #[must_use]
    pub fn nearest(&self, surface: SurfaceView<'_>, position: [f64; 3]) -> Option<(Contact, f64)> {
        let bound = norm(sub(position, self.anchor));
        if bound.is_nan() || bound > FARTHEST {
            return None;
        }
        // With a margin for positions in single precision.
        let margin = position.iter().chain(&self.anchor).fold(bound, |m, x| m.max(x.abs()));
        let radius = (bound + 1e-5 * margin) as f32;
        let hit = self.bvh.closest(position.map(|x| x as f32), radius, |_| true)?;
        let triangle = surface.triangles.get(hit.triangle as usize)?;
        let (contact, distance, _) = nearest_of(surface, std::slice::from_ref(triangle), position)?;
        Some((contact, distance))
    }
}

#[cfg(test)]
mod tests {
    use super::super::contact::contacts;
    use super::*;
    use crate::core::random::Rng;
    use crate::solid::mesh::shapes::ball;
    use crate::solid::model::surface::Surface;

    #[test]
    fn the_index_finds_what_all_triangles_give() {
        let surface = Surface::new(&ball(0.1, 6)).unwrap();
        let view = SurfaceView {
            vertices: &surface.vertices,
            triangles: &surface.triangles,
            normals: &surface.normals,
            shapes: &[],
            modes: 0,
        };
        let (index, mut rng) = (SurfaceIndex::new(view), Rng::new(3));
        for _ in 0..200 {
            let point = [0.0; 3].map(|_| rng.between(-0.15, 0.15));
            let (found, distance) = index.nearest(view, point).unwrap();
            let all = contacts(view, &[point], &[], &[], 100.0).unwrap()[0];
            let apart = (0..3).map(|k| (found.position(view)[k] - all.position(view)[k]).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-6, "{point:?}");
            assert!((0.0..0.3).contains(&distance));
            // Inwards, so towards the centre.
            let towards: f64 = (0..3).map(|k| found.direction[k] * found.position(view)[k]).sum();
            assert!(towards < 0.0);
        }
        assert!(index.nearest(view, [f64::NAN, 0.0, 0.0]).is_none());
        assert!(index.nearest(view, [1e30, 0.0, 0.0]).is_none());
        // On the surface, also at the anchor itself.
        for vertex in &surface.vertices {
            assert!(index.nearest(view, *vertex).unwrap().1 < 1e-7);
        }
    }
}
