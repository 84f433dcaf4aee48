//! Item 5: Onsets by spectral flux in 225 s at 44.1 kHz, windows of 2048 every 512.
//!
//! `flux+pick` finds onsets with the strength of foley: the rise of 24 compressed bands. `flux` is the distance of normalised spectra, by which
//! foley cuts recordings; that of the others is the sum of rising magnitudes.

use super::data::Rng;
use super::measure::Item;
use foley_nodes::feature::{FluxFrames, ONSET_RISE, onsets, spectral_flux};

const RATE: f64 = 44_100.0;
const SAMPLES: usize = 225 * 44_100;
const ONSETS: usize = 900;

/// Noise under exponential decays.
fn recording() -> Vec<f32> {
    let mut rng = Rng(5);
    let mut envelope = vec![0.002_f64; SAMPLES];
    for _ in 0..ONSETS {
        let at = (rng.between(0.0, 224.0) * RATE) as usize;
        for (k, x) in envelope[at..at + 12_000].iter_mut().enumerate() {
            *x += 0.2 * (-(k as f64) / 2500.0).exp();
        }
    }
    envelope.into_iter().map(|level| (level * rng.normal()) as f32).collect()
}

pub fn bench(item: Item) {
    let sound = recording();
    let frames = FluxFrames { frame: 2048, hop: 512, exponent: 1 };
    let found = || onsets(&sound, frames, RATE, ONSET_RISE);
    item.print("onsets(true 900)", found().len() as f64, "onsets");
    item.time("flux+pick.225s", 1.0, "s", found);
    item.time("flux.225s", 1.0, "s", || spectral_flux(&sound, frames));
}
