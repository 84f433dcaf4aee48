//! From features of recordings to points of damping.

use super::damping_points::{DampingPoints, DropReason, Dropped};
use crate::material::estimation::point::DampingPoint;
use crate::modal::FeatureSet;
use std::f64::consts::TAU;

/// Distance of hum from a multiple of its frequency, Hz.
const HUM_WIDTH: f64 = 0.3;
/// Decay rate below which a multiple of a mains frequency is hum, 1/s.
const HUM_DECAY: f64 = 1.0;
/// Minimum share of features dropped as too slow that the fit has to account for.
const TRUNCATED_SHARE: f64 = 0.01;
/// Distance of one mode in two recordings: Hz, and relative.
const SAME_MODE: [f64; 2] = [0.5, 0.001];

/// Thresholds of the gate.
#[derive(Clone, Debug, PartialEq)]
pub struct Gate {
    /// Smallest decay rate of the amplitude, 1/s.
    pub d_min: f64,
    /// Largest decay rate of the amplitude, 1/s.
    pub d_max: f64,
    /// Smallest amplitude relative to the loudest of the recording, dB.
    pub amp_min_db: f64,
    /// Largest relative residual.
    pub max_quality: f64,
    /// Mains frequencies, Hz.
    pub hum: Vec<f64>,
}

impl Default for Gate {
    fn default() -> Self {
        Self { d_min: 0.25, d_max: 500.0, amp_min_db: -50.0, max_quality: 0.25, hum: vec![50.0, 60.0] }
    }
}

impl Gate {
    /// Makes points of the features of recordings: `lambda = (2 pi f)^2 + d^2`, `c = 2 d`.
    ///
    /// Features of different recordings of one object within 0.5 Hz or 0.1 % are one mode. If more than 1 % are dropped as too slow, the
    /// points state the damping at which they are truncated.
    ///
    /// # Complexity
    /// O(n log n).
    ///
    /// # Source
    /// Sterling et al. (IEEE TVCG 25(5), 2019), section 4.1 and (8).
    #[must_use]
    pub fn points(&self, sets: &[FeatureSet]) -> DampingPoints {
        let mut out = DampingPoints {
            recordings: sets.iter().map(|s| s.recording.clone()).collect(),
            supports: sets.iter().map(support).collect(),
            ..DampingPoints::default()
        };
        let mut objects: Vec<&str> = Vec::new();
        let mut object_of = Vec::new();
        for (recording, set) in sets.iter().enumerate() {
            let object = objects.iter().position(|o| *o == set.object).unwrap_or_else(|| {
                objects.push(&set.object);
                objects.len() - 1
            });
            let loudest = set.features.iter().map(|f| f.amp).fold(0.0, f64::max);
            let quietest = loudest * 10_f64.powf(self.amp_min_db / 20.0);
            for (feature, f) in set.features.iter().enumerate() {
                let reason = if self.is_hum(f.freq_hz, f.decay) {
                    Some(DropReason::Hum)
                } else if f.decay < self.d_min {
                    Some(DropReason::DTooSmall)
                } else if f.decay > self.d_max {
                    Some(DropReason::DTooLarge)
                } else if f.amp < quietest {
                    Some(DropReason::Quiet)
                } else if f64::from(f.quality) > self.max_quality {
                    Some(DropReason::PoorFit)
                } else {
                    None
                };
                if let Some(reason) = reason {
                    let (recording, feature) = (recording as u32, feature as u32);
                    out.dropped.push(Dropped {
                        recording,
                        feature,
                        freq_hz: f.freq_hz,
                        decay: f.decay,
                        reason,
                    });
                    continue;
                }
                object_of.push((object, f.freq_hz));
                out.points.push(DampingPoint {
                    sd_c: 2.0 * f.sd_decay,
                    recording: recording as u32,
                    ..DampingPoint::new((TAU * f.freq_hz).powi(2) + f.decay * f.decay, 2.0 * f.decay)
                });
            }
        }
        let slow = out.dropped.iter().filter(|d| d.reason == DropReason::DTooSmall).count();
        if slow as f64 > TRUNCATED_SHARE * (slow + out.points.len()) as f64 {
            out.truncated_below = Some(2.0 * self.d_min);
        }
        cluster(&mut out.points, &object_of);
        out
    }

