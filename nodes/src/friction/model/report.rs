//! The friction model in reports: its figure and its summary.

use super::conventions::{Conventions, Origin};
use super::friction_model::{FrictionModel, MODEL_VERSION};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::plot::{Axis, Line, chart};

/// Maximum number of spectra in a figure.
const MAX_LINES: usize = 8;
/// Lower end of the axis of power density, relative to the maximum.
const AXIS_FLOOR: f64 = 1e-9;

impl Data for FrictionModel {
    const NAME: &'static str = "friction model";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let (speeds, bins) = (2 + rng.below(3), 17 + 16 * rng.below(4));
        let speeds: Vec<f64> = (0..speeds).map(|k| 0.05 * 3f64.powi(k as i32)).collect();
        let mut psd = Vec::with_capacity(speeds.len() * bins);
        for speed in &speeds {
            psd.extend((0..bins).map(|_| (1e-9 * speed * rng.uniform()) as f32));
        }
        let pair = ["trial".to_owned(), "trial".to_owned()];
        Self::from_psd(pair, speeds.clone(), psd, 16_000.0).unwrap_or_else(|_| Self::silent())
    }

    /// Power density against frequency, one line per speed: figure 3 of An, James and Marschner (2012).
    fn plot(&self) -> Option<String> {
        let count = self.speeds.len();
        let line_count = count.min(MAX_LINES);
        let max = self.psd.iter().copied().fold(0.0, f32::max);
        if count == 0 || self.bins() < 2 || max <= 0.0 {
            return None;
        }
        let (max, nyquist) = (f64::from(max), 0.5 * self.fs);
        let lowest = self.df.max(20.0).min(0.5 * nyquist);
        let lines: Vec<Line> = (0..line_count)
            .map(|k| k * (count - 1) / (line_count - 1).max(1))
            .map(|k| {
                let powers = self.row(k).iter().enumerate();
                let points = powers.map(|(bin, &s)| [bin as f64 * self.df, f64::from(s)]);
                let points = points.filter(|p| p[0] >= lowest).collect();
                Line::new(format!("{:.3} m/s", self.speeds[k]), points)
            })
            .collect();
        let x = Axis { label: "frequency, Hz".into(), range: [lowest, nyquist], log: true };
        let y = Axis {
            label: "power density, full scale² / Hz".into(),
            range: [max * AXIS_FLOOR, 2.0 * max],
            log: true,
        };
        let [a, b] = &self.material_pair;
        Some(chart(&format!("Friction of {a} on {b} by sliding speed"), &x, &y, &lines))
    }
}

impl FrictionModel {
    /// Returns a silent model of two speeds.
    fn silent() -> Self {
        Self {
            version: MODEL_VERSION,
            material_pair: Default::default(),
            speeds: vec![0.1, 1.0],
            psd: vec![0.0; 4],
            df: 8000.0,
            fs: 16_000.0,
            floor: Vec::new(),
            clips: vec![1; 2],
            rejected: Default::default(),
            conventions: Conventions {
                origin: Origin::Given,
                clip_samples: 2,
                hop: 0.0,
                high_pass: 0.0,
                floor_subtracted: false,
                contact_area: 1e-4,
            },
            sources: Vec::new(),
        }
    }
}

/// Summary of a model for the report.
pub(crate) fn model_summary(model: &FrictionModel) -> Summary {
    let (slowest, fastest) = model.speed_range();
    let rejected = &model.rejected;
    vec![
        ("speeds", model.speeds.len().into()),
        ("slowest", slowest.into()),
        ("fastest", fastest.into()),
        ("clips", model.clips.iter().sum::<u32>().into()),
        ("rejected_seam", rejected.seam.into()),
        ("rejected_speed_change", rejected.speed_change.into()),
        ("rejected_at_rest", rejected.at_rest.into()),
        ("rejected_silent", rejected.silent.into()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::testing::bump_model;

    #[test]
    fn the_figure_has_a_line_per_speed_with_its_label() {
        let model = bump_model(&[(0.1, 1000.0), (0.4, 4000.0)], 300.0, 48000.0, 480);
        let svg = model.plot().unwrap();
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert!(svg.contains("0.100 m/s") && svg.contains("0.400 m/s") && svg.contains("frequency, Hz"));
        assert_eq!(FrictionModel::silent().plot(), None);
    }

    #[test]
    fn trial_models_and_the_silent_model_are_valid() {
        FrictionModel::silent().validate().unwrap();
        let mut rng = Rng::new(3);
        for _ in 0..20 {
            FrictionModel::trial(&mut rng).validate().unwrap();
        }
    }
}
