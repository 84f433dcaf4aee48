//! Experiments on estimators of damping: synthetic sounds of known damping, and knocks that are left out of a fit.

pub mod damping_experiment;
pub mod estimators;
pub mod fit_comparison;
pub mod fit_convergence;
pub mod held_out;
pub mod held_out_knocks;
pub mod interval_coverage;
pub mod material_table;
pub mod significance;
pub mod spurious_features;
pub mod support_law;
pub mod synthetic;
