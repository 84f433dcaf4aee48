//! What the triangles of a mesh are made of.

use serde::{Deserialize, Serialize};

use super::Topology;

/// The material of each triangle, by name.
///
/// Without any names, all is of one unnamed material.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Materials {
    names: Vec<String>,
    /// One index per triangle, or nothing where all are of the first.
    triangles: Vec<u16>,
}

impl Materials {
    /// One material for every triangle.
    #[must_use]
    pub fn one(name: &str) -> Self {
        Self { names: vec![name.to_owned()], triangles: Vec::new() }
    }

    /// Adds a triangle of a material. Of more than 65,536 names all further ones count as the last.
    ///
    /// # Complexity
    /// O(1) after a triangle of the same material, otherwise O(names).
    pub fn push(&mut self, name: &str) {
        let last = self.triangles.last().copied().unwrap_or(0);
        if self.name(last) == name && !self.names.is_empty() {
            return self.triangles.push(last);
        }
        let place = self.names.iter().position(|known| known == name).unwrap_or_else(|| {
            if self.names.len() <= usize::from(u16::MAX) {
                self.names.push(name.to_owned());
            }
            self.names.len() - 1
        });
        self.triangles.push(place as u16);
    }

    /// The same with another name in place of the empty one.
    #[must_use]
    pub fn or_named(mut self, name: &str) -> Self {
        if self.names.is_empty() {
            return Self::one(name);
        }
        self.names.iter_mut().filter(|n| n.is_empty()).for_each(|n| name.clone_into(n));
        self
    }

    /// All names; the index of a name is its material.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The name of a material; empty where it has none.
    #[must_use]
    pub fn name(&self, material: u16) -> &str {
        self.names.get(usize::from(material)).map_or("", String::as_str)
    }

    /// The material of a triangle.
    #[must_use]
    pub fn of_triangle(&self, triangle: u32) -> u16 {
        self.triangles.get(triangle as usize).copied().unwrap_or(0)
    }

    /// The material that most of the area around each vertex is of; of equals the first.
    ///
    /// # Shapes
    /// One material per vertex of `topology`.
    ///
    /// # Complexity
    /// O(V + F), and O(names) per vertex.
    #[must_use]
    pub fn of_vertices(&self, topology: &Topology) -> Vec<u16> {
        let vertices = topology.vertex_count();
        if self.names.len() < 2 || self.triangles.is_empty() {
            return vec![0; vertices];
        }
        let mut around: Vec<Vec<(u16, f64)>> = vec![Vec::new(); vertices];
        for (triangle, corners) in (0..).zip(&topology.triangles) {
            let material = self.of_triangle(triangle);
            let area = area(&topology.rest, *corners);
            for &corner in corners {
                let Some(shares) = around.get_mut(corner as usize) else { continue };
                match shares.iter_mut().find(|(known, _)| *known == material) {
                    Some((_, sum)) => *sum += area,
                    None => shares.push((material, area)),
                }
            }
        }
        let most = |shares: Vec<(u16, f64)>| {
            let larger = |a: &(u16, f64), b: &(u16, f64)| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0));
            shares.into_iter().max_by(larger).map_or(0, |(material, _)| material)
        };
        around.into_iter().map(most).collect()
    }
}

/// Twice the area of a triangle; 0 for one that names absent vertices.
fn area(rest: &[[f32; 3]], corners: [u32; 3]) -> f64 {
    let at = |c: u32| rest.get(c as usize).copied().unwrap_or_default().map(f64::from);
    let [a, b, c] = corners.map(at);
    let (u, v): ([f64; 3], [f64; 3]) =
        (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    n.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_part_of_the_area_around_a_vertex_names_it() {
        let topology = Topology {
            rest: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.5, 0.0, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let mut materials = Materials::default();
        materials.push("");
        materials.push("silk");
        assert_eq!(materials.of_vertices(&topology), [0, 0, 0, 1]);
        let named = materials.or_named("cotton");
        assert_eq!((named.names(), named.of_triangle(1)), (&["cotton".to_owned(), "silk".to_owned()][..], 1));
        assert_eq!(Materials::default().or_named("wool"), Materials::one("wool"));
        assert_eq!(Materials::one("wool").of_vertices(&topology), [0; 4]);
    }

    #[test]
    fn names_come_once_each() {
        let mut materials = Materials::default();
        for name in ["a", "b", "a", "a", "c"] {
            materials.push(name);
        }
        assert_eq!(materials.names(), ["a", "b", "c"]);
        assert_eq!((0..5).map(|t| materials.of_triangle(t)).collect::<Vec<_>>(), [0, 1, 0, 0, 2]);
        assert_eq!((materials.of_triangle(99), materials.name(7)), (0, ""));
    }
}
