//! Parts of a mesh: the vertices of its rest pose, box by box.

use std::collections::BTreeMap;

/// Vertices of a rest pose in boxes of one size.
///
/// The boxes begin at the least corner of the pose and fill it evenly, so that where it stands does not matter and no part is a
/// sliver of what others left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Regions {
    /// Region of each vertex.
    pub of: Vec<u32>,
    /// Vertices of each region, the lowest first; regions in the order of their boxes along x, y and z.
    pub vertices: Vec<Vec<u32>>,
}

impl Regions {
    /// Cuts a rest pose into boxes of at most `size` metres; those that hold no vertex are left out.
    ///
    /// # Complexity
    /// O(n log n).
    #[must_use]
    pub fn new(rest: &[[f32; 3]], size: f64) -> Self {
        let axis = |k: usize| {
            let along = || rest.iter().map(|p| f64::from(p[k])).filter(|x| x.is_finite());
            let (low, high) =
                (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
            let length = (high - low).max(0.0);
            // What fits but for rounding fits.
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
        let mut numbers: BTreeMap<[i64; 3], u32> = rest.iter().map(|p| (cell(p), 0)).collect();
        numbers.values_mut().zip(0..).for_each(|(number, k)| *number = k);
        let of: Vec<u32> = rest.iter().map(|p| numbers.get(&cell(p)).copied().unwrap_or(0)).collect();
        let mut vertices = vec![Vec::new(); numbers.len()];
        for (vertex, region) in (0..).zip(&of) {
            if let Some(own) = vertices.get_mut(*region as usize) {
                own.push(vertex);
            }
        }
        Self { of, vertices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    #[test]
    fn boxes_fill_a_sheet_evenly_wherever_it_stands() {
        let sheet = FlatSheet { vertices: [31, 21], size: [1.5, 1.0], velocity: [0.0; 3] }.topology();
        let regions = Regions::new(&sheet.rest, 0.4);
        let counts: Vec<usize> = regions.vertices.iter().map(Vec::len).collect();
        assert_eq!(counts.len(), 4 * 3, "1.5 m in four, 1 m in three");
        assert!(counts.iter().all(|n| (42..=72).contains(n)), "{counts:?}");
        assert_eq!(counts.iter().sum::<usize>(), 31 * 21);
        let moved: Vec<[f32; 3]> = sheet.rest.iter().map(|p| [p[0] + 8.0, p[1] - 0.25, p[2] + 3.5]).collect();
        assert_eq!(Regions::new(&moved, 0.4).vertices.len(), 12);
        for (vertex, region) in regions.of.iter().enumerate() {
            assert!(regions.vertices[*region as usize].contains(&(vertex as u32)));
        }
    }

    #[test]
    fn a_part_as_large_as_the_pose_is_all_of_it_and_no_vertex_has_no_part() {
        let sheet = FlatSheet { vertices: [4, 4], size: [0.3, 0.3], velocity: [0.0; 3] }.topology();
        assert_eq!(Regions::new(&sheet.rest, 0.3).vertices.len(), 1);
        assert_eq!(Regions::new(&sheet.rest, 0.15).vertices.len(), 4);
        assert_eq!(Regions::new(&[], 0.1), Regions::default());
        assert_eq!(Regions::new(&[[1.0; 3]; 3], 0.1).vertices, [[0, 1, 2]]);
    }
}
