//! Synthesis of friction noise: amplitudes from a friction model, random phases, and an inverse Fourier transform.
//!
//! [`noise`] renders single clips, [`clip_stream`] overlaps and adds them.

pub mod binaural_ift_noise;
pub mod clip_stream;
mod clip_timing;
mod clusters;
pub mod ift_noise;
pub mod noise;
pub mod noise_params;
mod phasors;
pub mod receiver;
pub mod speed_coverage;
pub mod window;

pub use clip_stream::ClipStream;
pub use clip_timing::MotionAt;
pub use noise::{ClipInput, IftNoise, NoiseError};
pub use noise_params::{AreaWeight, EmitterKind, Emitters, IftNoiseParams, Magnitude};
pub use receiver::{Mono, Receiver};
pub use speed_coverage::SpeedCoverage;
pub use window::Window;
