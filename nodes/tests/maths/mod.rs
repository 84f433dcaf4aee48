//! The maths of several rooms together, against oracles.

mod cloth_oracles;
mod motion;
