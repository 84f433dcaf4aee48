use std::f64::consts::TAU;

use super::*;
use crate::core::random::Random;
use crate::friction::builder::encoder::Reading;
use crate::friction::builder::psd::centroid;

const FS: f64 = 8000.0;

/// White noise whose mean square is `power` of the time in seconds.
fn noise(seconds: f64, node: &str, power: impl Fn(f64) -> f64) -> Vec<f32> {
    let random = Random::new(1, node);
    (0..(seconds * FS) as u64)
        .map(|i| ((12.0 * power(i as f64 / FS)).sqrt() * (random.uniform(0, i, 0) - 0.5)) as f32)
        .collect()
}

fn ramp(seconds: f64, speed: impl Fn(f64) -> f64) -> EncoderTrack {
    let times: Vec<f64> = (0..=(100.0 * seconds) as u32).map(|i| f64::from(i) / 100.0).collect();
    let speeds = times.iter().map(|&t| speed(t)).collect();
    EncoderTrack { times, reading: Reading::Speed(speeds) }
}

#[test]
fn power_grows_with_speed_as_recorded() {
    let speed = |t: f64| 0.1 * 10.0_f64.powf(t / 20.0);
    let samples = noise(20.0, "roller", |t| 0.01 * speed(t).powi(2));
    let model = build(&samples, FS, &ramp(20.0, speed), None, &BuilderParams::default()).unwrap();
    assert_eq!(model.speeds.len(), 32);
    assert!(model.speeds[0] < 0.11 && model.speeds[31] > 0.9);
    assert_eq!(model.rejected, Rejections::default());
    for (k, &s) in model.speeds.iter().enumerate() {
        assert!((model.row_power(k) / (0.01 * s * s) - 1.0).abs() < 0.1, "{k} {}", model.row_power(k));
        assert_eq!(model.row(k)[0], 0.0, "no DC");
    }
}

#[test]
fn raw_has_a_spectrum_per_clip_and_merges_equal_speeds() {
    let samples = noise(2.0, "raw", |_| 0.01);
    let params = BuilderParams { raw: true, ..Default::default() };
    let model = build(&samples, FS, &ramp(2.0, |t| 0.5 + 0.1 * t), None, &params).unwrap();
    let clips = (16000 - 400) / 100 + 1;
    assert_eq!(model.speeds.len(), clips);
    assert_eq!(model.conventions.origin, Origin::RollerRaw);
    let two_steps = |t: f64| if t < 1.0 { 0.5 } else { 0.55 };
    let model = build(&samples, FS, &ramp(2.0, two_steps), None, &params).unwrap();
    assert_eq!((model.speeds[0], *model.speeds.last().unwrap()), (0.5, 0.55));
    assert!(model.clips[0] > 70 && *model.clips.last().unwrap() > 70);
}

#[test]
fn averaging_magnitudes_instead_of_power_would_lose_a_decibel() {
    let samples = noise(20.0, "scatter", |_| 0.01);
    let params = BuilderParams { raw: true, hop: 0.05, ..Default::default() };
    let model = build(&samples, FS, &ramp(20.0, |t| 0.5 + 0.01 * t), None, &params).unwrap();
    let (mut power, mut magnitude, mut count) = (0.0, 0.0, 0.0);
    for k in 0..model.speeds.len() {
        for &s in &model.row(k)[20..190] {
            power += f64::from(s);
            magnitude += f64::from(s).sqrt();
            count += 1.0;
        }
    }
    let loss = 10.0 * ((magnitude / count).powi(2) / (power / count)).log10();
    assert!((loss + 1.049).abs() < 0.05, "{loss} dB");
}

