//! The position of a speed among the measured speeds.

/// The position of a speed among the measured speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Bracket {
    /// At rest, or not a number.
    AtRest,
    /// Below the slowest, by this factor.
    Below { ratio: f64 },
    /// Between speeds `low` and `low + 1`.
    Between { low: usize, alpha: f64 },
    /// At or above the fastest.
    Above,
}

impl Bracket {
    /// Brackets `speed` by at least two increasing `speeds`.
    pub(crate) fn of(speeds: &[f64], speed: f64) -> Self {
        let (Some(&first), Some(&last)) = (speeds.first(), speeds.last()) else { return Self::AtRest };
        if speed.is_nan() || speed <= 0.0 {
            Self::AtRest
        } else if speed < first {
            Self::Below { ratio: speed / first }
        } else if speed >= last {
            Self::Above
        } else {
            let low = speeds.partition_point(|s| *s <= speed) - 1;
            Self::Between { low, alpha: (speed - speeds[low]) / (speeds[low + 1] - speeds[low]) }
        }
    }
}
