//! What travels between the nodes of rigid contacts.

use crate::core::item::Event;
use crate::core::random::Rng;
use crate::core::time::{Tick, ticks};
use serde::{Deserialize, Serialize};

/// One contact of two bodies during one frame of the physics.
///
/// All in SI units. It holds no memory of its own, so that it may cross into the audio thread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactFrame {
    /// Which contact: the same number for as long as it lasts.
    pub contact: u64,
    /// Numbers of body a and body b; 0 is the first of the names given, or the world.
    pub bodies: [u32; 2],
    /// Ticks from the frame before, or the expected ones of the first.
    pub interval: Tick,
    /// Where, in the world, m.
    pub point: [f64; 3],
    /// The same in the frames of body a and of body b, m; a body of unknown pose lies at the origin of the world.
    pub local: [[f64; 3]; 2],
    /// Unit normal from a to b.
    pub normal: [f32; 3],
    /// Normal force, at least 0, N.
    pub force: f32,
    /// Friction on b, where the engine tells, N.
    pub friction: Option<[f32; 3]>,
    /// Velocity of b relative to a at the point, m/s.
    pub velocity: [f32; 3],
    /// Velocity of the contact point over the surface of a, and over that of b, where it is known, m/s in the world.
    pub travel: [Option<[f32; 3]>; 2],
    /// Fastest approach along the normal within the frame, where the engine tells, m/s, at least 0.
    pub approach: Option<f32>,
    /// Effective mass of the pair, where it is known, kg.
    pub mass: Option<f32>,
    /// The first frame of the contact.
    pub begins: bool,
    /// The contact has ended with this frame; its force is 0 from here on.
    pub ends: bool,
}

/// What kind of contact it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Too short or too unsteady to be any of the others.
    #[default]
    Unsteady,
    /// Held without moving: silent.
    Static,
    /// One surface slips over the other.
    Sliding,
    /// The contact point moves over both surfaces without slip.
    Rolling,
    /// Between rolling and sliding.
    Mixed,
}

/// A frame of a contact and what was found of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactState {
    /// The frame.
    pub frame: ContactFrame,
    /// What kind of contact it is.
    pub state: State,
    /// How much of it is slip: 1 sliding, 0 rolling.
    pub slip: f32,
    /// Power that the contact turns into sound and heat, W.
    pub power: f32,
    /// Amplitude that follows from the power: 1 at the reference.
    pub gain: f32,
    /// Speed of slip, m/s.
    pub sliding: f32,
    /// Speed of the contact point over surface a, m/s.
    pub rolling: f32,
    /// Standard deviation over mean of force and of speed, by which it is steady or not; 0 in the first frames, in which they are not known.
    pub variation: [f32; 2],
    /// How far its mean force stands out from the least before, N, by which it is a blow or not.
    pub prominence: f32,
    /// Median of its mean force before, by which it has to stand out at least, N.
    pub median: f32,
}

impl Event for ContactFrame {
    const NAME: &'static str = "contacts";

    fn trial(rng: &mut Rng) -> Self {
        let mut triple = |size: f64| [(); 3].map(|()| rng.between(-size, size));
        let (point, velocity) = (triple(1.0), triple(2.0).map(|x| x as f32));
        let travel = [Some(velocity), None];
        Self {
            contact: rng.below(3) as u64,
            bodies: [0, 1 + rng.below(2) as u32],
            interval: ticks(1.0 / 60.0),
            point,
            local: [point; 2],
            normal: [0.0, 0.0, 1.0],
            force: rng.between(0.0, 50.0) as f32,
            friction: None,
            velocity,
            travel,
            approach: None,
            mass: None,
            begins: rng.below(8) == 0,
            ends: rng.below(8) == 0,
        }
    }
}

impl Event for ContactState {
    const NAME: &'static str = "classified contacts";

    fn trial(rng: &mut Rng) -> Self {
        let states = [State::Unsteady, State::Static, State::Sliding, State::Rolling, State::Mixed];
        Self {
            frame: ContactFrame::trial(rng),
            state: states[rng.below(5)],
            slip: rng.uniform() as f32,
            power: rng.between(0.0, 10.0) as f32,
            gain: rng.uniform() as f32,
            sliding: rng.between(0.0, 2.0) as f32,
            rolling: rng.between(0.0, 2.0) as f32,
            variation: [(); 2].map(|()| rng.uniform() as f32),
            prominence: rng.between(0.0, 50.0) as f32,
            median: rng.between(0.0, 50.0) as f32,
        }
    }
}
