//! What a node has written in one window: levels, activity, and numbers that are not finite.

use crate::core::buffer::StreamBuffer;
use crate::core::ports::{Cx, OutWire};

/// Silences the streams of numbers that a node has written in this window if any is not finite; returns true then.
pub(super) fn silence_not_finite(cx: &Cx<'_>) -> bool {
    let mut found = false;
    for wire in cx.outputs {
        let OutWire::Stream { buffer, clock, .. } = wire else { continue };
        let span = cx.span(*clock);
        let mut buffer = cx.shared.buffers[*buffer].borrow_mut();
        let Some(samples) = buffer.typed_mut::<StreamBuffer<f32>>() else { continue };
        let written = samples.last_mut((span.to - span.from).max(0) as usize);
        if largest_bits(written, 0) >= f32::INFINITY.to_bits() {
            written.fill(0.0);
            found = true;
        }
    }
    found
}

/// The largest magnitude in the streams of numbers of a node in this window, or `least` if that is larger.
pub(super) fn largest(cx: &Cx<'_>, least: f32) -> f32 {
    let mut bits = least.to_bits();
    for wire in cx.outputs {
        let OutWire::Stream { buffer, clock, .. } = wire else { continue };
        let span = cx.span(*clock);
        let mut buffer = cx.shared.buffers[*buffer].borrow_mut();
        let Some(samples) = buffer.typed_mut::<StreamBuffer<f32>>() else { continue };
        bits = largest_bits(samples.last_mut((span.to - span.from).max(0) as usize), bits);
    }
    f32::from_bits(bits)
}

/// The bits of the largest magnitude, or `least` if that is larger. The bits of magnitudes are in the order of the magnitudes, and this loop
/// needs no branch.
fn largest_bits(samples: &[f32], least: u32) -> u32 {
    samples.iter().fold(least, |largest, x| (x.to_bits() & 0x7fff_ffff).max(largest))
}

/// The outputs of a node that are active for the first time in this window.
pub(super) fn newly_active(cx: &Cx<'_>, active: u64) -> u64 {
    let mut found = 0;
    for (port, wire) in cx.outputs.iter().enumerate().take(64) {
        let bit = 1 << port;
        let carries = match wire {
            _ if active & bit != 0 => continue,
            OutWire::Value(_) => true,
            OutWire::Stream { buffer, clock, .. } | OutWire::Events { buffer, clock } => {
                let span = cx.span(*clock);
                let mut buffer = cx.shared.buffers[*buffer].borrow_mut();
                let samples = buffer.typed_mut::<StreamBuffer<f32>>();
                match samples.map(|all| all.last_mut((span.to - span.from).max(0) as usize)) {
                    Some(written) => written.iter().any(|x| *x != 0.0),
                    None => buffer.any().has_events(span.from, span.to).unwrap_or(span.to > span.from),
                }
            }
        };
        found |= if carries { bit } else { 0 };
    }
    found
}
