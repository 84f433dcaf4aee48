use super::*;

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    for (k, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= tolerance, "bin {k}: {f} instead of {e}");
    }
}

#[test]
fn a_model_falls_quadratically_below_its_range_and_is_constant_above() {
    let psd = vec![0.0, 1.0, 4.0, 0.0, 0.0, 2.0, 2.0, 1.0];
    let model = FrictionModel::from_psd(Default::default(), vec![0.2, 1.0], psd, 600.0).unwrap();
    let spectra = SpectrumInterpolator::new(&model, Gain::Rms).unwrap();
    let at = |s| {
        let mut out = [0.0; 4];
        spectra.amplitude(s, &mut out);
        out
    };
    close(&at(0.05), &[0.0, 10.0 / 16.0, 20.0 / 16.0, 0.0], 1e-12);
    assert_eq!(at(1.0), at(7.0));
    assert_eq!(at(0.0), [0.0; 4]);
    assert_eq!(at(f64::NAN), [0.0; 4]);
    for s in [0.1, 0.2, 0.5, 0.9, 1.0] {
        let power: f64 = at(s).iter().map(|a| a * a).sum();
        assert!((power / model.power(s) - 1.0).abs() < 1e-9, "{s}");
        let mut out = [0.0; 4];
        model.amplitude(s, Gain::Rms, &mut out).unwrap();
        assert_eq!(out, at(s));
    }
}

#[test]
fn spectra_are_continuous_at_measured_speeds() {
    let psd: Vec<f32> = (0..3 * 33).map(|i| 1.0 + (i * 7 % 13) as f32).collect();
    let model = FrictionModel::from_psd(Default::default(), vec![0.1, 0.3, 0.5], psd, 6400.0).unwrap();
    let spectra = SpectrumInterpolator::new(&model, Gain::Rms).unwrap();
    let (mut a, mut b) = ([0.0; 33], [0.0; 33]);
    for s in [0.1, 0.3, 0.5] {
        spectra.amplitude(s - 1e-9, &mut a);
        spectra.amplitude(s + 1e-9, &mut b);
        close(&a, &b, 1e-5);
    }
}
