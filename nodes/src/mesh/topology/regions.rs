//! Regions of a mesh: boxes over the vertices of its rest pose.

use std::collections::BTreeMap;

/// Partition of the vertices of a rest pose into boxes of one size.
///
/// The boxes start at the minimum corner of the pose and divide it evenly: the partition does not depend on the position
/// of the pose, and no box is a narrow remainder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Regions {
    /// Region of each vertex.
    pub of_vertex: Vec<u32>,
    /// Vertices of each region in ascending order; regions in the order of their boxes along x, y and z.
    pub vertices: Vec<Vec<u32>>,
}

impl Regions {
    /// Divides a rest pose into boxes of at most `size` metres; boxes without vertices are left out.
    ///
    /// # Complexity
    /// O(n log n).
    #[must_use]
    pub fn new(rest: &[[f32; 3]], size: f64) -> Self {
        let axis = |k: usize| {
            let coordinates = || rest.iter().map(|p| f64::from(p[k])).filter(|x| x.is_finite());
            let (low, high) = (
                coordinates().fold(f64::INFINITY, f64::min),
                coordinates().fold(f64::NEG_INFINITY, f64::max),
            );
            let length = (high - low).max(0.0);
            // The tolerance prevents one more box, by rounding, for a length that is a multiple of `size`.
            let count = (length / size.max(f64::MIN_POSITIVE) - 1e-6).ceil().clamp(1.0, 1e6);
            (low, length / count, count as i64 - 1)
        };
        let axes = [axis(0), axis(1), axis(2)];
        let cell = |p: &[f32; 3]| -> [i64; 3] {
            std::array::from_fn(|k| {
                let (low, step, last) = axes[k];
                if step > 0.0 { (((f64::from(p[k]) - low) / step).floor() as i64).clamp(0, last) } else { 0 }
            })
        };
        let mut indices: BTreeMap<[i64; 3], u32> = rest.iter().map(|p| (cell(p), 0)).collect();
        indices.values_mut().zip(0..).for_each(|(index, k)| *index = k);
        let of_vertex: Vec<u32> = rest.iter().map(|p| indices.get(&cell(p)).copied().unwrap_or(0)).collect();
        let mut vertices = vec![Vec::new(); indices.len()];
        for (vertex, region) in (0..).zip(&of_vertex) {
            if let Some(members) = vertices.get_mut(*region as usize) {
                members.push(vertex);
            }
        }
        Self { of_vertex, vertices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    #[test]
    fn boxes_divide_a_sheet_evenly_at_any_position() {
        let sheet = FlatSheet { vertices: [31, 21], size: [1.5, 1.0], velocity: [0.0; 3] }.topology();
        let regions = Regions::new(&sheet.rest, 0.4);
        let counts: Vec<usize> = regions.vertices.iter().map(Vec::len).collect();
        assert_eq!(counts.len(), 4 * 3, "1.5 m in four, 1 m in three");
        assert!(counts.iter().all(|n| (42..=72).contains(n)), "{counts:?}");
        assert_eq!(counts.iter().sum::<usize>(), 31 * 21);
        let moved: Vec<[f32; 3]> = sheet.rest.iter().map(|p| [p[0] + 8.0, p[1] - 0.25, p[2] + 3.5]).collect();
        assert_eq!(Regions::new(&moved, 0.4).vertices.len(), 12);
        for (vertex, region) in regions.of_vertex.iter().enumerate() {
            assert!(regions.vertices[*region as usize].contains(&(vertex as u32)));
        }
    }

    #[test]
    fn a_box_as_large_as_the_pose_holds_all_vertices_and_an_empty_pose_has_no_boxes() {
        let sheet = FlatSheet { vertices: [4, 4], size: [0.3, 0.3], velocity: [0.0; 3] }.topology();
        assert_eq!(Regions::new(&sheet.rest, 0.3).vertices.len(), 1);
        assert_eq!(Regions::new(&sheet.rest, 0.15).vertices.len(), 4);
        assert_eq!(Regions::new(&[], 0.1), Regions::default());
        assert_eq!(Regions::new(&[[1.0; 3]; 3], 0.1).vertices, [[0, 1, 2]]);
    }
}