#[test]
fn clips_on_the_seam_at_rest_or_changing_speed_are_dropped_and_counted() {
    let samples = noise(10.0, "seam", |_| 0.01);
    // 1 to 2 rad/s on a roller of 0.1 m; the seam covers a tenth of a turn.
    let params =
        BuilderParams { roller_radius: 0.1, seams: vec![(1.0, 1.0 + TAU / 10.0)], ..Default::default() };
    let model = build(&samples, FS, &ramp(10.0, |t| 0.1 + 0.01 * t), None, &params).unwrap();
    let total = model.clips.iter().sum::<u32>() + model.rejected.seam;
    assert_eq!(total, (80000 - 400) / 100 + 1);
    let share = f64::from(model.rejected.seam) / f64::from(total);
    assert!(share > 0.1 && share < 0.2, "{share}");

    let stop = |t: f64| {
        if t < 3.0 {
            0.0
        } else if t < 6.0 {
            0.5
        } else {
            0.1
        }
    };
    let model = build(&samples, FS, &ramp(9.0, stop), None, &BuilderParams::default()).unwrap();
    assert!(model.rejected.at_rest > 200);
    assert!(model.rejected.speed_change > 2);
    assert!(model.rejected.outside_encoder > 70);
    assert_eq!((model.speeds[0], *model.speeds.last().unwrap()), (0.1, 0.5));
}

#[test]
fn the_floor_is_subtracted_and_the_high_pass_cuts_below_its_frequency() {
    let floor = noise(20.0, "floor", |_| 0.004);
    let speed = |t: f64| 0.5 + 0.02 * t;
    let samples: Vec<f32> = noise(20.0, "sound", |_| 0.01)
        .iter()
        .zip(noise(20.0, "bed", |_| 0.004))
        .map(|(a, b)| a + b)
        .collect();
    let params = BuilderParams { n_speed: 4, high_pass: 100.0, ..Default::default() };
    let model = build(&samples, FS, &ramp(20.0, speed), Some(&floor), &params).unwrap();
    let density = 0.01 / (0.5 * FS);
    for k in 0..4 {
        let row: Vec<f64> = model.row(k).iter().map(|&s| f64::from(s)).collect();
        let mean = row[20..180].iter().sum::<f64>() / 160.0;
        assert!((mean / density - 1.0).abs() < 0.03, "{mean} {density}");
        assert!((row[5] / density - 0.5).abs() < 0.25, "100 Hz is at half power: {}", row[5] / density);
        assert!(row[1] < 1e-4 * density && row[0] == 0.0);
    }
    assert!(model.conventions.floor_subtracted && model.floor.len() == model.bins());
    let white = centroid(&[0.0, 1.0, 1.0, 1.0], 1000.0);
    assert!((white - 2000.0).abs() < 1e-9);
}

#[test]
fn a_larger_contact_area_gives_quieter_emitters() {
    let samples = noise(4.0, "area", |_| 0.01);
    let speed = |t: f64| 0.5 + 0.1 * t;
    let patch = BuilderParams { contact_area: 1e-2, ..Default::default() };
    let a = build(&samples, FS, &ramp(4.0, speed), None, &BuilderParams::default()).unwrap();
    let b = build(&samples, FS, &ramp(4.0, speed), None, &patch).unwrap();
    assert!((a.row_power(3) / b.row_power(3) - 100.0).abs() < 1e-3);
}

#[test]
fn errors_name_what_is_missing() {
    let samples = noise(2.0, "errors", |_| 0.01);
    let params = BuilderParams::default();
    let steady = build(&samples, FS, &ramp(2.0, |_| 0.5), None, &params).unwrap_err();
    assert!(matches!(steady, BuildError::TooFew { speeds: 1, .. }), "{steady}");
    let resting = build(&samples, FS, &ramp(2.0, |_| 0.0), None, &params).unwrap_err();
    assert!(resting.to_string().contains("157 at rest"), "{resting}");
    let seams = BuilderParams { seams: vec![(0.0, 0.1)], ..Default::default() };
    assert_eq!(build(&samples, FS, &ramp(2.0, |t| 0.1 + t), None, &seams), Err(BuildError::SeamWithoutAngle));
    let short = build(&samples, FS, &ramp(2.0, |t| 0.1 + t), Some(&[0.0; 7]), &params);
    assert_eq!(short, Err(BuildError::Floor { found: 7, expected: 400 }));
    let mut bad = samples;
    bad[9] = f32::NAN;
    let error = build(&bad, FS, &ramp(2.0, |t| 0.1 + t), None, &params).unwrap_err();
    assert!(matches!(error, BuildError::Sample { recording: 0, index: 9, .. }));
    let error = build(&[], FS, &ramp(2.0, |t| 0.1 + t), None, &BuilderParams { clip: -1.0, ..params });
    assert!(matches!(error, Err(BuildError::Parameter { name: "clip", .. })));
}
