//! Affine transforms of column vectors in f64; in a product the transform of the parent stands on the left.

/// Rows of a 3 by 4 matrix: the linear part and the translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine(pub(super) [[f64; 4]; 3]);

impl Affine {
    pub(super) const IDENTITY: Self =
        Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    pub(super) fn translation(t: [f64; 3]) -> Self {
        let mut m = Self::IDENTITY;
        (0..3).for_each(|r| m.0[r][3] = t[r]);
        m
    }

    pub(super) fn scale(s: [f64; 3]) -> Self {
        let mut m = Self::IDENTITY;
        (0..3).for_each(|r| m.0[r][r] = s[r]);
        m
    }

    /// Rotation by a quaternion (x, y, z, w) of any length.
    pub(super) fn rotation(q: [f64; 4]) -> Self {
        let norm = q.iter().map(|x| x * x).sum::<f64>();
        if norm.is_nan() || norm <= 0.0 {
            return Self::IDENTITY;
        }
        let s = 2.0 / norm;
        let [x, y, z, w] = q;
        Self([
            [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w), 0.0],
            [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w), 0.0],
            [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y), 0.0],
        ])
    }

    /// Right-handed rotation about an axis of any length.
    pub(super) fn axis_angle(axis: [f64; 3], radians: f64) -> Self {
        let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length.is_nan() || length <= 0.0 {
            return Self::IDENTITY;
        }
        let (s, c) = (libm::sin(radians / 2.0) / length, libm::cos(radians / 2.0));
        Self::rotation([axis[0] * s, axis[1] * s, axis[2] * s, c])
    }

    /// The product `self * inner`: applies `inner` first.
    pub(super) fn product(&self, inner: &Self) -> Self {
        let mut m = [[0.0; 4]; 3];
        for (r, row) in m.iter_mut().enumerate() {
            for (c, x) in row.iter_mut().enumerate() {
                *x = (0..3).map(|k| self.0[r][k] * inner.0[k][c]).sum::<f64>();
            }
            row[3] += self.0[r][3];
        }
        Self(m)
    }

    pub(super) fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        self.0.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    }

    /// Transform of a direction: without the translation.
    pub(super) fn direction(&self, v: [f64; 3]) -> [f64; 3] {
        self.0.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2])
    }

    pub(super) fn is_finite(&self) -> bool {
        self.0.as_flattened().iter().all(|x| x.is_finite())
    }

    pub(super) fn determinant(&self) -> f64 {
        let [a, b, c] = self.0;
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_by_90_degrees_about_z_maps_x_to_y() {
        let p = Affine::axis_angle([0.0, 0.0, 2.0], std::f64::consts::FRAC_PI_2).apply([1.0, 0.0, 0.0]);
        assert!((p[0]).abs() < 1e-15 && (p[1] - 1.0).abs() < 1e-15 && p[2] == 0.0, "{p:?}");
    }

    #[test]
    fn a_product_applies_the_right_factor_first() {
        let m = Affine::translation([1.0, 2.0, 3.0]).product(&Affine::scale([2.0, 2.0, 2.0]));
        assert_eq!(m.apply([1.0, 1.0, 1.0]), [3.0, 4.0, 5.0]);
        assert_eq!(m.determinant(), 8.0);
    }
}
