//! Materials: the damping of an object's modes, estimated from recordings of impacts.
//!
//! [`Feature`](crate::modal::Feature)s are the modes of recordings. A [`Gate`] makes [`DampingPoint`]s of them, and [`estimate`] fits a [`DampingModel`] that sets
//! the damping of the material apart from that of supports, of noise and of spurious features. A [`Material`] is a file.

pub mod damping;
pub mod estimation;
pub mod experiments;
pub mod fitting;
pub mod library;
pub mod points;
pub mod statistics;

pub use damping::{Convention, DampingModel, Family};
pub use estimation::estimate::{Estimator, Settings, estimate};
pub use estimation::fit::{FitOptions, Method};
pub use estimation::point::{DampingPoint, EstimationError};
pub use estimation::report::{FitReport, FitWarning};
pub use library::{Material, read_material, write_material};
pub use points::damping_points::{DampingPoints, read_points};
pub use points::gate::Gate;
