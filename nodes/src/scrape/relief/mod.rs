//! Excitation from heights: two surfaces on each other, or a ball that rolls over one.

mod creases;
pub(super) mod heights;
mod joint_force;
pub(super) mod pair_force;
mod rolling_ball;
mod size_fade;
pub mod two_textures;

pub use heights::{Relief, heights};
pub use pair_force::PairForce;
pub use rolling_ball::{ball_map, rolled_over};
pub use size_fade::SizeFade;
