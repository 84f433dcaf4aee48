//! Frame rate of irregular frame times.

/// Standard frame rate of a list of frame times as (frames, seconds), if there is one.
///
/// The frame interval is the mean of the intervals within 5 % of their median: a missing frame has no effect, and errors
/// of times rounded to f32 average out. Standard rates are 24, 25, 30, 48, 50, 60, 120, 240 and 1000/1001 of 24, 30,
/// 48, 60, 120, 240 frames per second, with a relative tolerance of 1e-4.
#[must_use]
pub fn nominal_rate(times: &[f64]) -> Option<(u64, u64)> {
    let mut intervals: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    if intervals.is_empty() || intervals.iter().any(|s| !s.is_finite() || *s <= 0.0) {
        return None;
    }
    intervals.sort_unstable_by(f64::total_cmp);
    let median = intervals[intervals.len() / 2];
    let (sum, n) = intervals
        .iter()
        .filter(|&&s| (s / median - 1.0).abs() < 0.05)
        .fold((0.0, 0u32), |(sum, n), s| (sum + s, n + 1));
    let rate = f64::from(n) / sum;
    const INTEGER_RATES: [u64; 8] = [24, 25, 30, 48, 50, 60, 120, 240];
    INTEGER_RATES
        .iter()
        .map(|&r| (r, 1))
        .chain(INTEGER_RATES.iter().filter(|&&r| r % 25 != 0).map(|&r| (r * 1000, 1001)))
        .find(|&(num, den)| (rate / (num as f64 / den as f64) - 1.0).abs() < 1e-4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_rates_are_recognised_and_others_are_not() {
        for (num, den) in [
            (24, 1),
            (25, 1),
            (30, 1),
            (50, 1),
            (60, 1),
            (240, 1),
            (24000, 1001),
            (30000, 1001),
            (60000, 1001),
        ] {
            let times: Vec<f64> = (0..200).map(|k| f64::from(k) * den as f64 / num as f64).collect();
            assert_eq!(nominal_rate(&times), Some((num, den)));
            // As MDD stores them, with a frame missing.
            let mut rounded: Vec<f64> = times.iter().map(|&t| f64::from(t as f32)).collect();
            rounded.remove(77);
            assert_eq!(nominal_rate(&rounded), Some((num, den)), "f32");
        }
        assert_eq!(nominal_rate(&[0.0, 1.0 / 37.0, 2.0 / 37.0]), None);
        assert_eq!(nominal_rate(&[0.0]), None);
        assert_eq!(nominal_rate(&[0.0, 0.0]), None);
    }
}
