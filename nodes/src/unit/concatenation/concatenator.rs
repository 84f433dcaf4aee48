//! Units played one after the other, joined where the sound crosses zero.

use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use crate::unit::UnitDatabase;

/// Mix of the two sounds at a join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// Their powers add up to one: for unrelated sounds.
    EqualPower,
    /// Their amplitudes add up to one: for similar sounds.
    Linear,
    /// Both at full level, from zero crossing to zero crossing, as in the paper; 3 dB too loud where they overlap, and
    /// 2.4 dB in the millisecond to either side of a join.
    Add,
}

/// Length of a fade if no zero crossing is near.
const CUT_FADE: usize = 16;

/// One boundary between two units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Join {
    /// Samples by which the earlier unit continues.
    pub after: usize,
    /// Samples by which the later unit begins early.
    pub before: usize,
}

impl Join {
    /// Samples that are mixed.
    #[must_use]
    pub fn len(self) -> usize {
        self.after + self.before
    }

    /// Returns true if nothing is mixed.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
}

/// Returns true if the samples before and at `at` differ in sign; zero counts as positive.
fn crosses(x: &[f32], at: usize) -> bool {
    (x[at - 1] < 0.0) != (x[at] < 0.0)
}

/// Finds the join of a sound that ends before `end` and one that begins at `start`.
///
/// The earlier one continues to its next sign change, the later one begins at the sign change before it; both within half a unit,
/// so that neighbouring joins never overlap, and within their segments.
#[must_use]
pub fn join(
    x: &[f32],
    unit: usize,
    end: usize,
    segment_a: &Range<usize>,
    start: usize,
    segment_b: &Range<usize>,
) -> Join {
    let most = unit / 2;
    let room_after = most.min(segment_a.end.saturating_sub(end));
    let room_before = most.min(start.saturating_sub(segment_b.start));
    let found_after = (0..=room_after)
        .find(|&k| end + k < segment_a.end && end + k > segment_a.start && crosses(x, end + k));
    let found_before = (0..=room_before).find(|&k| start - k > segment_b.start && crosses(x, start - k));
    Join {
        after: found_after.unwrap_or_else(|| CUT_FADE.min(room_after)),
        before: found_before.unwrap_or_else(|| CUT_FADE.min(room_before)),
    }
}

impl Blend {
    /// Factors of the earlier and of the later sound at sample `k` of `n` that are mixed.
    #[must_use]
    pub fn weights(self, k: usize, n: usize) -> (f32, f32) {
        let along = (k as f64 + 0.5) / n.max(1) as f64;
        match self {
            Self::EqualPower => ((along * FRAC_PI_2).cos() as f32, (along * FRAC_PI_2).sin() as f32),
            Self::Linear => ((1.0 - along) as f32, along as f32),
            Self::Add => (1.0, 1.0),
        }
    }
}

/// Units on both sides of a boundary, if there are any.
type Sides = (Option<u32>, Option<u32>);

/// Plays units of a database one after the other.
///
/// Units that follow each other in their recording are not joined: the recording is copied.
///
/// # Source
/// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.4, which
/// states in one sentence that units are extended to their next zero crossing and overlapped.
#[derive(Clone, Copy, Debug)]
pub struct Concatenator<'a> {
    db: &'a UnitDatabase,
    blend: Blend,
}

impl<'a> Concatenator<'a> {
    /// Creates a concatenator over a valid database.
    #[must_use]
    pub fn new(db: &'a UnitDatabase, blend: Blend) -> Self {
        Self { db, blend }
    }

    /// The samples of a unit's segment.
    fn samples(&self, unit: u32) -> Option<Range<usize>> {
        let segment = self.db.segments.get(self.db.segment_of(unit as usize)?)?.range();
        Some(segment.start * self.db.unit()..segment.end * self.db.unit())
    }

    /// Finds the join of two units in a channel; there is no mix if one follows the other, or one is missing.
    #[must_use]
    pub fn join(&self, channel: usize, (a, b): Sides) -> Join {
        let joined = a.zip(b).and_then(|(a, b)| {
            let (in_a, in_b) = (self.samples(a)?, self.samples(b)?);
            let follows = b == a.wrapping_add(1) && in_a == in_b;
            let unit = self.db.unit();
            let (end, start) = ((a as usize + 1) * unit, b as usize * unit);
            (!follows).then(|| join(self.db.channel(channel), unit, end, &in_a, start, &in_b))
        });
        joined.unwrap_or_default()
    }

    /// Writes samples `from..` of the output unit that plays `unit` between `before` and `after`.
    ///
    /// # Shapes
    /// `joins`: those at the unit's start and at its end. `out`: every `step`-th sample is written, from the first one on.
    pub fn play(
        &self,
        channel: usize,
        [before, unit, after]: [Option<u32>; 3],
        joins: [Join; 2],
        from: usize,
        out: &mut [f32],
        step: usize,
    ) {
        let (length, x) = (self.db.unit(), self.db.channel(channel));
        let at = |unit: Option<u32>, offset: i64| {
            let index = i64::from(unit?) * length as i64 + offset;
            x.get(usize::try_from(index).ok()?).copied()
        };
        for (k, out) in (from..).zip(out.iter_mut().step_by(step.max(1))) {
            let here = k as i64;
            let own = at(unit, here).unwrap_or(0.0);
            let left = length - k.min(length);
            *out = if k < joins[0].after {
                // The unit before continues into this one.
                let (a, b) = self.blend.weights(joins[0].before + k, joins[0].len());
                a * at(before, length as i64 + here).unwrap_or(0.0) + b * own
            } else if left <= joins[1].before {
                let (a, b) = self.blend.weights(joins[1].before - left, joins[1].len());
                a * own + b * at(after, here - length as i64).unwrap_or(0.0)
            } else {
                own
            };
        }
    }

    /// All samples of one channel.
    #[must_use]
    pub fn whole(&self, channel: usize, picks: &[u32]) -> Vec<f32> {
        let length = self.db.unit();
        let mut out = vec![0.0; picks.len() * length];
        for (i, out) in out.chunks_exact_mut(length).enumerate() {
            let before = i.checked_sub(1).map(|k| picks[k]);
            let units = [before, Some(picks[i]), picks.get(i + 1).copied()];
            let joins = [self.join(channel, (units[0], units[1])), self.join(channel, (units[1], units[2]))];
            self.play(channel, units, joins, 0, out, 1);
        }
        out
    }
}

#[cfg(test)]
mod tests;
