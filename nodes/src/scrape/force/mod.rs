//! Shared parts of all excitations: the contacts that sound at one time, their motion, the law of force and speed, parameters that
//! change smoothly, and pulses of force.

pub(super) mod approximation;
pub(super) mod contact_force_params;
pub(super) mod law;
pub(super) mod motion;
pub(super) mod pulses;
pub(super) mod ramp;
pub(super) mod segment;
pub(super) mod speed_curve;
pub(super) mod strength;
pub(super) mod voices;

pub use contact_force_params::{ContactForceParams, ForceLawParams};
pub use law::Law;
pub use motion::{AT_REST, FADE, Heading, Motion};
pub use pulses::{PULSE, Pulses};
pub use ramp::{RAMP_TIME, Ramp};
pub use segment::{CELL, Cell, Segment};
pub use speed_curve::SpeedCurve;
pub use strength::Strength;
pub use voices::Voices;
