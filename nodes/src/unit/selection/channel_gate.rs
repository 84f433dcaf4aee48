//! Gates that skip units of a channel while its target is silent.

use crate::core::fault::Reject;
use crate::core::node::same_rate;
use crate::core::ports::In;
use crate::core::shape::Incoming;
use crate::core::time::Rate;
use crate::feature::Features;
use crate::impl_state;
use crate::unit::UnitDatabase;
use crate::unit::silence::{SILENT, UnitGate};
use std::collections::VecDeque;

/// Gates of all channels.
///
/// A gate closes when the output of `UnitConcatenator` has faded out; units chosen until the target sounds again would be inaudible.
pub(super) struct ChannelGates {
    channels: Vec<ChannelGate>,
    /// Samples in a unit.
    unit: usize,
    /// Number of past units whose gate is remembered.
    memory: usize,
}
impl_state!(ChannelGates { each channels });

struct ChannelGate {
    unit_gate: UnitGate,
    /// True for each of the last units at which the gate was closed.
    closed: VecDeque<bool>,
    /// The unit after these.
    next: i64,
    closed_units: u64,
}
impl_state!(ChannelGate { unit_gate, closed, next, closed_units });

/// Refuses a target of another rate than the sound that the features are of.
pub(super) fn check(features: &Incoming<Features>, target: Option<&Incoming<f32>>) -> Result<(), Reject> {
    let Some(target) = target else { return Ok(()) };
    let unit = u64::from(features.format.conventions.unit);
    same_rate(
        "target",
        target.rate,
        "the sound of `features`",
        features.rate.times(unit).unwrap_or(target.rate),
    )
}

/// Look-ahead, in samples, that the gates of a unit and of `ahead` further units need.
pub(super) fn target_look_ahead(unit: u32, ahead: usize) -> usize {
    (unit as usize).saturating_mul(ahead + 1).saturating_sub(1)
}

impl ChannelGates {
    /// Open gates; `None` if `keep` states that units are also chosen in silence, as for the room tone of joint units.
    pub fn new(
        db: &UnitDatabase,
        rate: Rate,
        channels: usize,
        keep: Option<bool>,
        ahead: usize,
    ) -> Option<Self> {
        if keep.unwrap_or(db.conventions.joined > 1) {
            return None;
        }
        let gate = |_| ChannelGate {
            unit_gate: UnitGate::new(rate.as_f64()),
            closed: VecDeque::new(),
            next: 0,
            closed_units: 0,
        };
        Some(Self { channels: (0..channels).map(gate).collect(), unit: db.unit(), memory: ahead + 1 })
    }

    /// Returns true if the gate of a channel is closed at unit `at`, which is among the last requested units or follows them.
    pub fn is_closed(&mut self, target: &In<'_, f32>, channel: usize, at: i64) -> bool {
        let (unit, vectors, memory) = (self.unit, self.channels.len(), self.memory);
        let Some(gate) = self.channels.get_mut(channel) else { return false };
        if gate.closed.is_empty() {
            gate.next = at;
        }
        while gate.next <= at {
            let silent = silent(target, gate.next, unit, (channel, vectors));
            let closed = gate.unit_gate.next(silent);
            gate.closed_units += u64::from(closed);
            gate.next += 1;
            if gate.closed.len() == memory {
                gate.closed.pop_front();
            }
            gate.closed.push_back(closed);
        }
        let age = usize::try_from(gate.next - at).unwrap_or(usize::MAX);
        let index = gate.closed.len().checked_sub(age);
        index.and_then(|index| gate.closed.get(index)).is_some_and(|closed| *closed)
    }

    /// Number of skipped units, of all channels.
    pub fn closed_units(&self) -> u64 {
        self.channels.iter().map(|gate| gate.closed_units).sum()
    }
}

/// Share of all units that were skipped.
pub(super) fn closed_share(gates: Option<&ChannelGates>, picked: u64) -> f64 {
    let closed_units = gates.map_or(0, ChannelGates::closed_units);
    closed_units as f64 / (closed_units + picked).max(1) as f64
}

/// Returns true if the target is silent in all of unit `at`: in the channel of the vector if it has one for each.
fn silent(target: &In<'_, f32>, at: i64, unit: usize, (vector, vectors): (usize, usize)) -> bool {
    let width = target.width().max(1);
    let first = usize::try_from(at * unit as i64 - target.first() + target.behind() as i64).unwrap_or(0);
    let samples = target.around().get(first * width..).unwrap_or_default();
    let sounds = |frame: &[f32]| match frame.get(vector) {
        Some(x) if width == vectors => x.abs() > SILENT,
        _ => frame.iter().any(|x| x.abs() > SILENT),
    };
    !samples.chunks_exact(width).take(unit).any(sounds)
}
