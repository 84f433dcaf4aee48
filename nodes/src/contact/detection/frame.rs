//! Positions of all surfaces at one time.

use crate::contact::error::ContactError;

/// Positions of all surfaces at one time.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    pub cloth: &'a [[f32; 3]],
    pub others: &'a [&'a [[f32; 3]]],
}

impl<'a> Frame<'a> {
    #[inline]
    pub fn surface(&self, surface: usize) -> &'a [[f32; 3]] {
        if surface == 0 { self.cloth } else { self.others[surface - 1] }
    }

    /// Position of a cloth vertex.
    #[inline]
    pub fn vertex(&self, v: usize) -> [f32; 3] {
        self.cloth[v]
    }

    #[inline]
    pub fn triangle(&self, surface: usize, corners: [u32; 3]) -> [[f32; 3]; 3] {
        let positions = self.surface(surface);
        let [a, b, c] = corners;
        [positions[a as usize], positions[b as usize], positions[c as usize]]
    }
}

/// Largest coordinate of a vertex, m: the squares of distances stay finite in single precision.
const MAX_COORDINATE: f32 = 1e15;

/// Checks that all positions of a surface are finite and within 1e15 m.
///
/// # Errors
/// [`ContactError::NotFinite`] for the first vertex that is not.
pub(in crate::contact) fn check_finite(surface: usize, positions: &[[f32; 3]]) -> Result<(), ContactError> {
    // No branch between the coordinates: this runs for each vertex of each frame.
    let in_range = |p: &[f32; 3]| {
        (p[0].abs() <= MAX_COORDINATE) & (p[1].abs() <= MAX_COORDINATE) & (p[2].abs() <= MAX_COORDINATE)
    };
    match positions.iter().position(|p| !in_range(p)) {
        Some(vertex) => Err(ContactError::NotFinite { surface, vertex }),
        None => Ok(()),
    }
}
