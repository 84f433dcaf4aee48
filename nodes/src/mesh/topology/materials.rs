//! Materials of the triangles of a mesh.

use serde::{Deserialize, Serialize};

use super::Topology;
use super::area::doubled_area;

/// The material of each triangle, by name.
///
/// Without names, all triangles have one unnamed material.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Materials {
    names: Vec<String>,
    /// One index into `names` per triangle; empty if all triangles have the first material.
    triangles: Vec<u16>,
}

impl Materials {
    /// One named material for all triangles.
    #[must_use]
    pub fn one(name: &str) -> Self {
        Self { names: vec![name.to_owned()], triangles: Vec::new() }
    }

    /// Appends a triangle of a material. After 65,536 names, further names count as the last one.
    ///
    /// # Complexity
    /// O(1) after a triangle of the same material, otherwise O(names).
    pub fn push(&mut self, name: &str) {
        let last = self.triangles.last().copied().unwrap_or(0);
        if self.name(last) == name && !self.names.is_empty() {
            return self.triangles.push(last);
        }
        let index = self.names.iter().position(|known| known == name).unwrap_or_else(|| {
            if self.names.len() <= usize::from(u16::MAX) {
                self.names.push(name.to_owned());
            }
            self.names.len() - 1
        });
        self.triangles.push(index as u16);
    }

    /// Replaces the empty name by `name`; without names, all triangles get `name`.
    #[must_use]
    pub fn with_default_name(mut self, name: &str) -> Self {
        if self.names.is_empty() {
            return Self::one(name);
        }
        self.names.iter_mut().filter(|n| n.is_empty()).for_each(|n| name.clone_into(n));
        self
    }

    /// All names; a material is the index of its name.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Name of a material; empty for an unnamed or unknown material.
    #[must_use]
    pub fn name(&self, material: u16) -> &str {
        self.names.get(usize::from(material)).map_or("", String::as_str)
    }

    /// Material of a triangle.
    #[must_use]
    pub fn of_triangle(&self, triangle: u32) -> u16 {
        self.triangles.get(triangle as usize).copied().unwrap_or(0)
    }

    /// Material of each vertex: the one with the largest area among its triangles; on a tie, the lower index.
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
        let mut areas_by_vertex: Vec<Vec<(u16, f64)>> = vec![Vec::new(); vertices];
        for (triangle, corners) in (0..).zip(&topology.triangles) {
            let material = self.of_triangle(triangle);
            // The positions of absent vertices count as the origin.
            let position = |c: u32| topology.rest.get(c as usize).copied().unwrap_or_default();
            let area = doubled_area(corners.map(|c| position(c).map(f64::from)));
            for &corner in corners {
                let Some(areas) = areas_by_vertex.get_mut(corner as usize) else { continue };
                match areas.iter_mut().find(|(known, _)| *known == material) {
                    Some((_, sum)) => *sum += area,
                    None => areas.push((material, area)),
                }
            }
        }
        let largest = |areas: Vec<(u16, f64)>| {
            let by_area = |a: &(u16, f64), b: &(u16, f64)| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0));
            areas.into_iter().max_by(by_area).map_or(0, |(material, _)| material)
        };
        areas_by_vertex.into_iter().map(largest).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_has_the_material_of_the_largest_area_around_it() {
        let topology = Topology {
            rest: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.5, 0.0, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let mut materials = Materials::default();
        materials.push("");
        materials.push("silk");
        assert_eq!(materials.of_vertices(&topology), [0, 0, 0, 1]);
        let named = materials.with_default_name("cotton");
        assert_eq!((named.names(), named.of_triangle(1)), (&["cotton".to_owned(), "silk".to_owned()][..], 1));
        assert_eq!(Materials::default().with_default_name("wool"), Materials::one("wool"));
        assert_eq!(Materials::one("wool").of_vertices(&topology), [0; 4]);
    }

    #[test]
    fn each_name_is_stored_once() {
        let mut materials = Materials::default();
        for name in ["a", "b", "a", "a", "c"] {
            materials.push(name);
        }
        assert_eq!(materials.names(), ["a", "b", "c"]);
        assert_eq!((0..5).map(|t| materials.of_triangle(t)).collect::<Vec<_>>(), [0, 1, 0, 0, 2]);
        assert_eq!((materials.of_triangle(99), materials.name(7)), (0, ""));
    }
}
