//! Sliding speeds from the slides of contacts: gate, interpolation and mapping.

pub mod contact_pressure;
pub mod gate;
pub mod pchip;
pub mod sampler;
pub mod sliding_speed;
pub mod speed_map;
pub mod stale_frames;
