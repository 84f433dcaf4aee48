//! One integer clock for everything: frames, samples, physics steps and events.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A point in time, or a span of it, on the clock of [`TICKS_PER_SECOND`].
pub type Tick = i64;

/// Ticks in one second: divisible by every common frame, physics and audio rate, 1000/1001 film rates included.
pub const TICKS_PER_SECOND: Tick = 705_600_000;

/// Items per second as an exact fraction in lowest terms.
///
/// Item `i` has the tick `floor(i * TICKS_PER_SECOND * den / num)`, computed in 128 bits, so no error accumulates.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Rate {
    num: u64,
    den: u64,
}

impl Rate {
    /// The fastest rate that is accepted, items per second.
    pub const MAX_HZ: u64 = TICKS_PER_SECOND as u64;

    /// A rate of `num / den` items per second, or `None` where it is zero, slower than one item in about twelve days,
    /// or faster than the clock.
    #[must_use]
    pub fn new(num: u64, den: u64) -> Option<Self> {
        if num == 0 || den == 0 {
            return None;
        }
        let divisor = gcd(num, den);
        let (num, den) = (num / divisor, den / divisor);
        let fits = num <= 1 << 40 && den <= 1 << 20 && num <= Self::MAX_HZ.saturating_mul(den);
        fits.then_some(Self { num, den })
    }

    /// A whole number of items per second.
    ///
    /// # Panics
    /// For zero and for rates beyond [`Rate::MAX_HZ`]; meant for constants.
    #[must_use]
    pub const fn hz(num: u32) -> Self {
        assert!(num > 0 && num as u64 <= Self::MAX_HZ, "a rate is above zero and below the clock");
        Self { num: num as u64, den: 1 }
    }

    /// The fraction with a small denominator that a decimal stands for: whole rates, 1000/1001 film rates, and
    /// otherwise the simplest fraction within one part in 10^9.
    #[must_use]
    pub fn from_f64(hz: f64) -> Option<Self> {
        if !hz.is_finite() || hz <= 0.0 || hz > Self::MAX_HZ as f64 {
            return None;
        }
        let near = |value: f64, tolerance: f64| (hz - value).abs() <= tolerance * hz;
        if near(hz.round(), 1e-12) {
            return Self::new(hz.round() as u64, 1);
        }
        let film = (hz * 1.001).round();
        if near(film / 1.001, 2e-5) && [24.0, 30.0, 48.0, 60.0, 120.0].contains(&film) {
            return Self::new(film as u64 * 1000, 1001);
        }
        let (mut h, mut k) = ((1_u64, 0_u64), (0_u64, 1_u64));
        let mut x = hz;
        for _ in 0..32 {
            let a = x.floor();
            let next_h = (a as u64).checked_mul(h.0)?.checked_add(h.1)?;
            let next_k = (a as u64).checked_mul(k.0)?.checked_add(k.1)?;
            h = (next_h, h.0);
            k = (next_k, k.0);
            if near(h.0 as f64 / k.0 as f64, 1e-9) || x - a < 1e-12 {
                break;
            }
            x = 1.0 / (x - a);
        }
        Self::new(h.0, k.0)
    }

    /// Numerator, items.
    #[must_use]
    pub fn num(self) -> u64 {
        self.num
    }

    /// Denominator, seconds.
    #[must_use]
    pub fn den(self) -> u64 {
        self.den
    }

    /// Items per second, rounded to a float for reports and for coefficients.
    #[must_use]
    pub fn as_f64(self) -> f64 {
        self.num as f64 / self.den as f64
    }

    /// Tick of item `index`.
    #[must_use]
    pub fn tick(self, index: i64) -> Tick {
        let scaled = i128::from(index) * i128::from(TICKS_PER_SECOND) * i128::from(self.den);
        clamp(scaled.div_euclid(i128::from(self.num)))
    }

    /// The first item at `tick` or later; also the number of items in `[0, tick)`.
    #[must_use]
    pub fn first_at(self, tick: Tick) -> i64 {
        let period = i128::from(TICKS_PER_SECOND) * i128::from(self.den);
        clamp(-(-i128::from(tick) * i128::from(self.num)).div_euclid(period))
    }

