//! What a reader collects: nodes with their numbers in the file, and elements over them.

use super::super::tet_mesh::{TetMesh, TetMeshError};
use std::collections::HashMap;

/// Distance of a mid-edge node from the midpoint at which an edge counts as curved, relative to its length.
const STRAIGHT: f64 = 1e-6;
/// The edges of a tetrahedron.
pub(super) const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];

/// Nodes and elements of a file.
#[derive(Default)]
pub(super) struct Raw {
    pub(super) nodes: Vec<[f64; 3]>,
    /// Index of each number of a node, where numbers are not `first..`.
    index: HashMap<u64, u32>,
    tets: Vec<[u32; 4]>,
}

impl Raw {
    /// Adds a node with its number in the file; returns false if the number is taken or there are too many.
    pub(super) fn node(&mut self, tag: u64, position: [f64; 3]) -> bool {
        let index = self.nodes.len() as u32;
        self.nodes.push(position);
        self.nodes.len() < u32::MAX as usize && self.index.insert(tag, index).is_none()
    }

    /// Adds an element by the numbers of its 4 or 10 nodes, of which the first four are the corners.
    ///
    /// # Errors
    /// A description of the mistake: a node that does not exist, or an edge that is curved.
    pub(super) fn element(&mut self, tags: &[u64]) -> Result<(), String> {
        let find = |tag: &u64| {
            let index = self.index.get(tag).copied();
            index.ok_or_else(|| {
                format!("an element names node {tag}, which is none of the {} nodes", self.nodes.len())
            })
        };
        let all: Vec<u32> = tags.iter().map(find).collect::<Result<_, _>>()?;
        let (&[a, b, c, d], middles) = all.split_first_chunk().ok_or("an element has fewer than 4 nodes")?;
        let corners = [a, b, c, d];
        if !middles.is_empty() {
            self.straight(&corners, middles)?;
        }
        self.tets.push(corners);
        Ok(())
    }

    /// Checks that there is one node on the midpoint of each edge, in any order.
    fn straight(&self, corners: &[u32; 4], middles: &[u32]) -> Result<(), String> {
        let at = |i: u32| self.nodes[i as usize];
        let mut taken = [false; 6];
        for &middle in middles {
            let p = at(middle);
            let fits = |[a, b]: [usize; 2]| {
                let (a, b) = (at(corners[a]), at(corners[b]));
                let (mut off, mut length) = (0.0, 0.0);
                for k in 0..3 {
                    off += (p[k] - 0.5 * (a[k] + b[k])).powi(2);
                    length += (b[k] - a[k]).powi(2);
                }
                off <= STRAIGHT * STRAIGHT * length
            };
            let edge = (0..6).find(|e| !taken[*e] && fits(EDGES[*e]));
            let Some(edge) = edge else {
                return Err("a second-order element has a node that is not at the midpoint of an edge: curved elements \
                            are not read, save with straight edges or first order"
                    .into());
            };
            taken[edge] = true;
        }
        Ok(())
    }

    /// The mesh, checked.
    pub(super) fn mesh(self) -> Result<TetMesh, TetMeshError> {
        TetMesh::new(self.nodes, self.tets)
    }
}
