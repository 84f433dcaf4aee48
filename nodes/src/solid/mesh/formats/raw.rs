//! Mesh as a reader collects it: nodes with their numbers in the file, and elements over them.

use super::super::element::edges;
use super::super::error::TetMeshError;
use super::super::tet_mesh::TetMesh;
use crate::contact::vector::{add, norm, scale, sub};
use std::collections::HashMap;

/// Distance of a mid-edge node from the midpoint at which an edge counts as curved, relative to its length: files hold as few as six digits.
const STRAIGHT: f64 = 1e-6;

/// Index of the node of each edge of [`EDGES`](super::super::isoparametric::EDGES) among the nodes of an element after its corners.
pub(super) type MiddleOrder = [usize; 6];

/// Nodes and elements of a file.
#[derive(Default)]
pub(super) struct Raw {
    pub(super) nodes: Vec<[f64; 3]>,
    /// Index of each number of a node, where numbers are not `first..`.
    index: HashMap<u64, u32>,
    tets: Vec<[u32; 4]>,
    /// Node between the ends of each edge of elements of order 2, and true if it is off the midpoint.
    middles: HashMap<[u32; 2], (u32, bool)>,
}

impl Raw {
    /// Adds a node with its number in the file; returns false if the number is taken or there are too many.
    pub(super) fn node(&mut self, tag: u64, position: [f64; 3]) -> bool {
        let index = self.nodes.len() as u32;
        self.nodes.push(position);
        self.nodes.len() < u32::MAX as usize && self.index.insert(tag, index).is_none()
    }

    /// Adds an element by the numbers of its 4 or 10 nodes, of which the first four are the corners; `order` are the indices of the nodes of
    /// the edges among the others, `None` where it is not known.
    ///
    /// # Errors
    /// A description of the mistake: a node that does not exist, an edge with two nodes in its middle, or a curve without an order.
    pub(super) fn element(&mut self, tags: &[u64], order: Option<MiddleOrder>) -> Result<(), String> {
        let find = |tag: &u64| {
            let index = self.index.get(tag).copied();
            index.ok_or_else(|| {
                format!("an element names node {tag}, which is none of the {} nodes", self.nodes.len())
            })
        };
        let all: Vec<u32> = tags.iter().map(find).collect::<Result<_, _>>()?;
        let (&[a, b, c, d], middles) = all.split_first_chunk().ok_or("an element has fewer than 4 nodes")?;
        let corners = [a, b, c, d];
        if let Ok(middles) = middles.try_into() {
            self.add_middles(&edges(&corners), middles, order)?;
        }
        self.tets.push(corners);
        Ok(())
    }

    /// Adds the nodes of the edges of an element.
    fn add_middles(
        &mut self,
        edges: &[[u32; 2]; 6],
        middles: &[u32; 6],
        order: Option<MiddleOrder>,
    ) -> Result<(), String> {
        // Programs differ in the order, which is seen where edges are straight.
        let straight = |node: u32, ends: [u32; 2]| self.distance(node, ends) <= STRAIGHT;
        let of_edge = |ends: &[u32; 2]| middles.iter().copied().find(|node| straight(*node, *ends));
        let found: Vec<u32> = edges.iter().filter_map(of_edge).collect();
        let nodes = match (<[u32; 6]>::try_from(found), order) {
            (Ok(nodes), _) => nodes,
            (_, Some(order)) => order.map(|k| middles[k]),
            _ => return Err("a node of an element of order 2 is off the midpoint of its edge: curved elements of this format are \
                             not read, save as Gmsh or VTK"
                .into()),
        };
        let curved: [bool; 6] = std::array::from_fn(|k| !straight(nodes[k], edges[k]));
        for ((ends, node), curved) in edges.iter().zip(nodes).zip(curved) {
            let (other, _) = *self.middles.entry(*ends).or_insert((node, curved));
            // A file may give each element its own nodes.
            let [p, q, a, b] = [node, other, ends[0], ends[1]].map(|i| self.nodes[i as usize]);
            if other != node && norm(sub(p, q)) > 2.0 * STRAIGHT * norm(sub(b, a)) {
                return Err("two elements of order 2 have different nodes in the middle of one edge".into());
            }
        }
        Ok(())
    }

    /// Distance of a node from the middle of an edge, relative to the length of the edge.
    fn distance(&self, node: u32, ends: [u32; 2]) -> f64 {
        let [p, a, b] = [node, ends[0], ends[1]].map(|i| self.nodes[i as usize]);
        norm(sub(p, scale(add(a, b), 0.5))) / norm(sub(b, a)).max(f64::MIN_POSITIVE)
    }

    /// The mesh, checked.
    pub(super) fn mesh(self) -> Result<TetMesh, TetMeshError> {
        let curve = |(ends, (node, curved)): (&[u32; 2], &(u32, bool))| {
            curved.then(|| (*ends, self.nodes[*node as usize]))
        };
        let curves = self.middles.iter().filter_map(curve).collect();
        TetMesh::with_curves(self.nodes, self.tets, curves)
    }
}
