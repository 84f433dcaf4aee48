//! Item 1: Mel cepstrum of 225 s of noise with 40 triangular bands: at 96 kHz, 3 coefficients of each 403 samples, transforms of 512; and at
//! 44.1 kHz, 13 coefficients of 2048 samples every 512.
//!
//! The other programs compute in single precision, foley in double. Where foley cuts recordings to units it takes a frame of two units, and
//! three rectangular bands; here it has the frames and bands of the others.

use super::data::Rng;
use super::measure::Item;
use foley_nodes::core::time::Rate;
use foley_nodes::feature::{BandShape, FeatureConventions, FeatureWindow, MelCepstrum};

const SECONDS: usize = 225;

pub fn bench(item: Item) {
    for (name, rate, frame, hop, n) in
        [("short", 96_000_u32, 403_u32, 403_u32, 3), ("usual", 44_100, 2048, 512, 13)]
    {
        let mut rng = Rng(1);
        let sound: Vec<f32> = (0..SECONDS * rate as usize).map(|_| 0.1 * rng.uniform() as f32).collect();
        let conventions = FeatureConventions {
            window: FeatureWindow::Hann,
            frame,
            shape: BandShape::Triangular,
            bands: 40,
            f_hi: f64::from(rate) / 2.0,
            n,
            high_pass: 0.0,
            ..FeatureConventions::cloth(Rate::hz(rate), hop)
        };
        let mut cepstrum = MelCepstrum::new(&conventions, 1e-10);
        let (dims, frames) = (conventions.dims(), sound.windows(frame as usize).step_by(hop as usize));
        let mut features = vec![0.0; frames.len() * dims];
        item.print(&format!("frames.{name}"), frames.len() as f64, "frames");
        item.time(name, 1.0, "s", || {
            for (frame, out) in frames.clone().zip(features.chunks_exact_mut(dims)) {
                cepstrum.process(frame, out);
            }
        });
    }
}
