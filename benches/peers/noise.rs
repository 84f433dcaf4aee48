//! Item 11: Inverse real Fourier transforms for noise: 2048, 2205 and 4096 points, in single precision.
//!
//! foley has no transform of its own to call: a `clip` of friction noise is a power for each bin between two measured speeds, a random phase and
//! a Rayleigh magnitude for each, the inverse transform, and a window; `clip-fixed` has the magnitudes of the model. The others time the
//! transform alone. A clip has an even number of samples, 2206 in place of 2205.

use super::measure::{Item, threads};
use foley_nodes::core::random::Random;
use foley_nodes::friction::{ClipInput, FrictionModel, IftNoise, IftNoiseParams, Magnitude};

const RATE: f64 = 44_100.0;
const BINS: usize = 2049;
/// Clips of a run.
const CLIPS: usize = 2048;

pub fn bench(item: Item) {
    let t = threads();
    let speeds: Vec<f64> = (0..32).map(|k| 0.02 * 100_f64.powf(f64::from(k) / 31.0)).collect();
    let psd = vec![1e-9; speeds.len() * BINS];
    let model = FrictionModel::from_psd(["noise".into(), "noise".into()], speeds, psd, RATE)
        .expect("a model of white noise");
    for samples in [2048, 2206, 4096] {
        for (name, magnitude) in [("clip", Magnitude::Rayleigh), ("clip-fixed", Magnitude::Fixed)] {
            let params = IftNoiseParams {
                clip: f64::from(samples) / RATE,
                magnitude: Some(magnitude),
                ..IftNoiseParams::default()
            };
            let random = Random::new(1, "noise");
            let mut noise = IftNoise::new(&model, RATE, params, &[1e-4], random).expect("the model fits");
            let mut out = vec![0.0; noise.clip_len()];
            item.rate(&format!("{name}.{samples}.f32.{t}t"), CLIPS as f64, "clips/s", || {
                for k in 0..CLIPS as u64 {
                    let input = ClipInput { speeds: &[0.3], ..ClipInput::default() };
                    noise.clip(k, input, &mut out).expect("a finite speed");
                }
            });
            let power = out.iter().map(|x| x * x).sum::<f32>() / samples as f32;
            item.print(&format!("{name}.{samples}.rms"), power.sqrt().into(), "rms");
        }
    }
}
