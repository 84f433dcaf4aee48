//! Stiffness and mass of a mesh.

use super::super::mesh::element::edges;
use super::super::mesh::isoparametric::quadrature;
use super::super::mesh::tet_mesh::TetMesh;
use super::block_matrix::BlockMatrix;
use super::elements::{Element, Isotropic, Order, curved_matrices};
use rayon::prelude::*;
use std::collections::HashMap;

/// Elements whose matrices are computed at once, before they are added in order.
const CHUNK: usize = 512;

/// The nodes of all elements: those of the mesh first, then one on each edge if the order is 2, in its middle or on its curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Discretisation {
    /// Order of the elements.
    pub order: Order,
    /// Positions of the nodes, m.
    pub nodes: Vec<[f64; 3]>,
    /// Nodes of each element; the first `order.nodes()` are used.
    pub elements: Vec<[u32; 10]>,
    /// True for each element of order 2 with a curved edge.
    pub curved: Vec<bool>,
    /// Node in the middle of each edge, by its ends in order.
    pub middles: HashMap<[u32; 2], u32>,
}

impl Discretisation {
    /// The nodes of a mesh; elements of order 1 have straight edges.
    ///
    /// # Complexity
    /// O(n log curves) on average.
    #[must_use]
    pub fn new(mesh: &TetMesh, order: Order) -> Self {
        let mut nodes = mesh.nodes.clone();
        let mut middles = HashMap::new();
        let elements = mesh.tets.iter().map(|tet| {
            let mut all = [0; 10];
            all[..4].copy_from_slice(tet);
            if order == Order::Quadratic {
                for (node, ends) in all[4..].iter_mut().zip(edges(tet)) {
                    *node = *middles.entry(ends).or_insert_with(|| {
                        nodes.push(mesh.middle(ends));
                        nodes.len() as u32 - 1
                    });
                }
            }
            all
        });
        let elements = elements.collect();
        let curved = mesh.tets.iter().map(|tet| order == Order::Quadratic && mesh.is_curved(tet)).collect();
        Self { order, nodes, elements, curved, middles }
    }

    /// Stiffness and mass.
    ///
    /// Elements are added in their order, so that the result does not depend on the number of threads.
    ///
    /// # Complexity
    /// O(elements).
    #[must_use]
    pub fn assemble(&self, material: &Isotropic) -> BlockMatrix {
        let mut matrix = self.pattern();
        let n = self.order.nodes();
        let mut buffers = vec![(vec![[0.0; 9]; n * n], vec![0.0; n * n]); CHUNK];
        for (elements, curved) in self.elements.chunks(CHUNK).zip(self.curved.chunks(CHUNK)) {
            let each = buffers.par_iter_mut().zip(elements).zip(curved);
            each.for_each(|(((stiffness, mass), element), curved)| {
                if *curved {
                    let points = quadrature(&element.map(|k| self.nodes[k as usize]));
                    return curved_matrices(&points, material, stiffness, mass);
                }
                let corners = [0, 1, 2, 3].map(|k| self.nodes[element[k] as usize]);
                let geometry = Element::new(&corners);
                geometry.stiffness(self.order, material, stiffness);
                geometry.mass(self.order, material.density, mass);
            });
            for ((stiffness, mass), element) in buffers.iter().zip(elements) {
                for i in 0..n {
                    let row = element[i] as usize;
                    let (start, end) = (matrix.starts[row], matrix.starts[row + 1]);
                    for j in 0..n {
                        let at = matrix.columns[start..end].binary_search(&element[j]);
                        let at = start + at.unwrap_or_default();
                        matrix.stiffness[at]
                            .iter_mut()
                            .zip(stiffness[i * n + j])
                            .for_each(|(sum, x)| *sum += x);
                        matrix.mass[at] += mass[i * n + j];
                    }
                }
            }
        }
        matrix
    }

    /// The pairs of nodes that share an element, without values.
    fn pattern(&self) -> BlockMatrix {
        let n = self.order.nodes();
        // Elements of each node.
        let mut first = vec![0_usize; self.nodes.len() + 1];
        self.elements.iter().flat_map(|e| &e[..n]).for_each(|c| first[*c as usize + 1] += 1);
        (0..self.nodes.len()).for_each(|i| first[i + 1] += first[i]);
        let mut next = first.clone();
        let mut of_node = vec![0_u32; first[self.nodes.len()]];
        for (k, element) in self.elements.iter().enumerate() {
            for c in &element[..n] {
                of_node[next[*c as usize]] = k as u32;
                next[*c as usize] += 1;
            }
        }
        let (mut starts, mut columns, mut row) = (vec![0], Vec::new(), Vec::new());
        for i in 0..self.nodes.len() {
            row.clear();
            let all = of_node[first[i]..first[i + 1]].iter();
            row.extend(all.flat_map(|k| &self.elements[*k as usize][..n]));
            row.sort_unstable();
            row.dedup();
            columns.extend_from_slice(&row);
            starts.push(columns.len());
        }
        let entries = columns.len();
        BlockMatrix { starts, columns, stiffness: vec![[0.0; 9]; entries], mass: vec![0.0; entries] }
    }
}
