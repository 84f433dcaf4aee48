use super::*;
use crate::core::standalone::Standalone;
use crate::friction::builder::psd::centroid;
use crate::friction::{BuilderParams, EncoderTrack, FrictionModel, Gain, Reading, build};

fn params() -> SyntheticRollerParams {
    SyntheticRollerParams::read(&|_| None).unwrap()
}

fn recording(p: &SyntheticRollerParams) -> [Vec<f32>; 2] {
    let run = Standalone::new::<SyntheticRoller>(p.clone()).run().unwrap();
    [run.stream(SyntheticRollerPorts::audio), run.stream(SyntheticRollerPorts::turning)]
}

/// The model that a builder makes of a recording, with the speeds of the roller.
fn model(p: &SyntheticRollerParams) -> FrictionModel {
    let ([sound, turning], rate) = (recording(p), p.rate.as_f64());
    let readings: Vec<(f64, f64)> = (0..turning.len())
        .step_by(480)
        .map(|i| (i as f64 / rate, p.fastest * f64::from(turning[i])))
        .collect();
    let (times, speeds) = readings.into_iter().unzip();
    let encoder = EncoderTrack { times, reading: Reading::Speed(speeds) };
    build(&sound, rate, &encoder, None, &BuilderParams { n_speed: 16, ..Default::default() }).unwrap()
}

fn peak(row: &[f32], df: f64) -> f64 {
    (0..row.len()).max_by(|&a, &b| row[a].total_cmp(&row[b])).unwrap() as f64 * df
}

#[test]
fn its_level_is_proportional_to_speed_and_ends_as_set() {
    let p = SyntheticRollerParams { level: 0.2, duration: 20.0, ..params() };
    let [sound, turning] = recording(&p);
    assert_eq!(sound.len(), 960_000);
    for seconds in [2.0, 10.0, 19.0] {
        let at = (seconds * 48_000.0) as usize;
        let piece = &sound[at - 24_000..at + 24_000];
        let rms = (piece.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / 48_000.0).sqrt();
        let wanted = 0.2 * f64::from(turning[at]);
        assert!((rms / wanted - 1.0).abs() < 0.15, "{seconds} s: {rms} for {wanted}");
    }
    assert!((f64::from(turning[0]) * p.fastest / p.slowest - 1.0).abs() < 1e-3);
    assert!((f64::from(turning[959_999]) - 1.0).abs() < 1e-3);
}

#[test]
fn the_line_of_a_measured_model_is_at_the_frequency_of_the_law_at_every_speed() {
    // Corduroy of wales of 1.5 mm, and a smooth fabric.
    for (frequency, exponent) in [(667.0, 1.0), (3000.0, 0.4)] {
        let p = SyntheticRollerParams { frequency, exponent, harmonics: 1, duration: 30.0, ..params() };
        let model = model(&p);
        let mut seen = 0;
        for (k, &speed) in model.speeds.iter().enumerate() {
            let wanted = frequency * speed.powf(exponent);
            // Within the bin of speed and of frequency.
            let tolerance = 0.12 * wanted + 1.5 * model.df;
            let found = peak(model.row(k), model.df);
            assert!((found - wanted).abs() < tolerance, "{speed} m/s: {found} Hz for {wanted}");
            seen += 1;
        }
        assert!(seen >= 12, "{seen}");
    }
}

#[test]
fn interpolated_spectra_have_the_centroid_of_the_law_between_measured_speeds() {
    let p = SyntheticRollerParams { noise: 0.0, harmonics: 1, duration: 30.0, ..params() };
    let model = model(&p);
    let mut amplitude = vec![0.0; model.bins()];
    for pair in model.speeds.windows(2).filter(|pair| pair[0] > 0.15) {
        let speed = 0.5 * (pair[0] + pair[1]);
        model.amplitude(speed, Gain::Rms, &mut amplitude).unwrap();
        let psd: Vec<f64> = amplitude.iter().map(|a| a * a).collect();
        let (found, wanted) = (centroid(&psd, model.df), 667.0 * speed);
        assert!((found / wanted - 1.0).abs() < 0.1, "{speed} m/s: {found} Hz for {wanted}");
    }
}

#[test]
fn partials_above_the_nyquist_frequency_are_silent() {
    let p = SyntheticRollerParams {
        frequency: 30_000.0,
        harmonics: 1,
        exponent: 0.0,
        noise: 0.0,
        duration: 0.5,
        ..params()
    };
    assert!(recording(&p)[0].iter().all(|x| *x == 0.0));
}

#[test]
fn a_roller_that_does_not_get_faster_is_refused() {
    let p = SyntheticRollerParams { fastest: 0.05, ..params() };
    let refused = Standalone::new::<SyntheticRoller>(p).shape().unwrap_err();
    assert_eq!(refused.field.as_deref(), Some("fastest"));
}
