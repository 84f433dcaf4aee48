//! Closed surfaces of triangles, from OBJ, STL and PLY.

use crate::contact::vector::{cross, dot, norm, sub};
use crate::mesh::{MeshLimits, ObjMesh, ReadOptions};
use std::collections::HashMap;
use thiserror::Error;

/// Maximum number of triangles.
const MAX_TRIANGLES: usize = 1 << 24;

/// Triangles that enclose a volume, anticlockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedSurface {
    /// Vertices, m; none twice.
    pub vertices: Vec<[f64; 3]>,
    /// Triangles over them.
    pub triangles: Vec<[u32; 3]>,
}

/// Error in a surface.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// A file that cannot be read.
    #[error("{0}")]
    File(String),
    /// A surface with holes, or with edges of three triangles.
    #[error(
        "the surface is not closed: {open} of {edges} edges do not belong to two triangles of opposite directions: close its holes"
    )]
    Open {
        /// Number of such edges.
        open: usize,
        /// Number of edges.
        edges: usize,
    },
    /// Walls that are too thin for the cells.
    #[error(
        "walls are {thickness:.5} m thick (5 % are thinner), {cells:.1} cells; {needed} are needed: raise `cells`, or make a tetrahedral mesh"
    )]
    ThinWall {
        /// Fifth percentile of the thickness, m.
        thickness: f64,
        /// The same in cells.
        cells: f64,
        /// The required number of cells.
        needed: usize,
    },
    /// Cells of another volume than the surface.
    #[error(
        "the cells have a volume of {cells:e} m^3, the surface one of {surface:e} m^3: it intersects itself, or `cells` is too small"
    )]
    Volume {
        /// Volume of the cells, m^3.
        cells: f64,
        /// Volume of the surface, m^3.
        surface: f64,
    },
    /// No cell inside.
    #[error("no cell lies inside of the surface: raise `cells`")]
    Empty,
}

impl ClosedSurface {
    /// Reads OBJ, STL or PLY, recognised by the content.
    ///
    /// # Errors
    /// A file in none of these formats, or a damaged one, and the errors of [`new`](Self::new).
    pub fn read(bytes: &[u8], scale: f64) -> Result<Self, SurfaceError> {
        let (positions, triangles) = match stl(bytes)? {
            Some(found) => found,
            None => {
                let failed = |e: crate::mesh::MeshError| SurfaceError::File(e.to_string());
                let mesh = ObjMesh::parse(bytes, None, &MeshLimits::default()).map_err(failed)?;
                let (topology, _) = mesh.topology(&ReadOptions::default()).map_err(failed)?;
                (mesh.positions, topology.triangles)
            }
        };
        Self::new(positions.into_iter().map(|p| p.map(|x| x * scale)).collect(), triangles)
    }

    /// Creates a surface of triangles. Vertices at the same position become one, and a surface that is inside out is reversed.
    ///
    /// # Errors
    /// The number of open edges.
    pub fn new(positions: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, SurfaceError> {
        let mut vertices = Vec::new();
        let mut index = HashMap::with_capacity(positions.len());
        let mut number = Vec::with_capacity(positions.len());
        for (k, p) in positions.iter().enumerate() {
            if !p.iter().all(|x| x.abs() <= 1e6) {
                return Err(SurfaceError::File(format!("vertex {k} is not finite or beyond 1e6 m")));
            }
            // Adding 0 makes -0 and 0 the same bits.
            let key = p.map(|x| (x + 0.0).to_bits());
            number.push(*index.entry(key).or_insert_with(|| {
                vertices.push(*p);
                vertices.len() as u32 - 1
            }));
        }
        let mut welded = Vec::with_capacity(triangles.len());
        for t in triangles {
            let named = t.map(|c| number.get(c as usize).copied());
            let [Some(a), Some(b), Some(c)] = named else {
                return Err(SurfaceError::File(format!(
                    "a triangle names vertex {}",
                    t.iter().max().unwrap_or(&0)
                )));
            };
            if a != b && b != c && c != a {
                welded.push([a, b, c]);
            }
        }
        let mut surface = Self { vertices, triangles: welded };
        surface.closed()?;
        if surface.volume() < 0.0 {
            surface.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        Ok(surface)
    }

    fn closed(&self) -> Result<(), SurfaceError> {
        let mut edges: HashMap<[u32; 2], (u32, u32)> = HashMap::new();
        for [a, b, c] in &self.triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                let count = edges.entry([from.min(to), from.max(to)]).or_default();
                if from < to { count.0 += 1 } else { count.1 += 1 }
            }
        }
        let open = edges.values().filter(|count| **count != (1, 1)).count();
        if open > 0 || edges.is_empty() {
            return Err(SurfaceError::Open { open, edges: edges.len() });
        }
        Ok(())
    }

