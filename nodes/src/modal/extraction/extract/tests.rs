use super::*;
use crate::core::random::Rng;

/// Damped sines after a silence, under noise.
fn sound(partials: &[Partial], rate: f64, seconds: f64, silence: usize, noise: f64) -> Vec<f32> {
    let mut out = vec![0.0; (seconds * rate) as usize];
    for p in partials {
        add(&mut out[silence..], rate, p, 1.0);
    }
    let mut rng = Rng::new(11);
    out.iter().map(|x| (x + noise * 3.0_f64.sqrt() * rng.between(-1.0, 1.0)) as f32).collect()
}

fn partial(frequency: f64, damping: f64, amplitude: f64, phase: f64) -> Partial {
    Partial { frequency, damping, amplitude, phase }
}

#[test]
fn ten_modes_under_noise_are_found() {
    let made: Vec<Partial> = [
        (180.0, 2.0, 0.1),
        (411.0, 4.0, 0.2),
        (733.0, 3.0, 0.05),
        (1250.0, 9.0, 0.15),
        (1900.0, 15.0, 0.1),
        (2711.0, 12.0, 0.08),
        (3902.0, 30.0, 0.1),
        (5200.0, 25.0, 0.06),
        (7100.0, 60.0, 0.1),
        (9800.0, 80.0, 0.1),
    ]
    .iter()
    .enumerate()
    .map(|(k, (f, d, a))| partial(*f, *d, *a, (k as f64).sin()))
    .collect();
    let clean = sound(&made, 44_100.0, 2.0, 4000, 0.0);
    let rms = (clean[4000..].iter().map(|x| f64::from(x * x)).sum::<f64>() / clean.len() as f64).sqrt();
    let found =
        extract(&sound(&made, 44_100.0, 2.0, 4000, 0.01 * rms), 44_100.0, &ExtractParams::default()).unwrap();
    println!(
        "onset {} for 4000, {} modes, residual {:.1} dB",
        found.onset,
        found.partials.len(),
        found.residual_db
    );
    for p in &made {
        let near = |q: &&Partial| (q.frequency / p.frequency - 1.0).abs() < 0.001;
        let q = found.partials.iter().filter(near).max_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
        let q = q.unwrap_or_else(|| panic!("{} Hz is not found", p.frequency));
        let db = 20.0 * (q.amplitude / p.amplitude).log10();
        println!(
            "{:7.1} Hz {:+.4} %, {:5.1}/s {:+.2} %, {db:+.3} dB",
            p.frequency,
            100.0 * (q.frequency / p.frequency - 1.0),
            p.damping,
            100.0 * (q.damping / p.damping - 1.0)
        );
        assert!((q.damping / p.damping - 1.0).abs() < 0.03 && db.abs() < 0.5, "{p:?} {q:?}");
    }
    assert!(found.residual_db < -30.0);
}

#[test]
fn two_close_modes_are_resolved() {
    let made = [partial(1000.0, 3.0, 0.3, 0.0), partial(1012.0, 4.0, 0.2, 1.0)];
    let found =
        extract(&sound(&made, 44_100.0, 2.0, 100, 1e-5), 44_100.0, &ExtractParams::default()).unwrap();
    for p in made {
        let near = found.partials.iter().find(|q| (q.frequency - p.frequency).abs() < 0.5);
        let near = near.unwrap_or_else(|| panic!("{found:?}"));
        assert!((near.damping / p.damping - 1.0).abs() < 0.1, "{near:?}");
    }
}

#[test]
fn a_step_that_decays_is_no_mode() {
    // A slow offset such as of a pressed microphone beside a mode that rings.
    let mut samples = sound(&[partial(1000.0, 30.0, 0.3, 0.0)], 44_100.0, 1.0, 100, 1e-5);
    let offset = |n: usize| 2.0 * (-600.0 * n as f64 / 44_100.0).exp();
    samples.iter_mut().skip(100).enumerate().for_each(|(n, x)| *x += offset(n) as f32);
    let found = extract(&samples, 44_100.0, &ExtractParams::default()).unwrap();
    assert!(found.partials.iter().all(|p| p.frequency >= 30.0), "{:?}", found.partials);
    assert!(found.partials.iter().any(|p| (p.frequency - 1000.0).abs() < 1.0), "{:?}", found.partials);
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
}

#[test]
fn recordings_without_an_impact_are_refused() {
    let p = ExtractParams::default();
    assert_eq!(extract(&[], 44_100.0, &p), Err(ExtractError::Silent));
    assert_eq!(extract(&[0.0; 9000], 44_100.0, &p), Err(ExtractError::Silent));
    assert_eq!(extract(&[1.0, f32::NAN], 44_100.0, &p), Err(ExtractError::NotFinite { index: 1 }));
    assert!(matches!(extract(&[1.0; 100], 44_100.0, &p), Err(ExtractError::Short { .. })));
    let _ = extract(&[1.0; 5000], 44_100.0, &p);
}
