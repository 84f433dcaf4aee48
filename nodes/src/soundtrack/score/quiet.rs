//! Passages of a recording that are nearly silent.

use crate::statistics::quantile;

/// Length of a window and distance between windows, s.
const WINDOW: (f64, f64) = (0.02, 0.01);
/// Highest and relative level of a quiet passage: dB of full scale, and dB above the level of the quietest tenth.
const QUIET: (f64, f64) = (-60.0, 6.0);
/// Rise above the threshold that ends a quiet passage, dB.
const HYSTERESIS: f64 = 3.0;
/// Shortest quiet passage, s.
const SHORTEST: f64 = 0.05;

/// Start and end, in s, of the passages that are quiet: below -60 dB of full scale, or less than 6 dB above the quietest tenth of the recording,
/// until the level rises 3 dB above that, for 50 ms or longer.
///
/// # Shapes
/// `channels`: samples of each channel.
///
/// # Complexity
/// Linear.
///
/// # Source
/// Cardle et al., "Sound-by-Numbers" (SCA 2003), section 8, which names quasi-silence as future work. The thresholds are a choice.
#[must_use]
pub fn quiet_passages(channels: &[Vec<f32>], rate: f64) -> Vec<(f64, f64)> {
    let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
    let (len, hop) = ((WINDOW.0 * rate) as usize, ((WINDOW.1 * rate) as usize).max(1));
    if frames < len.max(1) {
        return Vec::new();
    }
    let level = |from: usize| {
        let parts = channels.iter().map(|x| &x[from..from + len]);
        let sum: f64 = parts.flatten().map(|x| f64::from(*x).powi(2)).sum();
        10.0 * (sum / (len * channels.len()) as f64 + 1e-20).log10()
    };
    let levels: Vec<f64> = (0..=frames - len).step_by(hop).map(level).collect();
    let mut sorted = levels.clone();
    sorted.sort_by(f64::total_cmp);
    let threshold = QUIET.0.max(quantile(&sorted, 0.1) + QUIET.1);
    let at = |k: usize| (k * hop) as f64 / rate;
    let (mut found, mut start) = (Vec::new(), None);
    for (k, level) in levels.iter().enumerate() {
        match start {
            None if *level < threshold => start = Some(k),
            Some(from) if *level > threshold + HYSTERESIS => {
                // The window before the first loud one ends where that begins, at the latest.
                found.push((at(from), at(k - 1) + WINDOW.0));
                start = None;
            }
            _ => {}
        }
    }
    found.extend(start.map(|from| (at(from), frames as f64 / rate)));
    found.retain(|(from, to)| to - from >= SHORTEST);
    found
}

/// The share of intervals that is within others, both in order.
#[must_use]
pub fn share_within(intervals: &[(f64, f64)], others: &[(f64, f64)]) -> f64 {
    let total: f64 = intervals.iter().map(|(from, to)| to - from).sum();
    let common = |a: &(f64, f64), b: &(f64, f64)| (a.1.min(b.1) - a.0.max(b.0)).max(0.0);
    let within: f64 = intervals.iter().flat_map(|a| others.iter().map(move |b| common(a, b))).sum();
    if total > 0.0 { within / total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn gaps_between_bursts_are_quiet() {
        let mut rng = Rng::new(6);
        let mut x = vec![0.0_f32; 40_000];
        for (k, x) in x.iter_mut().enumerate() {
            // Half a second of sound, half a second nearly silent.
            let amplitude = if k / 4000 % 2 == 0 { 0.5 } else { 0.0005 };
            *x = (amplitude * rng.between(-1.0, 1.0)) as f32;
        }
        let found = quiet_passages(&[x], 8000.0);
        assert_eq!(found.len(), 5, "{found:?}");
        for (k, (from, to)) in found.iter().enumerate() {
            let start = 0.5 + k as f64;
            assert!((from - start).abs() <= 0.02 && (to - start - 0.5).abs() <= 0.02, "{from} {to}");
        }
        assert!((share_within(&[(0.25, 0.75)], &found) - 0.5).abs() < 0.05);
        assert_eq!((share_within(&[], &found), quiet_passages(&[], 8000.0)), (0.0, vec![]));
    }
}
