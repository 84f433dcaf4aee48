//! Regions of a garment whose strain changes fast, as at a bending joint.

use crate::contact::vector::{add, norm, sub, widen};
use crate::impl_state;
use crate::mesh::{Regions, Topology};

/// A part of a garment, whose edges are stretched and compressed together at a bending joint.
#[derive(Clone, Debug, Default)]
struct Region {
    edges: Vec<[u32; 2]>,
    /// Lengths of the edges at rest, m.
    rest_lengths: Vec<f64>,
    vertices: Vec<u32>,
    area: f64,
    strain: f64,
    /// True from a fast change of strain until a slow one.
    fast: bool,
}
impl_state!(Region { strain, fast });

/// A region that starts to bend fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// Lowest vertex index of the region.
    pub id: u32,
    /// Number of vertices of the region.
    pub vertices: u32,
    /// Rate of change of its mean strain, 1/s.
    pub rate: f64,
    /// Its area at rest, m^2.
    pub area: f64,
    /// Mean position of its vertices, m.
    pub position: [f32; 3],
}

/// Detects regions of a garment whose mean strain starts to change fast.
#[derive(Clone, Debug)]
pub struct BendDetector {
    regions: Vec<Region>,
    /// Rate of strain above which a region is fast, 1/s; below half of it it is slow again.
    threshold: f64,
    dt: f64,
    frames: u64,
}
impl_state!(BendDetector { each regions, frames });

impl BendDetector {
    /// A detector for `rate` frames per second, with the rest pose divided into boxes of at most `size` metres.
    #[must_use]
    pub fn new(topology: &Topology, areas: &[f32], size: f64, threshold: f64, rate: f64) -> Self {
        let partition = Regions::new(&topology.rest, size);
        let area = |v: &u32| f64::from(areas.get(*v as usize).copied().unwrap_or(0.0));
        let region = |vertices: Vec<u32>| Region {
            area: vertices.iter().map(area).sum(),
            vertices,
            ..Region::default()
        };
        let mut regions: Vec<Region> = partition.vertices.into_iter().map(region).collect();
        let sides = topology.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.dedup();
        for edge in edges {
            let length = length(&topology.rest, edge);
            let region = partition.of.get(edge[0] as usize).and_then(|k| regions.get_mut(*k as usize));
            if let Some(region) = region.filter(|_| length > 0.0) {
                region.edges.push(edge);
                region.rest_lengths.push(length);
            }
        }
        Self { regions, threshold, dt: 1.0 / rate, frames: 0 }
    }

    /// Advances to the next frame, and calls `found` with each region that starts to bend fast.
    pub fn advance(&mut self, positions: &[[f32; 3]], mut found: impl FnMut(Bend)) {
        for region in &mut self.regions {
            let strain = region.mean_strain(positions);
            let rate = (strain - region.strain) / self.dt;
            region.strain = strain;
            if self.frames == 0 {
                continue;
            }
            if !region.fast && rate.abs() > self.threshold {
                region.fast = true;
                found(region.bend(rate, positions));
            } else if rate.abs() < 0.5 * self.threshold {
                region.fast = false;
            }
        }
        self.frames += 1;
    }
}

fn length(positions: &[[f32; 3]], [a, b]: [u32; 2]) -> f64 {
    let at = |v: u32| positions.get(v as usize).copied().map(widen).unwrap_or_default();
    norm(sub(at(b), at(a)))
}

impl Region {
    /// Mean absolute strain of the edges: a bent joint has edges of both signs.
    fn mean_strain(&self, positions: &[[f32; 3]]) -> f64 {
        let edges = self.edges.iter().zip(&self.rest_lengths);
        let strains = edges.map(|(edge, rest)| (length(positions, *edge) / rest - 1.0).abs());
        strains.sum::<f64>() / self.edges.len().max(1) as f64
    }

    fn bend(&self, rate: f64, positions: &[[f32; 3]]) -> Bend {
        let sum = self
            .vertices
            .iter()
            .filter_map(|v| positions.get(*v as usize))
            .fold([0.0; 3], |sum, p| add(sum, widen(*p)));
        let count = self.vertices.len().max(1) as f64;
        Bend {
            id: self.vertices.first().copied().unwrap_or(0),
            vertices: self.vertices.len() as u32,
            rate,
            area: self.area,
            position: sum.map(|x| (x / count) as f32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    #[test]
    fn a_joint_that_bends_fast_is_found_once_until_it_rests() {
        let sheet = FlatSheet { vertices: [9, 3], size: [0.8, 0.2], velocity: [0.0; 3] }.topology();
        let areas = vec![0.01; sheet.rest.len()];
        let mut detector = BendDetector::new(&sheet, &areas, 0.2, 0.5, 60.0);
        // The part beyond 0.4 m is compressed by up to a fifth.
        let compressed = |by: f32| -> Vec<[f32; 3]> {
            let middle = sheet.rest.iter().map(|p| p[0]).fold(f32::MIN, f32::max) - 0.3;
            sheet
                .rest
                .iter()
                .map(|&[x, y, z]| [if x > middle { middle + (x - middle) * (1.0 - by) } else { x }, y, z])
                .collect()
        };
        let mut found = Vec::new();
        let strains: Vec<f32> = (0..60)
            .map(|k| match k {
                0..10 => 0.0,
                10..20 => 0.02 * (k - 9) as f32,
                20..40 => 0.2,
                40..50 => 0.2 - 0.02 * (k - 39) as f32,
                _ => 0.0,
            })
            .collect();
        for (k, by) in strains.into_iter().enumerate() {
            detector.advance(&compressed(by), |bend| found.push((k, bend)));
        }
        assert!(!found.is_empty() && found.iter().all(|(k, _)| [10, 40].contains(k)), "{found:?}");
        let rising: Vec<_> = found.iter().filter(|(k, _)| *k == 10).collect();
        assert!(rising.len() * 2 == found.len() && rising.iter().all(|(_, b)| b.rate > 0.5), "{found:?}");
        assert!(found.iter().filter(|(k, _)| *k == 40).all(|(_, b)| b.rate < -0.5));
        // A rigid rotation causes no strain.
        let mut detector = BendDetector::new(&sheet, &areas, 0.2, 0.5, 60.0);
        for k in 0..20 {
            let (s, c) = (0.2 * k as f32).sin_cos();
            let turned: Vec<[f32; 3]> =
                sheet.rest.iter().map(|&[x, y, z]| [c * x - s * y, s * x + c * y, z]).collect();
            detector.advance(&turned, |bend| panic!("{bend:?}"));
        }
    }
}
