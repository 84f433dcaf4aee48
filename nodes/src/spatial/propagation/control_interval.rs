//! The interval at which positions are sampled.

/// Longest control interval, in samples.
const MAX_INTERVAL: u64 = 64;

/// Returns the number of samples between two updates of positions at `fs` hertz. Coefficients and delays change linearly in between.
///
/// It is 64 at 44.1 kHz and above; at lower rates it is the same time in fewer samples.
#[must_use]
pub fn control_interval(fs: f64) -> u64 {
    ((fs / (44_100.0 / MAX_INTERVAL as f64)).round() as u64).clamp(1, MAX_INTERVAL)
}
