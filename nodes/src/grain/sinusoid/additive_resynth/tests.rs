use super::super::item::TrackPoint;
use super::super::peaks::{PeakFinder, PeakRules, SinePeak};
use super::super::split::{attacks, split};
use super::super::testing::{peaks, points, resynthesis, track_params};
use super::super::tracks::TrackRules;
use super::super::{add_tracks, find_tracks};
use crate::grain::testing::recording;
use std::f64::consts::TAU;

const FS: f64 = 44_100.0;

fn streamed(x: &[f32], ratio: f64, attacks: Option<&[usize]>, window: f64) -> Vec<f32> {
    let tracks = points(peaks(x, -80.0, 0.5), &track_params(), 0.5);
    let mut steady = resynthesis(tracks, (100, ratio), None, attacks, window);
    steady.truncate(x.len());
    steady
}

#[test]
fn the_streamed_steady_part_is_that_of_the_whole_recording() {
    let (x, rate) = recording("perc_bell.flac");
    assert_eq!(rate, 44_100);
    let x = &x[..40_000];
    let rules = PeakRules::at_rate(FS);
    let track_rules = TrackRules::at_rate(FS, rules.hop);
    let mut plain = vec![0.0; x.len()];
    add_tracks(&find_tracks(x, rules, track_rules, FS), &[], [256, 1023], FS, &mut plain);
    for window in [0.0013, 0.1, 3.0] {
        assert_eq!(streamed(x, 1.0, None, window), plain, "windows of {window} s");
    }
    let whole = split(x, rules, track_rules, FS);
    let attacks = attacks(x, FS);
    assert!(!attacks.is_empty());
    let steady = streamed(x, 1.0, Some(&attacks), 0.1);
    assert_eq!(steady, whole.steady);
    assert_ne!(steady, plain, "attacks change the sound before them");
    for (x, (s, t)) in x.iter().zip(whole.steady.iter().zip(&whole.transient)) {
        assert!((x - s - t).abs() <= 1e-6);
    }
}

#[test]
fn a_ratio_moves_every_partial_and_leaves_the_duration() {
    let partials = [210.0, 433.0, 880.0, 1730.0, 3511.0, 7010.0, 12_500.0, 15_000.0];
    let x: Vec<f32> = (0..30_000)
        .map(|i| partials.iter().map(|f| 0.1 * (TAU * f * f64::from(i) / FS).cos()).sum::<f64>() as f32)
        .collect();
    let moved = streamed(&x, 1.5, None, 0.05);
    assert_eq!(moved.len(), x.len());
    let mut found = Vec::new();
    let mut finder = PeakFinder::new(PeakRules { threshold: -60.0, ..PeakRules::at_rate(FS) }, FS);
    for centre in [8000, 15_000, 22_000] {
        finder.find_at(&moved, centre, &mut found);
        // The last one would be at 22.5 kHz.
        assert_eq!(found.len(), 7, "{found:?}");
        for f in &partials[..7] {
            let near = found.iter().map(|p| (p.frequency / (1.5 * f) - 1.0).abs()).fold(1.0, f64::min);
            assert!(near < 1e-3, "{f}: {near}");
        }
        assert!(found.iter().all(|p| p.frequency < 0.45 * FS));
    }
}

#[test]
fn a_ratio_that_comes_and_goes_leaves_no_click() {
    let x: Vec<f32> = (0..40_000).map(|i| (0.5 * (TAU * 1000.0 * f64::from(i) / FS).cos()) as f32).collect();
    let control: Vec<f32> =
        (0..40_000).map(|i| if (12_000..24_000).contains(&i) { 1.3 } else { 1.0 }).collect();
    let tracks = points(peaks(&x, -80.0, 0.5), &track_params(), 0.5);
    let run = |window| resynthesis(tracks.clone(), (100, 1.0), Some(control.clone()), None, window);
    let y = run(0.05);
    assert_eq!(y, run(0.0011));
    // Second differences of a tone of 1.3 kHz and amplitude 0.5 are at most this.
    let most = 0.5 * (TAU * 1300.0 / FS).powi(2) * 1.05;
    for k in 5000..35_000 {
        let bend = f64::from(y[k + 1]) - 2.0 * f64::from(y[k]) + f64::from(y[k - 1]);
        assert!(bend.abs() < most, "{k}: {bend}");
    }
    let plain = resynthesis(tracks.clone(), (100, 1.0), None, None, 0.05);
    // Up to the frame before the change, phases are those that were measured.
    assert_eq!(y[..11_776], plain[..11_776]);
    let mut finder = PeakFinder::new(PeakRules::at_rate(FS), FS);
    let mut found = Vec::new();
    for (centre, f) in [(8000, 1000.0), (18_000, 1300.0), (30_000, 1000.0)] {
        finder.find_at(&y, centre, &mut found);
        assert!((found[0].frequency / f - 1.0).abs() < 1e-4, "{f}: {:?}", found[0]);
    }
}

#[test]
fn tracks_above_the_highest_frequency_are_silent() {
    let point =
        |track, frequency| TrackPoint { track, peak: SinePeak { frequency, amplitude: 0.5, phase: 0.0 } };
    let above = resynthesis(vec![point(1, 20_000.0); 20], (1, 1.0), None, None, 0.01);
    assert!(above.iter().all(|y| y.abs() < 1e-9));
    let below = resynthesis(vec![point(1, 19_000.0); 20], (1, 1.0), None, None, 0.01);
    assert!(below.iter().any(|y| y.abs() > 0.1));
    let moved = resynthesis(vec![point(1, 19_000.0); 20], (1, 1.1), None, None, 0.01);
    assert!(moved.iter().all(|y| y.abs() < 1e-9));
}

#[test]
fn a_track_that_begins_with_an_attack_is_silent_before_it() {
    // A tone begins at sample 20,000.
    let x: Vec<f32> = (0..40_000)
        .map(|i| if i < 20_000 { 0.0 } else { (0.5 * (TAU * 1500.0 * f64::from(i) / FS).cos()) as f32 })
        .collect();
    let loudest = |y: &[f32]| 20.0 * y.iter().fold(1e-9_f32, |m, y| m.max(y.abs())).log10();
    let spread = streamed(&x, 1.0, None, 0.1);
    let sharp = streamed(&x, 1.0, Some(&[20_000]), 0.1);
    // Up to 1 ms before the attack, relative to the attack at -6 dB.
    let [before, after] = [&spread, &sharp].map(|y| loudest(&y[..19_956]) + 6.0);
    assert!(before > -30.0 && after < -50.0, "{before} {after}");
    assert!(loudest(&sharp[20_100..]) > -7.0);
    assert!(streamed(&x, 1.3, Some(&[20_000]), 0.1)[..19_956].iter().all(|y| y.abs() < 1e-3));
}
