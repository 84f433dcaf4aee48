//! What the nodes of this family share.

use super::DspError;
use crate::core::fault::{Fault, Reject};
use crate::core::time::{Rate, Tick};

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

/// The whole number of items nearest to a time.
pub(crate) fn nearest_items(rate: Rate, seconds: f64) -> usize {
    (seconds * rate.as_f64()).round() as usize
}

/// When a stream ends that goes on as another does, at most `seconds` long.
pub(crate) fn ends_after(seconds: Option<f64>) -> Option<Tick> {
    seconds.map(crate::core::time::ticks)
}

/// Frames over which a gain that is changed while it runs moves to its new value: 10 ms.
pub(crate) fn ramp(rate: Rate) -> u64 {
    nearest_items(rate, 0.010) as u64
}
