use super::*;
use crate::core::random::Rng;
use crate::scrape::testing::{amplitude, db, peak, rms};
use fearless_simd::{Level, dispatch};
use foley_fft::FftPlanner;
use std::f64::consts::TAU;

fn wave(cycles: usize, n: usize) -> NoiseBands {
    let samples = (0..n).map(|k| (TAU * (cycles * k) as f64 / n as f64).sin() as f32).collect();
    NoiseBands::new(&NoiseLine { samples, spacing: 1e-3 })
}

fn read(bands: &NoiseBands, position: f64, step: f32) -> f32 {
    let level = Level::new();
    dispatch!(level, simd => bands.read(simd, position, step))
}

/// Sound of a loop that is passed at `step` samples a sample.
fn heard(bands: &NoiseBands, step: f64, samples: usize) -> Vec<f32> {
    let position = |k: usize| (k as f64 * step).rem_euclid(bands.round());
    (0..samples).map(|k| read(bands, position(k), step as f32)).collect()
}

#[test]
fn a_grating_keeps_frequency_and_level_up_to_four_tenths_of_the_rate_and_then_is_gone() {
    let (n, fs) = (4096, 44_100.0);
    for cycles in [40, 210, 800, 1500] {
        let bands = wave(cycles, n);
        let k = cycles as f64 / n as f64;
        for part in [0.01, 0.05, 0.12, 0.2, 0.29, 0.35, 0.399, 0.52, 0.7, 1.1, 2.3] {
            let step = part / k;
            let out = heard(&bands, step, 8820);
            let whole = rms(&out) * 2_f64.sqrt();
            if part < 0.4 {
                assert!(db(whole).abs() < 0.5, "{cycles} at {part}: {} dB", db(whole));
                let f = peak(&out, part * fs, fs);
                assert!((f / (part * fs) - 1.0).abs() < 1e-3, "{cycles} at {part}: {f}");
            } else {
                assert!(db(whole) < -60.0, "{cycles} at {part}: {} dB", db(whole));
            }
        }
    }
}

#[test]
fn images_and_aliases_stay_below_60_db() {
    let (n, fs) = (4096, 44_100.0);
    // Cycles per sample and steps; the images lie around each multiple of the density.
    for (cycles, step) in [(300, 0.05), (800, 0.3), (1400, 0.21), (300, 1.7), (1200, 1.1), (100, 6.3)] {
        let bands = wave(cycles, n);
        let k = cycles as f64 / n as f64;
        let out = heard(&bands, step, 22_050);
        let line = amplitude(&out, k * step * fs, fs);
        for image in [1.0 - k, 1.0 + k, 2.0 - k, 2.0 + k, 0.5 - k, 0.5 + k] {
            let f = (image * step).rem_euclid(1.0);
            let f = if f > 0.5 { 1.0 - f } else { f };
            if (f - k * step).abs() > 0.002 {
                let level = db(amplitude(&out, f * fs, fs) / line);
                assert!(level < -60.0, "{cycles} at {step}: {level} dB at {f}");
            }
        }
    }
}

#[test]
fn a_white_profile_keeps_97_percent_and_has_no_images() {
    // Energy above 4 kHz of a profile at 4000 samples per second, and the remaining variance.
    let table = [
        (NoiseInterp::Linear, -25.0, 3.0, 0.66),
        (NoiseInterp::Catmull, -43.0, 3.0, 0.81),
        (NoiseInterp::Bspline3, -52.0, 3.0, 0.48),
        (NoiseInterp::Sinc32, -108.0, 1.0, 0.97),
    ];
    for (interp, images, slack, variance) in table {
        let (level, retained) = images_of(interp);
        println!("{interp:?}: {level:.1} dB above 4 kHz, {retained:.3} of the variance");
        assert!(
            (retained - variance).abs() < 0.04 && (level - images).abs() < slack,
            "{interp:?}: {level} {retained}"
        );
    }
}