    /// Positions of the corners of a triangle.
    #[must_use]
    pub fn corners(&self, triangle: &[u32; 3]) -> [[f64; 3]; 3] {
        triangle.map(|c| self.vertices[c as usize])
    }

    /// Volume, m^3.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let part = |t: &[u32; 3]| {
            let [a, b, c] = self.corners(t);
            dot(a, cross(b, c)) / 6.0
        };
        self.triangles.iter().map(part).sum()
    }

    /// Thickness of the wall, m, below which 5 % of the surface lie: rays go inwards from the middle of up to `rays` triangles.
    #[must_use]
    pub fn thickness(&self, rays: usize) -> f64 {
        let step = self.triangles.len().div_ceil(rays.max(1)).max(1);
        let mut found: Vec<(f64, f64)> = Vec::new();
        for triangle in self.triangles.iter().step_by(step) {
            let [a, b, c] = self.corners(triangle);
            let normal = cross(sub(b, a), sub(c, a));
            let area = norm(normal);
            if area <= 0.0 {
                continue;
            }
            let inwards = normal.map(|x| -x / area);
            let from: [f64; 3] = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
            let others = self.triangles.iter().filter(|t| *t != triangle);
            let nearest =
                others.filter_map(|t| hit(from, inwards, self.corners(t))).fold(f64::INFINITY, f64::min);
            found.push((nearest, area));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = found.iter().map(|f| f.1).sum();
        let mut sum = 0.0;
        let at = found.iter().find(|f| {
            sum += f.1;
            sum >= 0.05 * total
        });
        at.map_or(f64::INFINITY, |f| f.0)
    }
}

/// Distance at which a ray goes through a triangle.
///
/// # Source
/// Moller and Trumbore, "Fast, minimum storage ray-triangle intersection" (J. Graphics Tools 2, 1997).
fn hit(from: [f64; 3], direction: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> Option<f64> {
    let (e1, e2) = (sub(b, a), sub(c, a));
    let p = cross(direction, e2);
    let determinant = dot(e1, p);
    if determinant == 0.0 {
        return None;
    }
    let t = sub(from, a);
    let u = dot(t, p) / determinant;
    let q = cross(t, e1);
    let v = dot(direction, q) / determinant;
    let distance = dot(e2, q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}

type Triangles = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// The triangles of an STL file, ASCII or binary; `None` if it is none.
fn stl(bytes: &[u8]) -> Result<Option<Triangles>, SurfaceError> {
    let mut positions = Vec::new();
    let count = bytes.get(80..84).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    if count.is_some_and(|n| n > 0 && n <= MAX_TRIANGLES && bytes.len() == 84 + 50 * n) {
        for record in bytes[84..].chunks_exact(50) {
            let mut numbers =
                record[12..48].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            for _ in 0..3 {
                positions.push([0.0; 3].map(|_: f64| numbers.next().map_or(0.0, f64::from)));
            }
        }
    } else if bytes.trim_ascii_start().starts_with(b"solid") {
        for (k, line) in bytes.split(|b| *b == b'\n').enumerate() {
            let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
            if words.next() != Some(b"vertex") {
                continue;
            }
            let mut p = [0.0; 3];
            for x in &mut p {
                let text = words.next().and_then(|w| std::str::from_utf8(w).ok());
                let number = text.and_then(|t| t.parse().ok());
                *x = number.ok_or_else(|| {
                    SurfaceError::File(format!("line {}: three numbers are needed after `vertex`", k + 1))
                })?;
            }
            positions.push(p);
        }
    } else {
        return Ok(None);
    }
    if !positions.len().is_multiple_of(3) {
        return Err(SurfaceError::File(format!(
            "{} vertices are no whole number of triangles",
            positions.len()
        )));
    }
    let triangles = (0..positions.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    Ok(Some((positions, triangles)))
}
