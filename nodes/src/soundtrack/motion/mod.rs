//! Motion as curves over time.

pub mod contact_curve;
pub mod curve;
pub mod curve_file;
pub mod curve_out;
mod curve_table;
pub mod motion_curve;
pub mod pose_curve;

pub use curve::{CurveError, MotionCurve};
pub use curve_table::{CurveTableError, read_curve_table};
pub use pose_curve::PoseMeasure;
