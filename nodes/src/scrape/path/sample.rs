//! A contact at one frame of the physics, and the rules by which its path continues from there.

use crate::core::time::Tick;
use serde::{Deserialize, Serialize};

/// A contact at one frame, seen on a plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactSample {
    /// Number of the contact.
    pub contact: u64,
    /// Time.
    pub tick: Tick,
    /// Position, m.
    #[serde(rename = "place")]
    pub position: [f64; 2],
    /// Velocity over the surface, if it is known, m/s.
    pub velocity: Option<[f64; 2]>,
    /// Position on the other surface, if it is wanted, m.
    pub other: Option<[f64; 2]>,
    /// Normal force, N.
    pub force: f32,
    /// Amplitude by the kind of contact.
    pub gain: f32,
    /// Effective mass of the pair, kg, if known.
    pub mass: Option<f32>,
    /// The first frame of a contact.
    pub begins: bool,
    /// The contact has ended.
    pub ends: bool,
}

/// Rules for the path between frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRules {
    /// Time from one frame to the next that is expected.
    pub frame: Tick,
    /// True if a path is known before its end; otherwise it is predicted, and corrected over the next frame.
    pub look_ahead: bool,
    /// True if velocities come from the positions before and after, one frame later, in place of the reported ones.
    pub differences: bool,
    /// True to replace a path by a straight line if its velocities are too large.
    pub guard: bool,
    /// Distance from the expected position beyond which a contact has jumped, m.
    pub teleport: f64,
    /// Number of the object in the pieces.
    pub object: u32,
    /// Time constant of a low-pass over positions and velocities, s; 0 for none.
    pub smooth: f64,
}

impl PathRules {
    /// Delay after a frame at which its path is known.
    #[must_use]
    pub fn latency(&self) -> Tick {
        // A hundredth for frames that come a little late.
        let frames = i64::from(self.look_ahead) * (1 + i64::from(self.differences));
        frames * (self.frame + self.frame / 100)
    }

    /// Time after the last frame at which a contact without frames becomes silent.
    #[must_use]
    pub fn stall(&self) -> Tick {
        2 * self.frame
    }
}
