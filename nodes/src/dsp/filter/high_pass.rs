//! The node `HighPass`.

use super::butterworth::{Band, Butterworth, Cascade};
use super::node::{FilterIo, FilterPorts, butterworth_node};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, params};

params! {
    /// Butterworth high-pass filter: takes away what lies below the cutoff.
    ///
    /// The gain at the cutoff is -3.01 dB; below it falls by 6 dB per octave and order.
    pub struct HighPassParams {
        /// Frequency where the gain is -3.01 dB; below half the rate of the audio.
        cutoff: f64 = 100.0, unit "Hz", range 0.01..=300_000.0;
        /// Steepness.
        order: usize = 5, unit "", range 1..=10_usize;
    }
}
butterworth_node!(
    /// The node `HighPass`.
    HighPassNode, HighPassParams, "HighPass", Band::HighPass
);
