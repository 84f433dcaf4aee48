//! Both sides of playback: the callback, the workers ahead of it, the rings between them, and their meters.

pub mod assembly;
pub mod callback;
pub mod device_output;
pub mod meter;
pub mod timing;
pub mod window_ring;
pub mod workers;
