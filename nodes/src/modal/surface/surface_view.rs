//! The surface of an object with the shapes of its modes, borrowed.

/// A surface with a displacement of each vertex in each mode, borrowed.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceView<'a> {
    /// Positions of the vertices, m.
    pub vertices: &'a [[f64; 3]],
    /// Triangles over the vertices, anticlockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Outward unit normals at the vertices.
    pub normals: &'a [[f64; 3]],
    /// Displacements, `[vertices][3][modes]`, kg^(-1/2).
    pub shapes: &'a [f32],
    /// Number of modes.
    pub modes: usize,
}

impl<'a> SurfaceView<'a> {
    /// Displacements of a vertex along an axis, by mode; empty if there is no such vertex.
    #[must_use]
    pub fn shape(self, vertex: usize, axis: usize) -> &'a [f32] {
        let first = (3 * vertex + axis) * self.modes;
        self.shapes.get(first..first + self.modes).unwrap_or_default()
    }

    /// Displacement of a vertex along its outward normal, by mode, kg^(-1/2).
    pub fn along_normal(self, vertex: usize) -> impl Iterator<Item = f64> + 'a {
        let [x, y, z] = [0, 1, 2].map(|axis| self.shape(vertex, axis));
        let n = self.normals.get(vertex).copied().unwrap_or_default();
        let along = move |((x, y), z): ((&f32, &f32), &f32)| {
            n[0] * f64::from(*x) + n[1] * f64::from(*y) + n[2] * f64::from(*z)
        };
        x.iter().zip(y).zip(z).map(along)
    }

    /// Largest edge of the bounding box, m.
    #[must_use]
    pub fn extent(self) -> f64 {
        let span = |k: usize| {
            let axis = self.vertices.iter().map(|p| p[k]);
            let (low, high) = axis.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        (0..3).map(span).fold(0.0, f64::max)
    }
}
