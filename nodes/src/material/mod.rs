//! Materials: the damping of an object's modes, estimated from recordings of impacts.
//!
//! [`Feature`]s are the modes of recordings. A gate makes [`DampingPoint`]s of them, and [`estimate`](estimation::estimate::estimate)
//! fits a [`DampingModel`] that sets the damping of the material apart from that of supports, of noise and of spurious features.

pub mod damping;
pub mod estimation;
pub mod statistics;

pub use damping::{Convention, DampingModel, Family};
pub use estimation::estimate::{Estimator, Settings, estimate};
pub use estimation::fit::{FitOptions, Method};
pub use estimation::point::{DampingPoint, EstimationError};
pub use estimation::report::{FitReport, FitWarning};
