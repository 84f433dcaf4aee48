//! Impulsive and continuous recordings.

use serde::{Deserialize, Serialize};

/// Kind of the events of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum SourceKind {
    /// Impacts.
    #[default]
    Impulsive,
    /// Contact that lasts, such as rolling and sliding.
    Continuous,
}

/// Frame of the envelope, s.
const FRAME: f64 = 0.01;
/// Minimum duration of a continuous recording, s.
const SHORTEST: f64 = 0.5;
/// Fall of the envelope after the loudest frame that makes a recording impulsive, dB, and the time within which it happens, s.
const FALL: (f64, f64) = (30.0, 1.0);
/// Range below the loudest frame in which a frame counts as sound, dB.
const RANGE: f64 = 20.0;
/// Minimum share of a continuous recording that sounds.
const SHARE: f64 = 0.5;

/// Guesses if a recording is of impacts or of contact that lasts.
///
/// It is continuous if it is longer than 0.5 s, is within 20 dB of its loudest frame of 10 ms for half of its time, and does not fall by 30 dB
/// within a second after its loudest frame without rising again: a glass that rings is an impact.
#[must_use]
pub fn guess_kind(x: &[f32], rate: f64) -> SourceKind {
    let frame = ((FRAME * rate) as usize).max(1);
    let levels: Vec<f64> = x
        .chunks(frame)
        .map(|part| part.iter().map(|x| f64::from(x * x)).sum::<f64>() / part.len() as f64)
        .map(|power| 10.0 * power.max(1e-20).log10())
        .collect();
    let loudest = levels.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
    let Some((peak, &top)) = loudest else { return SourceKind::Impulsive };
    if (x.len() as f64) < SHORTEST * rate || top <= -120.0 {
        return SourceKind::Impulsive;
    }
    let after = &levels[peak..];
    let within = (FALL.1 / FRAME) as usize;
    let fallen = after.iter().take(within).position(|level| *level < top - FALL.0);
    let rises_again = fallen.is_some_and(|k| after[k..].iter().any(|level| *level > top - RANGE));
    let before = levels[..peak].iter().filter(|level| **level > top - RANGE).count();
    let has_one_onset = before as f64 * FRAME < 0.1;
    if fallen.is_some() && !rises_again && has_one_onset {
        return SourceKind::Impulsive;
    }
    let sounding = levels.iter().filter(|level| **level > top - RANGE).count();
    if sounding as f64 >= SHARE * levels.len() as f64 {
        SourceKind::Continuous
    } else {
        SourceKind::Impulsive
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn rings_are_impulsive_and_rubbing_is_continuous() {
        let rate = 8000.0;
        let ring = |decay: f64| -> Vec<f32> {
            (0..12_000)
                .map(|i| ((-(i as f64) / rate * decay).exp() * (0.9 * i as f64).sin()) as f32)
                .collect()
        };
        let mut rng = Rng::new(1);
        let rub: Vec<f32> = (0..12_000).map(|_| rng.between(-0.1, 0.1) as f32).collect();
        assert_eq!(guess_kind(&ring(5.0), rate), SourceKind::Impulsive);
        assert_eq!(guess_kind(&rub, rate), SourceKind::Continuous);
        // Short noise, silence and nothing.
        assert_eq!(guess_kind(&rub[..3000], rate), SourceKind::Impulsive);
        assert_eq!(guess_kind(&[0.0; 12_000], rate), SourceKind::Impulsive);
        assert_eq!(guess_kind(&[], rate), SourceKind::Impulsive);
        // Two impacts far apart.
        let two = [ring(40.0), ring(40.0)].concat();
        assert_eq!(guess_kind(&two, rate), SourceKind::Impulsive);
    }
}
