//! A strength that another node has found.

use crate::core::fault::Reject;
use std::sync::Arc;

/// Greatest strength, as of the parameter.
const MOST: f64 = 1e6;

/// The strength that is linked to `kappa`, where one is.
pub(super) fn linked(kappa: Option<Arc<f64>>) -> Result<Option<f64>, Reject> {
    match kappa.as_deref() {
        Some(x) if !x.is_finite() || x.abs() > MOST => {
            let message =
                format!("the strength that is linked to `kappa` is {x}; -{MOST} to {MOST} are taken");
            Err(Reject::new("F128", message).at("kappa"))
        }
        other => Ok(other.copied()),
    }
}
