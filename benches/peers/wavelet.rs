//! Item 7: Wavelet transform by db5 over 16 levels and back, in both precisions; and a texture of 2048 samples from as many.
//!
//! foley's transform takes a multiple of 2^16 samples: 983,040 in place of 960,000, 2.4 % more. The plain synthesis of the others compares each
//! node with all of its level; foley's learns thresholds first, which is timed as well.

use super::data::{Rng, noise};
use super::measure::Item;
use foley_nodes::core::random::Random;
use foley_nodes::soundtrack::synthesis::{SynthesisRules, TextureStream};
use foley_nodes::soundtrack::wavelet::{
    TextureModel, ThresholdRules, TreeFit, TreeRecording, TreeRules, Wavelet, WaveletTree, forward, inverse,
};
use std::sync::Arc;

const LEVELS: u32 = 16;
const SAMPLES: usize = 960_000_usize.next_multiple_of(1 << LEVELS);
const TEXTURE: usize = 1 << 11;
const RATE: f64 = 32_000.0;

fn transforms(item: Item) {
    item.print("levels", f64::from(LEVELS), "levels");
    item.print("samples", SAMPLES as f64, "samples");
    let mut rng = Rng(7);
    let double: Vec<f64> = (0..SAMPLES).map(|_| rng.normal()).collect();
    let single: Vec<f32> = double.iter().map(|x| *x as f32).collect();
    let [of_double, of_single] = ["float64", "float32"];
    let tree = forward(Wavelet::Db5, LEVELS, &double);
    item.time(&format!("wavedec.{of_double}"), 1e3, "ms", || forward(Wavelet::Db5, LEVELS, &double));
    item.time(&format!("waverec.{of_double}"), 1e3, "ms", || inverse(Wavelet::Db5, &tree));
    let tree = forward(Wavelet::Db5, LEVELS, &single);
    item.time(&format!("wavedec.{of_single}"), 1e3, "ms", || forward(Wavelet::Db5, LEVELS, &single));
    item.time(&format!("waverec.{of_single}"), 1e3, "ms", || inverse(Wavelet::Db5, &tree));
}

fn texture(item: Item) {
    let source =
        TreeRecording { name: "noise".into(), content: String::new(), channels: vec![noise(77, TEXTURE)] };
    let rules = TreeRules {
        wavelet: Wavelet::Haar,
        block: Some(TEXTURE as f64 / RATE),
        fit: TreeFit::Trim,
        ..TreeRules::default()
    };
    let tree = WaveletTree::analyse(RATE, &[source], &rules).expect("the recording is long enough");
    let mut out = vec![0.0; TEXTURE];
    item.time("synthesis.2^11-samples", 1.0, "s", || {
        let model = Arc::new(TextureModel::new(tree.clone(), &ThresholdRules::default()));
        let mut stream = TextureStream::new(
            model,
            Arc::default(),
            SynthesisRules::default(),
            Random::new(1, "texture"),
            None,
        );
        stream.fill(0, None, &mut out, &mut []);
    });
    item.print(
        "synthesis.rms",
        (out.iter().map(|x| x * x).sum::<f32>() / TEXTURE as f32).sqrt().into(),
        "rms",
    );
}

pub fn bench(item: Item) {
    transforms(item);
    texture(item);
}
