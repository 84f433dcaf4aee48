use super::*;
use crate::core::random::Rng;
use crate::core::time::Rate;

fn cloth() -> FeatureConventions {
    FeatureConventions::cloth(Rate::hz(48_000), 200)
}

/// The signal of the stored values; the script that computed them uses the same formula.
fn signal() -> Vec<f32> {
    let at = |i: u32| {
        let x = f64::from(i);
        0.3 * (0.1 * x).sin() + 0.2 * (1.3 * x).cos() + 0.01 * (f64::from(i * 7919 % 101) / 101.0 - 0.5)
    };
    (0..400).map(|i| at(i) as f32).collect()
}

fn features(c: &FeatureConventions, frame: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; c.n as usize];
    MelCepstrum::new(c, 1e-10).process(frame, &mut out);
    out
}

fn assert_close(found: &[f32], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (f, w) in found.iter().zip(expected) {
        assert!((f64::from(*f) - w).abs() < tolerance, "{found:?}, not {expected:?}");
    }
}

#[test]
fn edges_are_those_of_the_paper() {
    for (high, inner) in
        [(20_000.0, [1464.66, 5993.91]), (24_000.0, [1595.96, 6830.62]), (48_000.0, [2179.0, 11_140.92])]
    {
        let edges = MelScale::Htk.edges(0.0, high, 3);
        assert!((edges[1] - inner[0]).abs() < 0.005 && (edges[2] - inner[1]).abs() < 0.005, "{edges:?}");
    }
    for f in [30.0, 999.0, 1000.0, 8000.0] {
        assert!((MelScale::Slaney.hz(MelScale::Slaney.mel(f)) - f).abs() < 1e-9 * f);
    }
    assert!((MelScale::Slaney.mel(1000.0) - 15.0).abs() < 1e-12);
}

/// `scipy.fft.dct(log(E), type=2, norm='ortho')` over band energies summed from `numpy.fft.rfft`.
#[test]
fn both_kinds_of_cepstrum_equal_the_reference() {
    assert_close(
        &features(&cloth(), &signal()),
        &[-11.500697963350191, 0.5734569619570178, 7.674596259727256],
        1e-5,
    );
    let usual = FeatureConventions {
        shape: BandShape::Triangular,
        bands: 5,
        first: 1,
        log: LogScale::Decibel,
        ..cloth()
    };
    let expected = [3.513884241841211, 32.01126662916578, -1.1405423820282348];
    assert_close(&features(&usual, &signal()), &expected, 1e-4);
}

#[test]
fn the_cosines_for_three_bands_are_exact() {
    let (a, b, c) = (1.0 / 3f64.sqrt(), 1.0 / 2f64.sqrt(), 1.0 / 6f64.sqrt());
    let expected = [a, a, a, b, 0.0, -b, c, -2.0 * c, c];
    for (found, expected) in cosines(0, 3, 3).iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12);
    }
}

#[test]
fn unit_energies_add_up_to_the_energy_of_the_signal() {
    let mut rng = Rng::new(3);
    let c = FeatureConventions { bands: 1, n: 1, f_hi: 24_000.0, ..cloth() };
    let x: Vec<f32> = (0..2000).map(|_| rng.between(-1.0, 1.0) as f32).collect();
    let mut padded = vec![0.0; 300];
    padded.extend(&x);
    padded.extend([0.0; 500]);
    let mut cepstrum = MelCepstrum::new(&c, 0.0);
    // From the unit before the first to the one after the last.
    let units = (0..12).map(|k| 200.0 * cepstrum.energies(&padded[k * 200..k * 200 + 400])[0]);
    let (sum, expected): (f64, f64) = (units.sum(), x.iter().map(|&x| f64::from(x).powi(2)).sum());
    assert!((sum / expected - 1.0).abs() < 1e-9, "{sum} {expected}");
}

fn with_window(window: FeatureWindow, frame: u32) -> FeatureConventions {
    FeatureConventions { window, frame, bands: 1, n: 1, f_hi: 24_000.0, ..cloth() }
}

