use super::super::exponentials::add;
use super::*;
use crate::core::random::Rng;
use crate::statistics::normal::normal_quantile;

/// A mode: frequency in Hz, decay rate in 1/s, amplitude, phase.
type Mode = (f64, f64, f64, f64);

fn exponents(modes: &[Mode], rate: f64) -> (Vec<C>, Vec<C>) {
    let exponent = |m: &Mode| C::new(-m.1 / rate, TAU * m.0 / rate);
    (modes.iter().map(exponent).collect(), modes.iter().map(|m| C::from_polar(m.2, m.3)).collect())
}

/// Modes after a silence, under white noise of a standard deviation.
fn sound(modes: &[Mode], rate: f64, seconds: f64, silence: usize, noise: f64, seed: u64) -> Vec<f32> {
    let mut out = vec![0.0; (seconds * rate) as usize];
    let (exponents, amplitudes) = exponents(modes, rate);
    add(&mut out[silence..], &exponents, &amplitudes);
    let mut rng = Rng::new(seed);
    out.iter().map(|x| (x + noise * normal_quantile(rng.uniform().max(1e-12))) as f32).collect()
}

/// Two of the extractors.
fn extractors() -> [ExtractParams; 2] {
    [Extractor::Subband, Extractor::Greedy { target: 0.9999, domain: FitDomain::Complex }]
        .map(|extractor| ExtractParams { extractor, ..ExtractParams::default() })
}

fn nearest(found: &Extracted, frequency: f64) -> Feature {
    let near = |f: &&Feature| (f.freq_hz / frequency - 1.0).abs() < 0.003;
    *found.features.iter().filter(near).max_by(|a, b| a.amp.total_cmp(&b.amp)).unwrap()
}

/// Least standard deviation of the decay rate of a mode under white noise.
fn bound(noise: f64, m: &Mode, rate: f64) -> f64 {
    4.0 * noise / m.2 * m.1.powf(1.5) / rate.sqrt()
}

#[test]
fn single_modes_are_measured_at_each_frequency_and_decay() {
    for (params, rate) in extractors()
        .into_iter()
        .zip([44_100.0, 96_000.0])
        .chain(extractors().into_iter().zip([96_000.0, 44_100.0]))
    {
        for f in [100.0, 1000.0, 8000.0] {
            for d in [3.0, 30.0, 300.0] {
                if f == 100.0 && d == 300.0 {
                    continue;
                }
                let mode = (f, d, 0.5, 0.3);
                let noise = 0.005;
                let samples = sound(&[mode], rate, 1.0, 6000, noise, 7);
                let found = extract(&samples, rate, &params).unwrap();
                let feature = nearest(&found, f);
                let bound = bound(noise, &mode, rate);
                // The onset is found within a fraction of a period only: phase and amplitude are those at the found one.
                let late = (found.onset as f64 - 6000.0) / rate;
                let (amp, phase) = (0.5 * libm::exp(-d * late), 0.3 + TAU * f * late);
                let turn = ((feature.phase - phase) / TAU).rem_euclid(1.0);
                assert!((feature.freq_hz - f).abs() <= (3.0 * bound / TAU).max(0.1), "{f} {d}: {feature:?}");
                assert!(
                    (feature.decay / d - 1.0).abs() <= 0.05_f64.max(3.0 * bound / d),
                    "{f} {d}: {feature:?}"
                );
                assert!(
                    (20.0 * (feature.amp / amp).log10()).abs() < if d > 100.0 { 1.0 } else { 0.5 },
                    "{f} {d}: {feature:?} {amp}"
                );
                assert!(turn.min(1.0 - turn) * TAU < 0.1 + 2.0 * bound / d, "{f} {d}: {feature:?} {phase}");
            }
        }
    }
}

