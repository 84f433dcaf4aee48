//! Frame rate of irregular frame times.

use crate::core::time::Rate;

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

/// Smallest number of equal intervals that make a frame rate; fewer are key frames, between which a file means nothing.
const MIN_INTERVALS: usize = 8;

/// Returns true if at least three quarters of the intervals, and no fewer than 8, are within 5 % of their median.
fn is_regular(times: &[f64]) -> bool {
    let mut intervals: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    intervals.sort_unstable_by(f64::total_cmp);
    let median = intervals.get(intervals.len() / 2).copied().unwrap_or_default();
    let equal = intervals.iter().filter(|s| (**s / median - 1.0).abs() < 0.05).count();
    equal >= MIN_INTERVALS && 4 * equal >= 3 * intervals.len()
}

/// Describes how the frames of a file with own times differ from the `rate` of a stream, which the parameter `field` gives; `None` where
/// they agree to 0.1 %, and for key frames that are all included. The speed of the motion is that of the file in any case.
#[must_use]
pub fn rate_difference(times: &[f64], rate: Rate, field: &str) -> Option<String> {
    let (&first, &last) = (times.first()?, times.last()?);
    let mean = (times.len() - 1) as f64 / (last - first);
    let own = nominal_rate(times).map_or(mean, |(num, den)| num as f64 / den as f64);
    let difference = (own / rate.as_f64() - 1.0).abs();
    let key_frames = own < rate.as_f64() && !is_regular(times);
    if !own.is_finite() || difference < 1e-3 || key_frames {
        return None;
    }
    let own = (own * 1e3).round() / 1e3;
    let between = if own < rate.as_f64() { "frames between are interpolated" } else { "frames are left out" };
    Some(format!(
        "the file has {own} frames a second ({} from {first} to {last} s) and `{field}` is {rate}: {between}, and the speed stays that of the file",
        times.len()
    ).replace(" Hz", ""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_is_not_that_of_the_file_is_described_in_words() {
        let times: Vec<f64> = (0..49).map(|k| f64::from(k) / 24.0).collect();
        let text = |rate| rate_difference(&times, Rate::hz(rate), "fps");
        assert_eq!(text(24), None);
        assert_eq!(
            text(60).unwrap(),
            "the file has 24 frames a second (49 from 0 to 2 s) and `fps` is 60: frames between are interpolated, and the speed stays that of the file"
        );
        assert!(text(12).unwrap().contains("frames are left out"));
        assert_eq!(rate_difference(&[0.0], Rate::hz(60), "fps"), None);
        // Key frames are to be interpolated, but not to be left out.
        assert_eq!(rate_difference(&[0.0, 0.1, 0.3], Rate::hz(60), "fps"), None);
        assert!(rate_difference(&[0.0, 0.1, 0.3], Rate::hz(2), "fps").unwrap().contains("has 6.667 frames"));
        let odd: Vec<f64> = (0..20).map(|k| f64::from(k) / 37.0).collect();
        assert!(rate_difference(&odd, Rate::hz(60), "fps").unwrap().contains("has 37 frames"));
    }

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
