//! What travels between the nodes of scraping.

use crate::core::item::Event;
use crate::core::random::Draw;
use crate::core::time::{Tick, ticks};
use serde::{Deserialize, Serialize};

/// The way of one contact over a surface between two frames of the physics.
///
/// It begins at the time of its event. With `s` from 0 to 1 over its duration the place is `c[0] + c[1] s + c[2] s^2 + c[3] s^3`; force
/// and gain go in a straight line. Pieces of one contact that touch in time go on smoothly; where a contact jumps, an
/// old piece fades out while a new one with another `piece` fades in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathPiece {
    /// Which contact: the same number for as long as it lasts.
    pub contact: u64,
    /// Counts the jumps of the contact: pieces of the same count join.
    pub jump: u32,
    /// Number of the object that is excited.
    pub object: u32,
    /// How long it lasts.
    pub duration: Tick,
    /// Coefficients of the place on the surface, m.
    pub place: [[f64; 2]; 4],
    /// The same on the other surface, where it is known, m.
    pub other: Option<[[f64; 2]; 4]>,
    /// Normal force at its start and end, N.
    pub force: [f32; 2],
    /// Amplitude at its start and end: fades, kinds of contact, levels of detail.
    pub gain: [f32; 2],
}

impl Event for PathPiece {
    const NAME: &'static str = "path";

    fn trial(draw: &mut Draw) -> Self {
        let mut pair = |size: f64| [draw.between(-size, size), draw.between(-size, size)];
        let place = [pair(0.5), pair(0.02), pair(0.01), pair(0.005)];
        Self {
            contact: draw.below(3) as u64,
            jump: draw.below(2) as u32,
            object: draw.below(2) as u32,
            duration: ticks(1.0 / 60.0),
            place,
            other: (draw.below(2) == 0).then_some(place),
            force: [draw.between(0.0, 20.0) as f32, draw.between(0.0, 20.0) as f32],
            gain: [draw.unit() as f32, draw.unit() as f32],
        }
    }
}