    /// The last item at `tick` or earlier, with its tick and that of the next item.
    #[must_use]
    pub fn around(self, tick: Tick) -> (i64, [Tick; 2]) {
        let before = self.first_at(tick + 1) - 1;
        (before, [before, before + 1].map(|index| self.tick(index)))
    }

    /// The shortest span that surely covers `items` steps from one item to a later one.
    #[must_use]
    pub fn span(self, items: usize) -> Tick {
        -Self::tick_floor_of_negative(self, items)
    }

    fn tick_floor_of_negative(self, items: usize) -> Tick {
        self.tick(-(i64::try_from(items).unwrap_or(i64::MAX)))
    }

    /// This rate with every `factor` items joined into one.
    #[must_use]
    pub fn divided_by(self, factor: u64) -> Option<Self> {
        Self::new(self.num, self.den.checked_mul(factor)?)
    }

    /// This rate with every item split into `factor`.
    #[must_use]
    pub fn times(self, factor: u64) -> Option<Self> {
        Self::new(self.num.checked_mul(factor)?, self.den)
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.den == 1 { write!(f, "{} Hz", self.num) } else { write!(f, "{}/{} Hz", self.num, self.den) }
    }
}

impl fmt::Debug for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Ticks nearest to a time in seconds; saturates far outside any piece of sound.
#[must_use]
pub fn ticks(seconds: f64) -> Tick {
    (seconds * TICKS_PER_SECOND as f64).round() as Tick
}

/// Seconds of a tick, for reports.
#[must_use]
pub fn seconds(tick: Tick) -> f64 {
    tick as f64 / TICKS_PER_SECOND as f64
}

fn clamp(wide: i128) -> i64 {
    wide.clamp(i128::from(i64::MIN / 4), i128::from(i64::MAX / 4)) as i64
}

fn gcd(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn common_rates_divide_the_clock() {
        for hz in [24, 25, 30, 48, 50, 60, 90, 120, 240, 1000, 8000, 22_050, 44_100, 48_000, 96_000, 192_000]
        {
            let rate = Rate::hz(hz);
            assert_eq!(rate.tick(i64::from(hz)), TICKS_PER_SECOND);
            assert_eq!(rate.tick(1) * i64::from(hz), TICKS_PER_SECOND, "{hz}");
        }
        let film = Rate::new(24_000, 1001).unwrap();
        assert_eq!(film.tick(24_000), 1001 * TICKS_PER_SECOND);
        assert_eq!(film.tick(1) * 24_000, 1001 * TICKS_PER_SECOND);
    }

    #[test]
    fn decimals_become_the_fraction_that_was_meant() {
        assert_eq!(Rate::from_f64(23.976), Rate::new(24_000, 1001));
        assert_eq!(Rate::from_f64(29.97), Rate::new(30_000, 1001));
        assert_eq!(Rate::from_f64(60.0), Rate::new(60, 1));
        assert_eq!(Rate::from_f64(12.5), Rate::new(25, 2));
        assert_eq!(Rate::from_f64(0.0), None);
        assert_eq!(Rate::from_f64(f64::NAN), None);
    }

    proptest! {
        #[test]
        fn first_at_inverts_tick(num in 1_u64..200_000, den in 1_u64..1100, i in -100_000_i64..100_000_000) {
            let rate = Rate::new(num, den).unwrap();
            // Beyond that, a hundred years, times saturate.
            prop_assume!(rate.tick(i + 1) < i64::MAX / 4);
            prop_assert_eq!(rate.first_at(rate.tick(i)), i);
            prop_assert!(rate.first_at(rate.tick(i) + 1) > i);
        }

        #[test]
        fn span_covers_every_run_of_items(num in 1_u64..200_000, den in 1_u64..1100, i in 0_i64..1_000_000, n in 0_usize..5000) {
            let rate = Rate::new(num, den).unwrap();
            prop_assert!(rate.tick(i + n as i64) - rate.tick(i) <= rate.span(n));
        }
    }
}
