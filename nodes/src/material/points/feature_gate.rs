//! From features to points, as a node.

use super::damping_points::DampingPoints;
use super::gate::Gate;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Func, Summary};
use crate::core::ports::{Many, Value};
use crate::core::shape::{Build, Shape};
use crate::modal::{Feature, FeatureSet, FeatureSets, Modes};
use crate::{params, ports};

params! {
    /// Makes points of damping over frequency of the modes of recordings, for a `DampingFit`.
    ///
    /// Each list is one recording. A feature that decays too slowly is a hum, one that decays too fast is part of the contact, and one
    /// that is too soft has no certain decay. A tap of `points` has the reason for each feature that is dropped. Features of different
    /// recordings of one object within 0.5 Hz or 0.1 % count as one mode. If more than 1 % were too slow, the fit takes
    /// this into account.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 4.1, which does not state the thresholds.
    pub struct FeatureGateParams {
        /// Smallest decay rate of the amplitude of a mode: 60 dB take 6.9 / `d_min` seconds.
        d_min: f64 = 0.25, unit "1/s", range 0.0..=1000.0;
        /// Largest decay rate of the amplitude of a mode.
        d_max: f64 = 500.0, unit "1/s", range 0.001..=100_000.0;
        /// Smallest amplitude of a mode, relative to the loudest of its recording.
        amp_min_db: f64 = -50.0, unit "dB", range -200.0..=0.0;
        /// Largest relative residual of the fit of a mode.
        max_quality: f64 = 0.25, unit "", range 0.0..=1.0;
        /// Mains frequencies whose multiples within 0.3 Hz are dropped if they hardly decay.
        hum: Vec<f64> = vec![50.0, 60.0], unit "Hz", range 1.0..=1000.0;
    }
}
ports! {
    pub struct FeatureGatePorts / FeatureGateIo {
        in {
            /// Modes of recordings, with their uncertainties.
            features: Many<Value<FeatureSets>>,
            /// Modes of one recording each, without uncertainties.
            modes: Many<Value<Modes>>,
        }
        out {
            /// The points, and the dropped features.
            points: Value<DampingPoints>,
        }
    }
}

/// The node over [`Gate`].
#[derive(Debug)]
pub struct FeatureGate;

/// The features of modes, whose amplitude is the largest gain over the contact points.
fn of_modes(modes: &Modes) -> FeatureSet {
    let loudest = |i: usize| {
        (0..modes.points()).filter_map(|p| modes.row(p).get(i)).fold(0.0_f32, |m, g| m.max(g.abs()))
    };
    let each = modes.frequencies.iter().zip(&modes.dampings).enumerate();
    let features = each.map(|(i, (freq_hz, decay))| Feature {
        freq_hz: *freq_hz,
        decay: *decay,
        amp: loudest(i).into(),
        phase: modes.phases.get(i).copied().unwrap_or(0.0).into(),
        ..Feature::default()
    });
    let (recording, object) = (modes.name.clone(), modes.name.clone());
    FeatureSet { recording, object, support: String::new(), features: features.collect() }
}

impl Func for FeatureGate {
    type Params = FeatureGateParams;
    type Ports = FeatureGatePorts;
    const NAME: &'static str = "FeatureGate";
    const VERSION: u32 = 2;
    // Recordings are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &FeatureGateParams, s: &mut Shape<'_, '_, FeatureGatePorts>) -> Result<(), Reject> {
        if p.d_max <= p.d_min {
            let message = format!("`d_max` is {} 1/s, `d_min` {} 1/s", p.d_max, p.d_min);
            s.wrong(Reject::new("F130", message).at("d_max").help("it must be more"));
        }
        Ok(())
    }

    fn eval(p: &FeatureGateParams, _: &Build<'_>, mut io: FeatureGateIo<'_>) -> Result<Summary, Fault> {
        let mut sets: Vec<FeatureSet> = io.features.iter().flat_map(|all| all.sets.iter().cloned()).collect();
        sets.extend(io.modes.iter().map(of_modes));
        for (k, set) in sets.iter().enumerate() {
            if let Some(fault) = set.fault() {
                let message = format!("recording {k} ({:?}): {fault}", set.recording);
                return Err(Fault::new("F135", message).at("features"));
            }
        }
        let gate = Gate {
            d_min: p.d_min,
            d_max: p.d_max,
            amp_min_db: p.amp_min_db,
            max_quality: p.max_quality,
            hum: p.hum.clone(),
        };
        let points = gate.points(&sets);
        let mut summary = points.summary();
        if points.points.is_empty() {
            summary
                .push(("warning", "no feature passed the gate: see the reasons in a tap of `points`".into()));
        }
        if let Some(low) = points.truncated_below {
            summary.push(("truncated_below", low.into()));
        }
        io.points.set(points);
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;

    #[test]
    fn modes_without_uncertainties_are_features_too() {
        let modes = Modes::trial(&mut Rng::new(3));
        let set = of_modes(&modes);
        assert_eq!((set.features.len(), set.fault()), (modes.len(), None));
        assert!(set.features.iter().any(|f| f.amp > 0.0));
        assert_eq!(
            Gate::default().points(&[set]).points.len(),
            modes.len() - Gate::default().points(&[of_modes(&modes)]).dropped.len()
        );
    }
}
