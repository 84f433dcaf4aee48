//! Units through which the choice for a channel sleeps, because its target is silent.

use crate::core::fault::Reject;
use crate::core::node::same_rate;
use crate::core::ports::In;
use crate::core::shape::Incoming;
use crate::core::time::Rate;
use crate::feature::Features;
use crate::impl_state;
use crate::unit::UnitDatabase;
use crate::unit::silence::{Doze, SILENT};
use std::collections::VecDeque;

/// What of every channel is slept through.
///
/// A channel falls asleep with the output of `UnitConcatenator`: what is chosen from then on, until the target sounds again, is
/// never heard.
pub(super) struct Sleepers {
    channels: Vec<Sleeper>,
    /// Samples in a unit.
    unit: usize,
    /// Units whose sleep is remembered.
    kept: usize,
}
impl_state!(Sleepers { each channels });

struct Sleeper {
    doze: Doze,
    /// Whether it sleeps through each of the last units.
    known: VecDeque<bool>,
    /// The unit after these.
    next: i64,
    asleep: u64,
}
impl_state!(Sleeper { doze, known, next, asleep });

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

/// Samples after the first of a unit that are looked at to know whether it and `ahead` more are slept through.
pub(super) fn reach(unit: u32, ahead: usize) -> usize {
    (unit as usize).saturating_mul(ahead + 1).saturating_sub(1)
}

impl Sleepers {
    /// All awake; `keep` is whether quiet units are chosen for silence as well, as for the room tone of joint ones.
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
        let sleeper =
            |_| Sleeper { doze: Doze::new(rate.as_f64()), known: VecDeque::new(), next: 0, asleep: 0 };
        Some(Self { channels: (0..channels).map(sleeper).collect(), unit: db.unit(), kept: ahead + 1 })
    }

    /// Whether a channel sleeps through unit `at`, which is among the last that were asked for or follows them.
    pub fn sleeps(&mut self, target: &In<'_, f32>, channel: usize, at: i64) -> bool {
        let (unit, vectors, kept) = (self.unit, self.channels.len(), self.kept);
        let Some(sleeper) = self.channels.get_mut(channel) else { return false };
        if sleeper.known.is_empty() {
            sleeper.next = at;
        }
        while sleeper.next <= at {
            let silent = silent(target, sleeper.next, unit, (channel, vectors));
            let asleep = sleeper.doze.next(silent);
            sleeper.asleep += u64::from(asleep);
            sleeper.next += 1;
            if sleeper.known.len() == kept {
                sleeper.known.pop_front();
            }
            sleeper.known.push_back(asleep);
        }
        let age = usize::try_from(sleeper.next - at).unwrap_or(usize::MAX);
        let place = sleeper.known.len().checked_sub(age);
        place.and_then(|place| sleeper.known.get(place)).is_some_and(|asleep| *asleep)
    }

    /// Units that were slept through, of all channels.
    pub fn asleep(&self) -> u64 {
        self.channels.iter().map(|sleeper| sleeper.asleep).sum()
    }
}

/// Share of all units that were slept through.
pub(super) fn share(sleepers: Option<&Sleepers>, picked: u64) -> f64 {
    let asleep = sleepers.map_or(0, Sleepers::asleep);
    asleep as f64 / (asleep + picked).max(1) as f64
}

/// Whether the target is silent all through unit `at`: in the channel of a vector where it has one for each.
fn silent(target: &In<'_, f32>, at: i64, unit: usize, (vector, vectors): (usize, usize)) -> bool {
    let width = target.width().max(1);
    let first = usize::try_from(at * unit as i64 - target.first() + target.behind() as i64).unwrap_or(0);
    let samples = target.around().get(first * width..).unwrap_or_default();
    let heard = |frame: &[f32]| match frame.get(vector) {
        Some(x) if width == vectors => x.abs() > SILENT,
        _ => frame.iter().any(|x| x.abs() > SILENT),
    };
    !samples.chunks_exact(width).take(unit).any(heard)
}
