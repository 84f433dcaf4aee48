//! The node `LowPass`.

use super::butterworth::{Band, Butterworth, Cascade};
use super::node::{FilterIo, FilterPorts, butterworth_node};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, params};

params! {
    /// Removes frequencies above the cutoff by a Butterworth low-pass filter.
    ///
    /// The gain at the cutoff is -3.01 dB; above the cutoff the gain falls by 6 dB per octave and order.
    pub struct LowPassParams {
        /// Frequency at which the gain is -3.01 dB; below half the sample rate.
        cutoff: f64 = 1000.0, unit "Hz", range 0.01..=300_000.0;
        /// Order of the filter.
        order: usize = 2, unit "", range 1..=10_usize;
    }
}
butterworth_node!(
    /// The node `LowPass`.
    LowPassNode, LowPassParams, "LowPass", Band::LowPass
);

#[cfg(test)]
mod tests {
    use super::super::high_pass::{HighPassNode, HighPassParams};
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    #[test]
    fn the_nodes_separate_a_constant_from_an_alternating_signal() {
        let audio: Vec<f32> = (0..4000).map(|i| 1.0 + if i % 2 == 0 { 0.5 } else { -0.5 }).collect();
        let (rate, mono) = (Rate::hz(1000), Channels(1));
        let high = Standalone::new::<HighPassNode>(HighPassParams { cutoff: 100.0, order: 5 });
        let run = high.input(FilterPorts::audio, rate, mono, audio.clone()).run().unwrap();
        let out = run.stream(FilterPorts::out);
        assert!((out[3998] - 0.5).abs() < 1e-6 && (out[3999] + 0.5).abs() < 1e-6);
        let low = Standalone::new::<LowPassNode>(LowPassParams { cutoff: 100.0, order: 4 });
        let run = low.input(FilterPorts::audio, rate, mono, audio).run().unwrap();
        assert!(run.stream(FilterPorts::out)[3990..].iter().all(|x| (x - 1.0).abs() < 1e-6));
    }

    #[test]
    fn a_cutoff_above_half_the_rate_is_refused() {
        let standalone = Standalone::new::<LowPassNode>(LowPassParams { cutoff: 500.0, order: 4 });
        let standalone = standalone.input(FilterPorts::audio, Rate::hz(1000), Channels(1), vec![0.0]);
        assert_eq!(standalone.shape().unwrap_err().field.as_deref(), Some("cutoff"));
    }
}
