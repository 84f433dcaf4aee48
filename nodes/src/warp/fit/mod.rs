//! A warp: the thin-plate spline fitted to pairs, its file, its figure and its application.

mod figure;
pub(crate) mod nodes;
pub(crate) mod problem;
pub mod report;
pub mod spline_fit;
pub mod tps_fit;
pub mod tps_warp;
pub mod warp;
pub mod warp_file;

pub use figure::Cloud;
pub use report::{FitError, FitReport, MAX_NODES, Stiffness};
pub use spline_fit::fit;
pub use warp::{WARP_VERSION, Warp, WarpMap};