/// Level in dB above 4 kHz, and the share of the variance that remains.
fn images_of(interp: NoiseInterp) -> (f64, f64) {
    let mut state = 7_u32;
    let samples: Vec<f32> = (0..8192)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (f64::from(state >> 8) / f64::from(1 << 24) - 0.5) as f32
        })
        .collect();
    let drawn = rms(&samples);
    let bands = NoiseBands::read_by(&NoiseLine { samples, spacing: 1e-3 }, interp);
    let step = 4000.0 / 44_100.0;
    let out = heard(&bands, step, 44_100);
    let retained = (rms(&out) / drawn).powi(2);
    let n = out.len();
    let mut buffer: Vec<_> = (0..n)
        .map(|k| Complex::new(f64::from(out[k]) * (0.5 - 0.5 * (TAU * k as f64 / n as f64).cos()), 0.0))
        .collect();
    FftPlanner::new().plan_fft_forward(n).process(&mut buffer);
    let energy = |from: usize, to: usize| buffer[from..to].iter().map(Complex::norm_sqr).sum::<f64>();
    let level = 10.0 * (energy(4000, n / 2) / energy(0, n / 2)).log10();
    (level, retained)
}

#[test]
fn what_is_read_is_the_sum_of_all_samples_times_their_weights() {
    let mut rng = Rng::new(12);
    let samples: Vec<f32> = (0..1000).map(|_| rng.between(-1.0, 1.0) as f32).collect();
    let bands = NoiseBands::new(&NoiseLine { samples, spacing: 1e-3 });
    // The definition, of one band, in double precision.
    let naive = |k: usize, position: f64| -> f64 {
        let band = &bands.bands[k];
        let position = position * band.density;
        let first = position.floor() - 15.0;
        let weight = |t: usize| NoiseInterp::Sinc32.weight(first + t as f64 - position);
        (0..TAPS).map(|t| weight(t) * f64::from(band.samples[position as usize + 1 + t])).sum()
    };
    let mut worst = 0.0_f64;
    for k in 0..4000 {
        let position = (f64::from(k) * 1.618_034) % bands.round();
        for step in [0.3_f32, 1.07, 1.3, 1.71, 1.81, 2.9, 5.0] {
            let depth = f64::from(log2(step * (1.0 / WHOLE as f32)) * OCTAVE as f32).max(0.0);
            let (below, part) = (depth as usize, depth.fract());
            let right = naive(below, position) * (1.0 - part) + part * naive(below + 1, position);
            worst = worst.max((f64::from(read(&bands, position, step)) - right).abs());
        }
    }
    assert!(worst < 2e-5, "{worst}");
}

#[test]
fn what_slow_steps_need_is_the_same_of_fewer_bands() {
    let mut rng = Rng::new(4);
    let samples: Vec<f32> = (0..3000).map(|_| rng.between(-1.0, 1.0) as f32).collect();
    let profile = NoiseLine { samples, spacing: 1e-3 };
    let all = NoiseBands::new(&profile);
    for (fastest, count) in [(0.0, 1), (0.89, 1), (1.7, 9), (4.0, 19)] {
        let few = NoiseBands::up_to(&profile, fastest);
        assert_eq!((few.bands.len(), &few.bands[..]), (count, &all.bands[..count]), "{fastest}");
        for part in [0.1, 0.5, 0.7, 0.93, 0.99, 1.0] {
            let step = (part * fastest) as f32;
            assert_eq!(read(&few, 1234.5, step), read(&all, 1234.5, step), "{step} of {fastest}");
        }
    }
}

#[test]
fn a_cell_is_read_as_its_samples_are() {
    let mut rng = Rng::new(5);
    let samples: Vec<f32> = (0..500).map(|_| rng.between(-1.0, 1.0) as f32).collect();
    let bands = NoiseBands::new(&NoiseLine { samples, spacing: 1e-3 });
    for fastest in [0.5, 0.9, 1.8] {
        let steps: Cell = std::array::from_fn(|_| rng.between(0.0, fastest) as f32);
        let positions = std::array::from_fn(|_| rng.between(0.0, bands.round()));
        let level = Level::new();
        let made = dispatch!(level, simd => bands.read_cell(simd, &positions, &steps, 3..CELL - 2));
        for n in 0..CELL {
            let right = if (3..CELL - 2).contains(&n) { read(&bands, positions[n], steps[n]) } else { 0.0 };
            assert_eq!(made[n], right, "{n} of steps up to {fastest}");
        }
    }
}

#[test]
fn any_length_closes_to_a_loop() {
    for n in [1, 2, 63, 100, 1021] {
        let bands = wave(1, n);
        for step in [0.1_f32, 1.3, 40.0] {
            let seam = read(&bands, bands.round() - 1e-7, step) - read(&bands, 0.0, step);
            assert!(seam.abs() < 1e-4, "{n} at {step}: {seam}");
        }
    }
}