#[test]
fn errors_are_near_the_bound_and_as_large_as_the_deviations() {
    let modes = [(400.0, 6.0, 0.3, 0.0), (1700.0, 25.0, 0.3, 1.0), (5200.0, 60.0, 0.3, 2.0)];
    let (rate, noise, runs) = (44_100.0, 3e-4, 20);
    for params in extractors() {
        let mut errors = [0.0; 3];
        let mut relative = Vec::new();
        for seed in 0..runs {
            let found = extract(&sound(&modes, rate, 1.5, 5000, noise, seed), rate, &params).unwrap();
            for (k, m) in modes.iter().enumerate() {
                let feature = nearest(&found, m.0);
                errors[k] += (feature.decay - m.1).powi(2);
                relative.push(((feature.decay - m.1) / feature.sd_decay).powi(2));
                assert!(feature.is_certain(0.3), "{feature:?}");
            }
            // Noise is no mode.
            assert!(found.features.len() <= 5, "{:?}", found.features);
        }
        for (k, m) in modes.iter().enumerate() {
            let rmse = (errors[k] / runs as f64).sqrt();
            assert!(rmse < 2.0 * bound(noise, m, rate), "{m:?}: {rmse} {}", bound(noise, m, rate));
        }
        let ratio = (relative.iter().sum::<f64>() / relative.len() as f64).sqrt();
        assert!((0.6..1.5).contains(&ratio), "{ratio}");
    }
}

#[test]
fn close_modes_are_resolved() {
    for (seed, (f, apart, d)) in
        [(1000.0, 12.0, 3.0), (2000.0, 3.0, 4.0), (300.0, 3.0, 4.0)].into_iter().enumerate()
    {
        let modes = [(f, d, 0.3, 0.0), (f + apart, 1.2 * d, 0.2, 1.0)];
        let samples = sound(&modes, 44_100.0, 2.0, 100, 3e-4, seed as u64);
        for (params, m) in extractors().into_iter().flat_map(|p| modes.map(|m| (p, m))) {
            let found = extract(&samples, 44_100.0, &params).unwrap();
            let near = found.features.iter().find(|q| (q.freq_hz - m.0).abs() < 0.3);
            let near = near.unwrap_or_else(|| panic!("{:?}", found.features));
            assert!((near.decay / m.1 - 1.0).abs() < 0.05, "{m:?} {near:?}");
        }
    }
}

#[test]
fn the_residual_is_the_recording_without_the_modes() {
    let modes = [(440.0, 5.0, 0.3, 0.0), (1234.0, 40.0, 0.2, 1.0)];
    let samples = sound(&modes, 44_100.0, 1.0, 1000, 0.01, 3);
    for params in extractors() {
        let found = extract(&samples, 44_100.0, &params).unwrap();
        let mut sum = found.residual.clone();
        let exponents: Vec<C> =
            found.features.iter().map(|f| C::new(-f.decay, TAU * f.freq_hz) / 44_100.0).collect();
        let amplitudes: Vec<C> = found.features.iter().map(|f| C::from_polar(f.amp, f.phase)).collect();
        add(&mut sum, &exponents, &amplitudes);
        for (n, (sum, x)) in sum.iter().zip(&samples[found.onset..]).enumerate() {
            assert!((sum - f64::from(*x)).abs() < 1e-12, "{n}: {sum} {x}");
        }
        assert_eq!(found.residual.len(), samples.len() - found.onset);
    }
}

