//! Time to render 60 s of friction sound of 10,000 sliding vertices on one core.
//!
//! Per-vertex synthesis is timed over a shorter duration, which is printed, and scaled up. Run with
//! `cargo bench -p foley-nodes -- friction`.

use std::error::Error;
use std::time::Instant;

use foley_nodes::core::random::Random;
use foley_nodes::friction::{
    ClipInput, ClipStream, Emitters, FrictionModel, IftNoise, IftNoiseParams, Mono, Receiver,
};

const VERTICES: usize = 10_000;
const SECONDS: f64 = 60.0;

/// Returns a model with a spectral peak that rises from 0.5 to 8 kHz over 32 speeds.
fn model() -> Result<FrictionModel, Box<dyn Error>> {
    let (bins, df) = (2401, 20.0);
    let speeds: Vec<f64> = (0..32).map(|k| 0.02 * 100.0_f64.powf(f64::from(k) / 31.0)).collect();
    let psd = (0..32).flat_map(|k| {
        let peak = 500.0 * 16.0_f64.powf(f64::from(k) / 31.0);
        (0..bins).map(move |i| (1e-9 * (-0.5 * ((f64::from(i) * df - peak) / 400.0).powi(2)).exp()) as f32)
    });
    Ok(FrictionModel::from_psd(["bump".into(), "bump".into()], speeds, psd.collect(), 96000.0)?)
}

/// Two ears that multiply every bin by a complex response: the work of a head-related filter without its design.
struct Ears {
    response: Vec<(f32, f32)>,
}

impl Receiver for Ears {
    fn channels(&self) -> usize {
        2
    }

    fn add(&mut self, _: usize, _: Option<[f32; 3]>, x: (&[f32], &[f32]), sum: (&mut [f32], &mut [f32])) {
        let bins = x.0.iter().zip(x.1).zip(sum.0.iter_mut().zip(sum.1.iter_mut()));
        for (((a, b), (re, im)), (c, d)) in bins.zip(&self.response) {
            *re += a * c - b * d;
            *im += a * d + b * c;
        }
    }
}

/// Renders `duration` seconds and prints the time for a minute.
fn time<R: Receiver>(
    name: &str,
    fs: f64,
    emitters: Emitters,
    duration: f64,
    receiver: R,
) -> Result<(), Box<dyn Error>> {
    let positions: Vec<[f32; 3]> =
        (0..VERTICES).map(|v| [0.01 * (v % 100) as f32, 0.01 * (v / 100) as f32, 0.0]).collect();
    // 64 clips of random speeds that cover the table and a margin on both sides.
    let random = Random::new(1, "speeds");
    let speeds: Vec<Vec<f32>> = (0..64)
        .map(|k| {
            (0..VERTICES).map(|v| 0.01 * 250.0_f32.powf(random.uniform(v as u32, k, 0) as f32)).collect()
        })
        .collect();
    let params = IftNoiseParams { emitters, ..Default::default() };
    let areas = vec![1e-4; VERTICES];
    let noise = IftNoise::with_receiver(&model()?, fs, params, &areas, Random::new(1, "bench"), receiver)?;
    let channels = noise.channels();
    let mut stream = ClipStream::new(noise);
    let mut out = vec![0.0; 4096 * channels];
    let start = Instant::now();
    let (mut from, total, mut power) = (0, (duration * fs) as u64, 0.0_f64);
    while from < total {
        stream.fill(from, &mut out, |k| ClipInput {
            speeds: &speeds[k as usize % speeds.len()],
            positions: Some(&positions),
            pressures: None,
        })?;
        power += out.iter().map(|&x| f64::from(x * x)).sum::<f64>();
        from += 4096;
    }
    let seconds = start.elapsed().as_secs_f64() * SECONDS / (from as f64 / fs);
    println!(
        "{fs:>6} Hz  {name:<24} {seconds:>8.2} s  {:>7.1} x real time  (rms {:.4}, timed over {duration} s)",
        SECONDS / seconds,
        (power / (from as f64 * channels as f64)).sqrt(),
    );
    Ok(())
}

pub fn bench() -> Result<(), Box<dyn Error>> {
    println!(
        "{VERTICES} sliding vertices, {SECONDS} s of sound, 50 ms clips, one core (aim 6 s clustered, 10 s with two ears; the paper took \
         75 to 455 s for a take of unknown size)"
    );
    for fs in [44100.0, 96000.0] {
        time("clustered, mono", fs, Emitters::default(), 60.0, Mono)?;
        let ears = Ears { response: vec![(0.6, 0.8); 2401] };
        time("64 clusters, two ears", fs, Emitters::default(), 20.0, ears)?;
        time("per vertex, mono", fs, Emitters::PerVertex, 0.5, Mono)?;
    }
    Ok(())
}
