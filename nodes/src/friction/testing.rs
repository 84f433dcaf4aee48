//! Models and measures for the tests of this folder.

use crate::friction::FrictionModel;

/// Returns a model whose amplitude at each `(speed, peak)` is a Gaussian bump of the given width over a small floor.
/// The level is proportional to speed.
pub(crate) fn bump_model(peaks: &[(f64, f64)], width: f64, fs: f64, clip_samples: usize) -> FrictionModel {
    let bins = clip_samples / 2 + 1;
    let df = fs / clip_samples as f64;
    let psd = peaks
        .iter()
        .flat_map(|&(speed, peak)| {
            let level = 1e-2 * speed / width.sqrt();
            (0..bins).map(move |k| {
                let x = (k as f64 * df - peak) / width;
                let a = level * ((-0.5 * x * x).exp() + 1e-4);
                if k == 0 { 0.0 } else { (a * a) as f32 }
            })
        })
        .collect();
    let speeds = peaks.iter().map(|p| p.0).collect();
    FrictionModel::from_psd(["bump".into(), "table".into()], speeds, psd, fs).expect("test model is valid")
}

/// Returns the power in third octaves from 25 Hz: `[(centre, power)]`.
pub(crate) fn third_octaves(psd: &[f64], df: f64) -> Vec<(f64, f64)> {
    let nyquist = (psd.len() - 1) as f64 * df;
    (-16..)
        .map(|i| 1000.0 * 2.0_f64.powf(f64::from(i) / 3.0))
        .take_while(|c| c * 2.0_f64.powf(-1.0 / 6.0) < nyquist)
        .map(|c| {
            let (low, high) = (c * 2.0_f64.powf(-1.0 / 6.0), c * 2.0_f64.powf(1.0 / 6.0));
            let power = psd.iter().enumerate().map(|(k, s)| {
                let (a, b) = ((k as f64 - 0.5) * df, (k as f64 + 0.5) * df);
                s * (b.min(high) - a.max(low)).max(0.0)
            });
            (c, power.sum())
        })
        .collect()
}