#[test]
fn windows_have_the_energy_of_a_unit_and_hann_ignores_its_edge() {
    let square = |w: &[f64]| w.iter().map(|w| w * w).sum::<f64>();
    let (sine, rect) = (FeatureWindow::Sine2.samples(400), FeatureWindow::Rect.samples(200));
    assert!((square(&sine) - 200.0).abs() < 1e-10 && square(&rect) == 200.0);
    // Squares of neighbours add up to one at every sample.
    assert!((0..200).all(|i| (sine[i].powi(2) + sine[i + 200].powi(2) - 1.0).abs() < 1e-12));
    // With a rectangular window, the energy of a unit is its mean square, with or without zero padding.
    let mut rng = Rng::new(8);
    for length in [200, 256] {
        let x: Vec<f32> = (0..length).map(|_| rng.between(-1.0, 1.0) as f32).collect();
        let found = MelCepstrum::new(&with_window(FeatureWindow::Rect, length), 0.0).energies(&x)[0];
        let expected = x.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / f64::from(length);
        assert!((found / expected - 1.0).abs() < 1e-12, "{length}: {found} {expected}");
    }
    // One sample alone, the first of a unit.
    let mut pop = vec![0.0; 200];
    pop[0] = 1.0;
    let energy = |c: &FeatureConventions, x: &[f32]| MelCepstrum::new(c, 0.0).energies(x)[0];
    assert_eq!(energy(&with_window(FeatureWindow::Hann, 200), &pop), 0.0);
    assert!((energy(&with_window(FeatureWindow::Rect, 200), &pop) - 1.0 / 200.0).abs() < 1e-15);
    let around = [vec![0.0; 100], pop, vec![0.0; 100]].concat();
    assert!((energy(&with_window(FeatureWindow::Sine2, 400), &around) - 0.5 / 200.0).abs() < 1e-4);
}

#[test]
fn the_energy_of_a_band_is_the_mean_square_in_it() {
    // Tones of whole periods in the transform, one in each band.
    let c = FeatureConventions { window: FeatureWindow::Rect, frame: 512, f_hi: 24_000.0, ..cloth() };
    for (bin, band) in [(5, 0), (40, 1), (200, 2)] {
        let tone = |i: usize| (2.0 * PI * (bin * i) as f64 / 512.0).sin();
        let x: Vec<f32> = (0..512).map(|i| 0.5 * tone(i) as f32).collect();
        let found = MelCepstrum::new(&c, 0.0).energies(&x).to_vec();
        assert!((found[band] - 0.125).abs() < 1e-8, "{found:?}");
        assert!((0..3).all(|k| k == band || found[k] < 1e-12), "{found:?}");
    }
    // A constant and an alternation count once.
    for (step, band) in [(1.0_f32, 0), (-1.0, 2)] {
        let x: Vec<f32> = (0..512).map(|i| 0.5 * step.powi(i)).collect();
        let found = MelCepstrum::new(&c, 0.0).energies(&x).to_vec();
        assert!((found[band] - 0.25).abs() < 1e-8, "{found:?}");
    }
}

#[test]
fn a_gain_changes_the_first_coefficient_only() {
    let c = cloth();
    let base = features(&c, &signal());
    for gain in [0.25_f32, 1.9, 8.0] {
        let loud: Vec<f32> = signal().iter().map(|x| x * gain).collect();
        let found = features(&c, &loud);
        let step = 3f64.sqrt() * f64::from(gain * gain).ln();
        assert!((f64::from(found[0] - base[0]) - step).abs() < 2e-5, "{gain}");
        assert!((1..3).all(|k| (found[k] - base[k]).abs() < 1e-5), "{gain}");
    }
    // One decibel is 0.3988.
    assert!((3f64.sqrt() * 10f64.powf(0.1).ln() - 0.3988).abs() < 5e-5);
}

#[test]
fn silence_is_one_point() {
    let c = cloth();
    let quiet = features(&c, &[0.0; 400]);
    assert_close(&quiet, &[3f64.sqrt() * 1e-10f64.ln(), 0.0, 0.0], 1e-5);
    assert_eq!(features(&c, &[1e-9; 400]), quiet);
}

#[test]
fn a_bin_on_an_edge_counts_in_both_bands_in_proportion() {
    let c = FeatureConventions { bands: 2, n: 2, ..cloth() };
    let found = bands(&c, 512);
    let total: f64 = found.iter().flat_map(|b| b.weights.as_flattened()).sum();
    // From 0 to 20 kHz in bins of 93.75 Hz. The bin at 0 Hz is half as wide and has weight 1.
    assert!((total - (20_000.0 / 93.75 + 0.5)).abs() < 1e-9, "{total}");
    let edge = found[1].first;
    let [low, high] = [0, 1].map(|b: usize| found[b].weights.as_flattened());
    let shared = low[edge - found[0].first] + high[0];
    assert!((shared - 1.0).abs() < 1e-12 && high[0] < 1.0);
}
