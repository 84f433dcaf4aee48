//! Connected vertices that snap to the same side in one frame.

use crate::crumple::buckling::Buckle;
use crate::mesh::{MeshError, MeshPrepare, Topology};
use serde::{Deserialize, Serialize};

/// Neighbours of each vertex along the edges of a mesh.
#[derive(Clone, Debug)]
pub(super) struct Neighbours {
    starts: Vec<u32>,
    of: Vec<u32>,
}

impl Neighbours {
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

    pub fn of(&self, v: u32) -> &[u32] {
        &self.of[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }

    pub fn vertices(&self) -> usize {
        self.starts.len() - 1
    }
}

/// What the vertices of a component add up to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Sums {
    /// Change of curvature, 1/m, and its length, which is the same where all have one sign.
    pub change: f64,
    pub length: f64,
    /// Area times change, m.
    pub weighted: f64,
    pub area: f64,
    pub count: u32,
    /// Positions, and positions times area.
    pub place: [f64; 3],
    pub weighted_place: [f64; 3],
    pub normal: [f64; 3],
}

impl Sums {
    pub fn add(&mut self, b: &Buckle) {
        let area = b.area;
        let of = |k: usize| {
            let x = f64::from(b.position[k]);
            (x, x * area, f64::from(b.normal[k]) * area)
        };
        let mut one = Self {
            change: b.delta,
            length: b.delta.abs(),
            weighted: area * b.delta,
            area,
            count: 1,
            ..Self::default()
        };
        for k in 0..3 {
            (one.place[k], one.weighted_place[k], one.normal[k]) = of(k);
        }
        self.join(&one);
    }

    pub fn join(&mut self, other: &Self) {
        self.change += other.change;
        self.length += other.length;
        self.weighted += other.weighted;
        self.area += other.area;
        self.count += other.count;
        for k in 0..3 {
            self.place[k] += other.place[k];
            self.weighted_place[k] += other.weighted_place[k];
            self.normal[k] += other.normal[k];
        }
    }
}

/// A component of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Component {
    /// Its lowest vertex.
    pub id: u32,
    pub sign: i8,
    pub material: u16,
    pub sums: Sums,
}

/// Finds the components of frame after frame.
#[derive(Clone, Debug)]
pub(super) struct Components {
    /// Leader of each labelled vertex.
    leader: Vec<u32>,
    /// Place in `found` of the component of each labelled vertex.
    place: Vec<u32>,
    /// Vertices with a label, lowest first.
    pub labelled: Vec<u32>,
    pub found: Vec<Component>,
}

impl Components {
    pub fn new(vertices: usize) -> Self {
        let room = Vec::with_capacity(vertices);
        Self {
            leader: vec![0; vertices],
            place: vec![0; vertices],
            labelled: room,
            found: Vec::with_capacity(vertices),
        }
    }

    /// The place in `found` of the component of a labelled vertex.
    pub fn of(&self, v: u32) -> usize {
        self.place[v as usize] as usize
    }

    /// Joins neighbours of the same label and material, by union-find with the lowest vertex leading.
    ///
    /// # Complexity
    /// O(V) for the labels, and O(n) for n vertices that have one and their edges. Nothing is allocated.
    pub fn find(&mut self, frame: &[Buckle], mesh: &Neighbours, materials: &[u16]) {
        self.labelled.clear();
        self.found.clear();
        let labelled = frame.iter().zip(0..).filter(|(b, _)| b.label != 0).map(|(_, v)| v);
        self.labelled.extend(labelled);
        self.labelled.iter().for_each(|&v| self.leader[v as usize] = v);
        let material = |v: u32| materials.get(v as usize).copied().unwrap_or(0);
        for &v in &self.labelled {
            let label = frame[v as usize].label;
            for &w in mesh.of(v).iter().filter(|&&w| w < v) {
                if frame[w as usize].label == label && material(w) == material(v) {
                    join(&mut self.leader, v, w);
                }
            }
        }
        for &v in &self.labelled {
            let root = root(&mut self.leader, v);
            // A leader is the lowest of its component, so its place is known before others ask for it.
            if root == v {
                self.place[v as usize] = self.found.len() as u32;
                let sign = frame[v as usize].label;
                self.found.push(Component { id: v, sign, material: material(v), sums: Sums::default() });
            } else {
                self.place[v as usize] = self.place[root as usize];
            }
            let place = self.of(v);
            self.found[place].sums.add(&frame[v as usize]);
        }
    }
}

fn root(leader: &mut [u32], mut v: u32) -> u32 {
    while leader[v as usize] != v {
        let up = leader[leader[v as usize] as usize];
        leader[v as usize] = up;
        v = up;
    }
    v
}

fn join(leader: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(leader, a), root(leader, b));
    leader[a.max(b) as usize] = a.min(b);
}
