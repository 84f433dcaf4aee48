//! Damping of a material as a function of frequency.
//!
//! A mode obeys `z'' + c z' + lambda z = p`, with `lambda = omega_n^2`; its amplitude decays at `d = c / 2`. All models here return
//! `c`.

mod family;
mod model;
mod monotone_spline;

pub use family::Family;
pub use model::{Convention, DampingModel, ModelError};
pub use monotone_spline::MonotoneSpline;
