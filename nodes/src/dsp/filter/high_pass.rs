//! The node `HighPass`.

use super::butterworth::{Band, Butterworth, Cascade};
use super::node::{FilterIo, FilterPorts, butterworth_node};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, params};

params! {
    /// Removes frequencies below the cutoff by a Butterworth high-pass filter.
    ///
    /// The gain at the cutoff is -3.01 dB; below the cutoff the gain falls by 6 dB per octave and order.
    pub struct HighPassParams {
        /// Frequency at which the gain is -3.01 dB; below half the sample rate.
        cutoff: f64 = 100.0, unit "Hz", range 0.01..=300_000.0;
        /// Order of the filter.
        order: usize = 5, unit "", range 1..=10_usize;
    }
}
butterworth_node!(
    /// The node `HighPass`.
    HighPassNode, HighPassParams, "HighPass", Band::HighPass
);
