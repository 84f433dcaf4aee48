//! Contacts on textures and the materials that they excite.

mod figures;
mod materials;
mod rolling_ball;
mod texture;
