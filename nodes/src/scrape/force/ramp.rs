//! Numbers that move to new values on a straight line, so that a change of a parameter does not click.

use super::segment::CELL;

/// Ramp of a changed parameter, s.
pub const RAMP_TIME: f64 = 0.02;

/// A number that moves to its target in [`RAMP_TIME`] seconds, as a function of the sample alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    from: f64,
    to: f64,
    start: i64,
    samples: f64,
}

impl Ramp {
    /// A constant number.
    #[must_use]
    pub fn new(value: f64, rate: f64) -> Self {
        Self { from: value, to: value, start: 0, samples: (RAMP_TIME * rate).max(1.0) }
    }

    /// Starts a ramp to another value at a sample.
    pub fn ramp_to(&mut self, value: f64, sample: i64) {
        (self.from, self.to, self.start) = (self.at(sample), value, sample);
    }

    /// The value at a sample.
    #[must_use]
    pub fn at(&self, sample: i64) -> f64 {
        let fraction = ((sample - self.start) as f64 / self.samples).clamp(0.0, 1.0);
        if fraction >= 1.0 { self.to } else { self.from + fraction * (self.to - self.from) }
    }

    /// The values at the first and the last sample of a cell.
    #[must_use]
    pub fn ends(&self, anchor: i64) -> [f64; 2] {
        [self.at(anchor), self.at(anchor + CELL as i64 - 1)]
    }

    /// The end of the ramp that is nearer at a sample: the old value in its first half, the new one in its second.
    #[must_use]
    pub fn nearer_end(&self, sample: i64) -> f64 {
        if 2 * (sample - self.start) < self.samples as i64 { self.from } else { self.to }
    }

    /// The value from a sample on, if the ramp has ended.
    #[must_use]
    pub fn settled(&self, sample: i64) -> Option<f64> {
        let arrived = self.from == self.to || (sample - self.start) as f64 >= self.samples;
        arrived.then_some(self.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_reached_on_a_straight_line_from_wherever_it_was() {
        let mut ramp = Ramp::new(1.0, 1000.0);
        assert_eq!(ramp.settled(0), Some(1.0));
        ramp.ramp_to(3.0, 100);
        assert_eq!([100, 110, 120, 500].map(|n| ramp.at(n)), [1.0, 2.0, 3.0, 3.0]);
        assert_eq!((ramp.settled(110), ramp.settled(120)), (None, Some(3.0)));
        ramp.ramp_to(0.0, 110);
        assert_eq!([110, 120, 130].map(|n| ramp.at(n)), [2.0, 1.0, 0.0]);
        assert_eq!([110, 119, 120, 500].map(|n| ramp.nearer_end(n)), [2.0, 2.0, 0.0, 0.0]);
    }
}
