//! The upward axis of a file.

use std::ops::Neg;

/// The axis that points upward in a file. By convention it is Y in Alembic and glTF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpAxis {
    /// Y points upward.
    Y,
    /// Z points upward.
    Z,
}

impl UpAxis {
    /// Rotates positions by 90 degrees about x so that `to` points upward; the winding does not change.
    pub fn convert(self, to: Self, positions: &mut [[f32; 3]]) {
        if self != to {
            positions.iter_mut().for_each(|p| *p = self.rotated(to, *p));
        }
    }

    /// Rotates a vector by 90 degrees about x so that `to` points upward.
    pub(crate) fn rotated<T: Neg<Output = T>>(self, to: Self, [x, y, z]: [T; 3]) -> [T; 3] {
        match (self, to) {
            (Self::Y, Self::Z) => [x, -z, y],
            (Self::Z, Self::Y) => [x, z, -y],
            _ => [x, y, z],
        }
    }

    /// Front and top of an object in its own axes: z and y if Y points upward, as in glTF and BVH, x and z if Z does, as in the scene.
    pub(crate) fn front_and_top(self) -> [[f64; 3]; 2] {
        match self {
            Self::Y => [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
            Self::Z => [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn converting_the_up_axis_and_back_changes_nothing() {
        let p = [[1.0, 2.0, 3.0], [-4.0, 0.5, 6.0]];
        let mut q = p;
        UpAxis::Y.convert(UpAxis::Z, &mut q);
        assert_eq!(q[0], [1.0, -3.0, 2.0]);
        UpAxis::Z.convert(UpAxis::Y, &mut q);
        assert_eq!(q, p);
    }
}
