//! The upward axis of a file.

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
        match (self, to) {
            (Self::Y, Self::Z) => positions.iter_mut().for_each(|p| *p = [p[0], -p[2], p[1]]),
            (Self::Z, Self::Y) => positions.iter_mut().for_each(|p| *p = [p[0], p[2], -p[1]]),
            _ => {}
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