    fn is_hum(&self, frequency: f64, decay: f64) -> bool {
        let near = |mains: &f64| {
            let multiple = (frequency / mains).round().max(1.0);
            (frequency - multiple * mains).abs() < HUM_WIDTH
        };
        decay < HUM_DECAY && self.hum.iter().any(near)
    }
}

/// Name of a support of an object.
fn support(set: &FeatureSet) -> Option<String> {
    (!set.support.is_empty()).then(|| format!("{}: {}", set.object, set.support))
}

/// Numbers the modes: single linkage along the frequencies of each object.
///
/// `object_of` has the object and the frequency in Hz of each point.
pub(crate) fn cluster(points: &mut [DampingPoint], object_of: &[(usize, f64)]) {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| {
        let ((oa, fa), (ob, fb)) = (object_of[*a], object_of[*b]);
        oa.cmp(&ob).then(fa.total_cmp(&fb))
    });
    let mut mode = 0;
    for (k, i) in order.iter().enumerate() {
        if k > 0 {
            let ((before, low), (object, high)) = (object_of[order[k - 1]], object_of[*i]);
            let [absolute, relative] = SAME_MODE;
            if object != before || high - low > absolute.max(relative * low) {
                mode += 1;
            }
        }
        points[*i].mode_cluster = mode;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::Feature;

    fn feature(freq_hz: f64, decay: f64) -> Feature {
        Feature { freq_hz, decay, amp: 0.5, sd_decay: 0.1, ..Feature::default() }
    }

    #[test]
    fn every_feature_gives_a_point_or_a_reason() {
        let bad = |f: Feature| FeatureSet { features: vec![feature(440.0, 3.0), f], ..FeatureSet::default() };
        for (f, reason) in [
            (feature(150.1, 0.1), DropReason::Hum),
            (feature(440.0, 0.1), DropReason::DTooSmall),
            (feature(440.0, 900.0), DropReason::DTooLarge),
            (Feature { amp: 1e-4, ..feature(440.0, 3.0) }, DropReason::Quiet),
            (Feature { quality: 0.5, ..feature(440.0, 3.0) }, DropReason::PoorFit),
        ] {
            let found = Gate::default().points(&[bad(f)]);
            assert_eq!((found.points.len(), found.dropped[0].reason), (1, reason));
            assert_eq!((found.dropped[0].feature, found.dropped[0].freq_hz), (1, f.freq_hz));
            assert_eq!(found.truncated_below.is_some(), reason == DropReason::DTooSmall);
        }
        // A mode on a multiple of the mains frequency that decays is none.
        assert_eq!(Gate::default().points(&[bad(feature(150.0, 5.0))]).points.len(), 2);
    }

    #[test]
    fn points_have_natural_frequencies_and_twice_the_decay() {
        let set = FeatureSet { features: vec![feature(100.0, 300.0)], ..FeatureSet::default() };
        let found = Gate::default().points(&[set]);
        let p = found.points[0];
        assert!((p.lambda - ((TAU * 100.0).powi(2) + 9e4)).abs() < 1e-6);
        assert_eq!((p.c, p.sd_c), (600.0, 0.2));
    }

    #[test]
    fn recordings_of_one_object_share_modes() {
        let set = |object: &str, f: &[f64]| FeatureSet {
            object: object.into(),
            features: f.iter().map(|f| feature(*f, 3.0)).collect(),
            ..FeatureSet::default()
        };
        let sets = [set("a", &[440.0, 1000.0]), set("a", &[440.3, 1002.0]), set("b", &[440.0])];
        let modes: Vec<u32> = Gate::default().points(&sets).points.iter().map(|p| p.mode_cluster).collect();
        assert_eq!(modes[0], modes[2]);
        assert!(modes[1] != modes[3] && modes[4] != modes[0], "{modes:?}");
    }
}
