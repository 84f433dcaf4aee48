//! Components: connected vertices that buckle to the same side in one frame.

use crate::crumple::buckling::Buckle;
use crate::mesh::{MeshError, MeshPrepare, Topology};
use serde::{Deserialize, Serialize};

/// One-rings of the vertices of a mesh.
#[derive(Clone, Debug)]
pub(super) struct OneRings {
    starts: Vec<u32>,
    of: Vec<u32>,
}

impl OneRings {
    pub fn new(topology: &Topology) -> Result<Self, MeshError> {
        let mesh = MeshPrepare::new(topology)?;
        let vertices = topology.vertex_count();
        let mut starts = vec![0_u32; vertices + 1];
        mesh.edges().iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
        for v in 0..vertices {
            starts[v + 1] += starts[v];
        }
        let (mut next, mut of) = (starts.clone(), vec![0; 2 * mesh.edges().len()]);
        for &[a, b] in mesh.edges() {
            for (from, to) in [(a, b), (b, a)] {
                of[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        Ok(Self { starts, of })
    }

    /// Returns the one-ring of a vertex.
    pub fn of(&self, v: u32) -> &[u32] {
        &self.of[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }

    pub fn vertices(&self) -> usize {
        self.starts.len() - 1
    }
}

/// Sums over the vertices of a component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Sums {
    /// Sum of the changes of curvature, 1/m.
    pub change: f64,
    /// Sum of their absolute values, 1/m, equal to `change.abs()` if all have one sign.
    pub magnitude: f64,
    /// Sum of area times change, m.
    pub weighted: f64,
    /// Sum of areas, m^2.
    pub area: f64,
    pub count: u32,
    /// Sum of positions, m.
    pub position: [f64; 3],
    /// Sum of positions times area.
    pub weighted_position: [f64; 3],
    /// Sum of normals times area.
    pub normal: [f64; 3],
}

impl Sums {
    pub fn add(&mut self, b: &Buckle) {
        let area = b.area;
        let terms = |k: usize| {
            let x = f64::from(b.position[k]);
            (x, x * area, f64::from(b.normal[k]) * area)
        };
        let mut one = Self {
            change: b.delta,
            magnitude: b.delta.abs(),
            weighted: area * b.delta,
            area,
            count: 1,
            ..Self::default()
        };
        for k in 0..3 {
            (one.position[k], one.weighted_position[k], one.normal[k]) = terms(k);
        }
        self.join(&one);
    }

    pub fn join(&mut self, other: &Self) {
        self.change += other.change;
        self.magnitude += other.magnitude;
        self.weighted += other.weighted;
        self.area += other.area;
        self.count += other.count;
        for k in 0..3 {
            self.position[k] += other.position[k];
            self.weighted_position[k] += other.weighted_position[k];
            self.normal[k] += other.normal[k];
        }
    }
}

/// A component of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Component {
    /// Lowest vertex.
    pub id: u32,
    pub sign: i8,
    pub material: u16,
    pub sums: Sums,
}

/// Finds the components of each frame.
#[derive(Clone, Debug)]
pub(super) struct Components {
    /// Union-find parent of each labelled vertex.
    parent: Vec<u32>,
    /// Index in `found` of the component of each labelled vertex.
    index: Vec<u32>,
    /// Vertices with a label, in ascending order.
    pub labelled: Vec<u32>,
    pub found: Vec<Component>,
}

impl Components {
    pub fn new(vertices: usize) -> Self {
        Self {
            parent: vec![0; vertices],
            index: vec![0; vertices],
            labelled: Vec::with_capacity(vertices),
            found: Vec::with_capacity(vertices),
        }
    }

    /// Returns the index in `found` of the component of a labelled vertex.
    pub fn of(&self, v: u32) -> usize {
        self.index[v as usize] as usize
    }

    /// Joins neighbours of the same label and material, by union-find with the lowest vertex as root.
    ///
    /// # Complexity
    /// O(V) for the labels, and O(n) for n labelled vertices and their edges. No allocation.
    pub fn find(&mut self, frame: &[Buckle], mesh: &OneRings, materials: &[u16]) {
        self.labelled.clear();
        self.found.clear();
        let labelled = frame.iter().zip(0..).filter(|(b, _)| b.label != 0).map(|(_, v)| v);
        self.labelled.extend(labelled);
        self.labelled.iter().for_each(|&v| self.parent[v as usize] = v);
        let material = |v: u32| materials.get(v as usize).copied().unwrap_or(0);
        for &v in &self.labelled {
            let label = frame[v as usize].label;
            for &w in mesh.of(v).iter().filter(|&&w| w < v) {
                if frame[w as usize].label == label && material(w) == material(v) {
                    join(&mut self.parent, v, w);
                }
            }
        }
        for &v in &self.labelled {
            let root = root(&mut self.parent, v);
            // The root is the lowest vertex of its component, so its index is set before it is read for the others.
            if root == v {
                self.index[v as usize] = self.found.len() as u32;
                let sign = frame[v as usize].label;
                self.found.push(Component { id: v, sign, material: material(v), sums: Sums::default() });
            } else {
                self.index[v as usize] = self.index[root as usize];
            }
            let index = self.of(v);
            self.found[index].sums.add(&frame[v as usize]);
        }
    }
}

/// Returns the root of a vertex, halving its path.
fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        let grandparent = parent[parent[v as usize] as usize];
        parent[v as usize] = grandparent;
        v = grandparent;
    }
    v
}

fn join(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}
