//! Meshes as items of streams.

use std::sync::Arc;

use super::generate::{FlatSheet, Synthetic};
use super::{Materials, Topology};
use crate::core::item::Item;
use crate::core::random::Rng;

/// A moving triangle mesh: one position in metres per vertex and frame, with constant faces.
#[derive(Debug)]
pub struct Mesh;

/// The constant part of a moving mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFormat {
    /// Triangles and rest pose.
    pub topology: Arc<Topology>,
    /// True if every frame is the rest pose, so that the rate of the stream has no meaning.
    pub is_static: bool,
    /// Materials of the triangles.
    pub materials: Arc<Materials>,
}

impl MeshFormat {
    /// Format of a moving mesh of one unnamed material.
    #[must_use]
    pub fn moving(topology: Topology) -> Self {
        Self { topology: Arc::new(topology), is_static: false, materials: Arc::default() }
    }
}

impl Item for Mesh {
    type Elem = [f32; 3];
    type Format = MeshFormat;
    const NAME: &'static str = "mesh";
    const COLUMNS: &'static [&'static str] = &["x", "y", "z"];

    fn width(format: &MeshFormat) -> usize {
        format.topology.vertex_count()
    }

    fn describe(format: &MeshFormat) -> String {
        let Topology { rest, triangles } = &*format.topology;
        let static_note = if format.is_static { ", still" } else { "" };
        format!("{} vertices, {} triangles{static_note}", rest.len(), triangles.len())
    }

    fn trial_format(rng: &mut Rng) -> MeshFormat {
        let vertices = [2 + rng.below(4), 2 + rng.below(4)];
        let mut sheet = FlatSheet { vertices, size: [0.1, 0.1], velocity: [0.0; 3] }.topology();
        // Different heights, so that sheets of one trial intersect.
        let height = rng.between(0.0, 0.04) as f32;
        sheet.rest.iter_mut().for_each(|p| p[2] += height);
        MeshFormat::moving(sheet)
    }

    fn trial(format: &MeshFormat, index: usize, rng: &mut Rng) -> [f32; 3] {
        let rest = format.topology.rest.get(index).copied().unwrap_or_default();
        rest.map(|x| x + rng.between(-0.01, 0.01) as f32)
    }

    fn finite(elem: &[f32; 3]) -> bool {
        elem.iter().all(|x| x.is_finite())
    }

    fn poison() -> [f32; 3] {
        [f32::NAN; 3]
    }

    fn numbers(elem: &[f32; 3], out: &mut Vec<f32>) {
        out.extend(elem);
    }
}
