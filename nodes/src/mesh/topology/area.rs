//! Areas of triangles and of vertices.

/// Twice the area of a triangle: the length of the cross product of two of its sides.
pub(super) fn doubled_area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let (u, v): ([f64; 3], [f64; 3]) =
        (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    n.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Barycentric area of each vertex in m^2: a third of the area of each of its triangles.
///
/// Triangles that name an absent vertex are skipped.
///
/// # Complexity
/// O(V + T).
#[must_use]
pub fn vertex_areas(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<f32> {
    let mut areas = vec![0.0f64; positions.len()];
    for t in triangles.iter().filter(|t| t.iter().all(|&v| (v as usize) < positions.len())) {
        let third = doubled_area(t.map(|v| positions[v as usize].map(f64::from))) / 6.0;
        t.iter().for_each(|&v| areas[v as usize] += third);
    }
    areas.into_iter().map(|a| a as f32).collect()
}
