//! Head-related transfer functions: the structural model of Brown and Duda, on audio and on spectra.

pub mod binaural;
pub mod head;
pub mod head_params;
pub mod receiver;
pub mod static_source;
pub mod structural_hrtf;
