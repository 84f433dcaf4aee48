//! Contact frames and their states, the events between nodes of rigid contacts.

use crate::core::item::Event;
use crate::core::random::Rng;
use crate::core::time::{Tick, ticks};
use serde::{Deserialize, Serialize};

/// One contact of two bodies during one frame of the physics.
///
/// All quantities are in SI units. It owns no heap memory, so that it can be sent to the audio thread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactFrame {
    /// Number of the contact, constant while it lasts.
    pub contact: u64,
    /// Numbers of body a and body b; 0 is the first of the list of names, or the world.
    pub bodies: [u32; 2],
    /// Ticks since the previous frame; for the first frame the expected number.
    pub interval: Tick,
    /// Position of the contact in the world, m.
    pub point: [f64; 3],
    /// The same in the frames of body a and of body b, m; a body of unknown pose is at the origin of the world.
    pub local: [[f64; 3]; 2],
    /// Unit normal from a to b.
    pub normal: [f32; 3],
    /// Normal force, N, at least 0.
    pub force: f32,
    /// Friction force on b, N, if known.
    pub friction: Option<[f32; 3]>,
    /// Velocity of b relative to a at the point, m/s.
    pub velocity: [f32; 3],
    /// Velocity of the contact point over the surfaces of a and of b, m/s in the world, if known.
    pub travel: [Option<[f32; 3]>; 2],
    /// Largest speed of approach along the normal within the frame, m/s, at least 0, if known.
    pub approach: Option<f32>,
    /// In a frame in which the contact begins, the depth of penetration at its end, m, negative for a gap, if known; in one in which
    /// bodies in contact land again, the time since then times `approach`.
    pub depth: Option<f32>,
    /// Effective mass of the pair, kg, if known.
    pub mass: Option<f32>,
    /// True for the first frame of the contact.
    pub begins: bool,
    /// True for the last frame of the contact.
    pub ends: bool,
}

/// Kind of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Too short for any of the others.
    #[default]
    Unsteady,
    /// At rest: silent.
    Static,
    /// One surface slips over the other.
    Sliding,
    /// The contact point moves over both surfaces without slip.
    Rolling,
    /// Between rolling and sliding.
    Mixed,
}

impl State {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::Static, Self::Sliding, Self::Rolling, Self::Mixed, Self::Unsteady];

    /// The kind as a lower-case adjective, as parameters name it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Unsteady => "unsteady",
            Self::Static => "static",
            Self::Sliding => "sliding",
            Self::Rolling => "rolling",
            Self::Mixed => "mixed",
        }
    }
}

/// A frame of a contact with its classification.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactState {
    /// The frame.
    pub frame: ContactFrame,
    /// Kind of contact.
    pub state: State,
    /// Slip ratio: 1 for sliding, 0 for rolling, between them slip over slip plus speed of rolling.
    pub slip: f32,
    /// Power dissipated by the contact, W.
    pub power: f32,
    /// Amplitude by the power law: 1 at the reference power.
    pub gain: f32,
    /// Speed of slip, m/s.
    pub sliding: f32,
    /// Speed of rolling, m/s: the smaller of the speeds of the contact point over the two surfaces, 0 for a body that only slides.
    pub rolling: f32,
    /// Standard deviation over mean of force and of speed, compared with the limits of steady contact; 0 in the first frames.
    pub variation: [f32; 2],
    /// Mean force above its recent minimum, N, compared with the smallest prominence of an impact.
    pub prominence: f32,
    /// Recent median of its mean force, N, which the prominence of an impact must exceed as well.
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
            depth: None,
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
