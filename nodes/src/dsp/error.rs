//! Parameters out of their range.

use crate::core::fault::{Fault, Reject};
/// A parameter out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what} is {found}; it must be {expected}")]
pub struct DspError {
    /// The parameter.
    pub what: &'static str,
    /// Its value.
    pub found: f64,
    /// Valid values.
    pub expected: &'static str,
}
impl DspError {
    pub(crate) fn check(
        ok: bool,
        what: &'static str,
        found: f64,
        expected: &'static str,
    ) -> Result<(), DspError> {
        if ok && found.is_finite() { Ok(()) } else { Err(DspError { what, found, expected }) }
    }

    /// Refuses a frequency outside (0, rate / 2).
    pub(super) fn check_frequency(frequency: f64, rate: f64) -> Result<(), DspError> {
        Self::check(rate > 0.0, "rate", rate, "above 0")?;
        let inside = frequency > 0.0 && frequency < rate / 2.0;
        Self::check(inside, "frequency", frequency, "above 0 and below half the rate")
    }
}
impl From<DspError> for Reject {
    fn from(e: DspError) -> Self {
        Self::new("F051", e.to_string()).at(e.what)
    }
}

impl From<DspError> for Fault {
    fn from(e: DspError) -> Self {
        Reject::from(e).into()
    }
}