#[test]
fn louder_recordings_have_larger_amplitudes_and_the_same_modes() {
    let modes = [(440.0, 5.0, 0.3, 0.0), (1234.0, 40.0, 0.2, 1.0)];
    let samples = sound(&modes, 44_100.0, 1.0, 1000, 0.001, 3);
    let loud: Vec<f32> = samples.iter().map(|x| 4.0 * x).collect();
    for params in extractors() {
        let [a, b] = [&samples, &loud].map(|x| extract(x, 44_100.0, &params).unwrap());
        assert_eq!(a.features.len(), b.features.len());
        for (a, b) in a.features.iter().zip(&b.features) {
            let same = (b.amp / a.amp - 4.0).abs() < 4e-9 && (b.decay / a.decay - 1.0).abs() < 1e-9;
            assert!(same, "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_hum_is_no_mode_of_the_material() {
    let mut samples = sound(&[(1000.0, 12.0, 0.3, 0.0)], 44_100.0, 1.5, 15_000, 1e-4, 3);
    for (n, x) in samples.iter_mut().enumerate() {
        *x += 0.02 * libm::sin(TAU * 50.0 * n as f64 / 44_100.0) as f32;
    }
    for params in extractors() {
        let found = extract(&samples, 44_100.0, &params).unwrap();
        let set = crate::modal::FeatureSet { features: found.features, ..Default::default() };
        let points = crate::material::Gate::default().points(&[set]).points;
        assert_eq!(points.len(), 1, "{params:?}: {points:?}");
        assert!((points[0].c / 24.0 - 1.0).abs() < 0.01, "{points:?}");
    }
}

#[test]
fn fits_to_powers_measure_modes_that_stand_alone() {
    let extractor = Extractor::Greedy { target: 0.9999, domain: FitDomain::Power };
    let params = ExtractParams { extractor, ..ExtractParams::default() };
    let mut worst = [0.0_f64; 2];
    for (seed, f) in [500.0, 1500.0, 8000.0].into_iter().enumerate() {
        for d in [3.0, 30.0, 200.0] {
            // 40 dB.
            let samples = sound(&[(f, d, 0.5, 0.3)], 44_100.0, 1.5, 6000, 0.005, seed as u64);
            let feature = nearest(&extract(&samples, 44_100.0, &params).unwrap(), f);
            let errors = [(feature.decay / d - 1.0).abs(), (feature.freq_hz - f).abs() / (1.0 + 0.02 * d)];
            worst = [worst[0].max(errors[0]), worst[1].max(errors[1])];
        }
    }
    eprintln!("fits to powers: largest errors of decay {:.4} and frequency {:.4}", worst[0], worst[1]);
    assert!(worst[0] < 0.04 && worst[1] < 0.2, "{worst:?}");
}

/// Number of modes that are found, by frequency and decay.
fn found_of(modes: &[Mode], found: &Extracted) -> usize {
    let near = |m: &&Mode| {
        let same = |f: &Feature| (f.freq_hz - m.0).abs() < 0.5 && (f.decay / m.1 - 1.0).abs() < 0.1;
        found.features.iter().any(same)
    };
    modes.iter().filter(near).count()
}

#[test]
fn both_methods_together_find_at_least_the_modes_of_one() {
    let mut counts = Vec::new();
    for seed in 0..3 {
        // 24 modes from 200 Hz to 12 kHz, two pairs close together, 50 dB.
        let mut rng = Rng::new(100 + seed);
        let mut modes: Vec<Mode> = (0..22)
            .map(|k| {
                let f = 200.0 * 60.0_f64.powf((f64::from(k) + 0.6 * rng.uniform()) / 22.0);
                (f, 3.0 + 3e-3 * f, rng.between(0.01, 0.2), rng.between(0.0, 6.0))
            })
            .collect();
        for (k, apart) in [(4, 5.3), (9, 10.0)] {
            let (f, d, a, phase) = modes[k];
            modes.push((f + apart, d, 0.7 * a, phase + 1.0));
        }
        let samples = sound(&modes, 44_100.0, 1.5, 6000, 1e-4, seed);
        let count = |extractor| {
            let found =
                extract(&samples, 44_100.0, &ExtractParams { extractor, ..Default::default() }).unwrap();
            (found_of(&modes, &found), found.features.len())
        };
        counts.push((count(Extractor::Subband), count(Extractor::Hybrid { target: 0.9999 })));
    }
    eprintln!("of 24 modes found, and all found, by one method and by both: {counts:?}");
    assert!(counts.iter().all(|(one, both)| both.0 >= one.0 && both.0 >= 22 && both.1 <= 28), "{counts:?}");
}

#[test]
fn the_search_by_peaks_ends_at_its_target() {
    // They have 96.2, 3.7 and 0.1 % of the energy.
    let modes = [(400.0, 6.0, 0.5, 0.0), (1700.0, 25.0, 0.2, 1.0), (5200.0, 60.0, 0.05, 2.0)];
    let samples = sound(&modes, 44_100.0, 1.5, 6000, 1e-4, 3);
    let count = |target| {
        let extractor = Extractor::Greedy { target, domain: FitDomain::Complex };
        let params = ExtractParams { extractor, ..ExtractParams::default() };
        extract(&samples, 44_100.0, &params).unwrap().features.len()
    };
    assert_eq!((count(0.5), count(0.98), count(0.9999)), (1, 2, 3));
}

#[test]
fn amplitudes_are_bounded() {
    // A short click is best matched by modes that cancel each other.
    let mut rng = Rng::new(9);
    let samples: Vec<f32> =
        (0..8000).map(|n| (rng.between(-1.0, 1.0) * libm::exp(-f64::from(n) / 60.0)) as f32).collect();
    let params = ExtractParams { contact: true, ..ExtractParams::default() };
    let found = extract(&samples, 44_100.0, &params).unwrap();
    let peak = samples.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    assert!(found.features.iter().all(|f| f.amp <= 4.0 * f64::from(peak) + 1e-9));
}

#[test]
fn a_step_that_decays_is_no_mode() {
    // A slow offset such as of a pressed microphone beside a mode that rings.
    let mut samples = sound(&[(1000.0, 30.0, 0.3, 0.0)], 44_100.0, 1.0, 100, 1e-5, 1);
    let offset = |n: usize| 2.0 * (-600.0 * n as f64 / 44_100.0).exp();
    samples.iter_mut().skip(100).enumerate().for_each(|(n, x)| *x += offset(n) as f32);
    let found = extract(&samples, 44_100.0, &ExtractParams::default()).unwrap();
    assert!(found.features.iter().all(|f| f.freq_hz >= 20.0), "{:?}", found.features);
    let feature = nearest(&found, 1000.0);
    assert!((feature.freq_hz - 1000.0).abs() < 1.0 && (feature.decay - 30.0).abs() < 1.5, "{feature:?}");
}

#[test]
fn the_modes_of_a_bank_are_found_in_its_output() {
    let modes =
        Modes::new("bar", vec![523.0, 1442.0, 2826.0], vec![4.0, 11.0, 30.0], vec![0.8, 0.5, 0.4]).unwrap();
    let (mut force, mut out) = (vec![0.0; 60_000], vec![0.0; 60_000]);
    force[500] = 0.5;
    crate::modal::Bank::new(&modes, 44_100.0, crate::modal::BankOutput::Displacement)
        .unwrap()
        .process(&force, &mut out);
    let found = extract(&out, 44_100.0, &ExtractParams { modes: 3, ..Default::default() }).unwrap();
    let again = found.modes("bar", 0.5, false);
    for k in 0..3 {
        assert!((again.frequencies[k] / modes.frequencies[k] - 1.0).abs() < 5e-4, "{again:?}");
        assert!((again.dampings[k] / modes.dampings[k] - 1.0).abs() < 0.02, "{again:?}");
        assert!((again.gains[k] / modes.gains[k] - 1.0).abs() < 0.06, "{again:?}");
    }
    // With phases, an impact sounds like the recording.
    let again = crate::modal::Bank::new(
        &found.modes("bar", 0.5, true),
        44_100.0,
        crate::modal::BankOutput::Displacement,
    );
    let mut resynthesis = vec![0.0; 60_000];
    let mut force = vec![0.0; 60_000];
    force[found.onset] = 0.5;
    again.unwrap().process(&force, &mut resynthesis);
    let difference: f64 = out.iter().zip(&resynthesis).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let total: f64 = out.iter().map(|a| f64::from(*a).powi(2)).sum();
    assert!(difference < 1e-3 * total, "{}", difference / total);
}

#[test]
fn recordings_without_an_impact_are_refused() {
    for p in extractors() {
        assert_eq!(extract(&[], 44_100.0, &p), Err(ExtractError::Silent));
        assert_eq!(extract(&[0.0; 9000], 44_100.0, &p), Err(ExtractError::Silent));
        assert_eq!(extract(&[1.0, f32::NAN], 44_100.0, &p), Err(ExtractError::NotFinite { index: 1 }));
        assert!(matches!(extract(&[1.0; 100], 44_100.0, &p), Err(ExtractError::Short { .. })));
        let _ = extract(&[1.0; 5000], 44_100.0, &p);
    }
}
