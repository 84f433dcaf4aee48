//! Contact points of a bank that move over the surface of the object.

use super::resonators::Bank;
use crate::impl_state;
use crate::modal::surface::mode_shapes::ModeShapes;
use crate::modal::surface::surface_index::SurfaceIndex;
use std::sync::Arc;

/// The positions of the contact points of a bank, and the shapes that give their gains.
#[derive(Debug)]
pub(super) struct MovingPoints {
    shapes: Arc<ModeShapes>,
    index: SurfaceIndex,
    /// Latest position of each point, m; none before its first.
    positions: Vec<Option<[f32; 3]>>,
    /// Scratch space, one number per mode.
    modal: Vec<f64>,
    gains: Vec<f32>,
}
impl_state!(MovingPoints { positions });

impl MovingPoints {
    pub fn new(shapes: Arc<ModeShapes>, points: usize) -> Self {
        let modes = shapes.len();
        let index = SurfaceIndex::new(shapes.surface());
        Self {
            index,
            positions: vec![None; points],
            modal: vec![0.0; modes],
            gains: vec![0.0; modes],
            shapes,
        }
    }

    /// Moves a point to the point of the surface that is nearest to a position.
    pub fn set(&mut self, bank: &mut Bank, point: usize, position: [f32; 3]) {
        let Some(stored) = self.positions.get_mut(point) else { return };
        let Some((contact, _)) = self.index.nearest(self.shapes.surface(), position.map(f64::from)) else {
            return;
        };
        *stored = Some(position);
        self.shapes.gains_at(&contact, &mut self.modal, &mut self.gains);
        bank.move_point(point, &self.gains);
    }

    /// Moves the points to their former positions on an object of the same or of another shape.
    pub fn take_state(&mut self, bank: &mut Bank, old: &Self) {
        for (point, position) in old.positions.iter().enumerate() {
            if let Some(position) = position {
                self.set(bank, point, *position);
            }
        }
    }
}
