use super::super::item::TrackPoint;
use super::super::peaks::{PeakRules, SinePeak};
use super::super::split::find_tracks;
use super::super::testing::{RATE, peaks, points, track_params};
use super::super::tracks::{Track, TrackList};
use super::*;
use std::f64::consts::TAU;

/// The tracks of frames of points.
fn collected(points: &[TrackPoint], slots: usize) -> Vec<Track> {
    let mut list = TrackList::default();
    points.chunks_exact(slots).enumerate().for_each(|(k, points)| list.add(k, points));
    list.finish()
}

/// Three tones, one of which sounds for a while, and noise.
fn sound(len: usize) -> Vec<f32> {
    let mut rng = Rng::new(4);
    (0..len)
        .map(|i| {
            let t = i as f64 / 44_100.0;
            let third = if (0.2..0.4).contains(&t) { 0.1 * (TAU * 3200.0 * t).sin() } else { 0.0 };
            let noise = rng.between(-0.01, 0.01);
            (0.3 * (TAU * (440.0 + 30.0 * t) * t).sin() + 0.2 * (TAU * 1790.0 * t).cos() + third + noise)
                as f32
        })
        .collect()
}

#[test]
fn streamed_tracks_equal_those_of_the_whole_recording() {
    let rules = PeakRules { threshold: -80.0, ..PeakRules::at_rate(44_100.0) };
    for (len, max_gap) in [(20_000, 0), (76 * 256, 0), (20_000, 2), (100, 0)] {
        let x = sound(len);
        let params = PartialTracksParams { max_gap, ..track_params() };
        let track_rules = params.rules(RATE.divided_by(256).unwrap(), 256).unwrap();
        assert_eq!(track_rules, TrackRules { max_gap, ..TrackRules::at_rate(44_100.0, 256) });
        let whole = find_tracks(&x, rules, track_rules, 44_100.0);
        for window in [0.001, 0.0437, 2.0] {
            let found = points(peaks(&x, -80.0, window), &params, window);
            assert_eq!(collected(&found, 100 * (1 + max_gap)), whole, "{len} {max_gap} {window}");
        }
        assert!(len == 100 || whole.len() > 50);
    }
}

#[test]
fn causal_tracks_begin_and_end_with_their_peaks() {
    let peak = |k: usize, f: f64| SinePeak { frequency: f + k as f64, amplitude: 0.1, phase: 0.0 };
    let mut frames = vec![SinePeak::default(); 100 * 12];
    for k in 0..12 {
        frames[100 * k] = peak(k, 500.0);
        if k == 5 {
            frames[100 * k + 1] = peak(k, 3000.0);
        }
    }
    let lengths = |causal| {
        let params = PartialTracksParams { causal, max_gap: 3, ..track_params() };
        let found = points(frames.clone(), &params, 0.01);
        collected(&found, found.len() / 12).iter().map(|t| t.peaks.len()).collect::<Vec<_>>()
    };
    assert_eq!(lengths(true), [12, 1]);
    assert_eq!(lengths(false), [12]);
}

#[test]
fn crossing_chirps_are_tracked_on_both_sides_and_a_blip_of_10_ms_is_removed() {
    let rate = 44_100.0;
    // Both chirps sweep at 2 kHz/s and cross at 0.25 s; the blip lasts from 0.4 to 0.41 s.
    let x: Vec<f32> = (0..22_050)
        .map(|i| {
            let t = f64::from(i) / rate;
            let up = 0.4 * (TAU * (1000.0 + 1000.0 * t) * t).cos();
            let down = 0.2 * (TAU * (2000.0 - 1000.0 * t) * t).cos();
            let blip = if (0.4..0.41).contains(&t) { 0.1 * (TAU * 6000.0 * t).sin() } else { 0.0 };
            (up + down + blip) as f32
        })
        .collect();
    let rules = PeakRules { window: 511, size: 1024, hop: 128, threshold: -40.0, ..PeakRules::at_rate(rate) };
    let found = |min_frames| {
        find_tracks(&x, rules, TrackRules { min_frames, ..TrackRules::at_rate(rate, 128) }, rate)
    };
    let is_blip = |t: &Track| t.peaks.iter().any(|p| p.frequency > 5000.0);
    assert!(found(1).iter().any(is_blip) && !found(8).iter().any(is_blip));
    // Where the chirps lie within one main lobe, their tracks end and others begin.
    for seconds in [0.05, 0.1, 0.38, 0.45] {
        for expected in [1000.0 + 2000.0 * seconds, 2000.0 - 2000.0 * seconds] {
            let k = (seconds * rate / 128.0) as usize;
            let at = |t: &Track| k.checked_sub(t.first).and_then(|k| t.peaks.get(k)).map(|p| p.frequency);
            let tracks = found(8);
            let near = tracks.iter().filter(|t| at(t).is_some_and(|f| (f - expected).abs() < 30.0));
            assert_eq!(
                near.count(),
                1,
                "{expected} Hz at {seconds} s: {:?}",
                tracks.iter().filter_map(at).collect::<Vec<_>>()
            );
        }
    }
}

#[test]
fn frames_that_take_too_much_memory_are_refused() {
    use crate::core::standalone::Standalone;
    let format = FrameFormat { count: 1000, hop: 1, window: 3 };
    let standalone = Standalone::new::<PartialTracks>(PartialTracksParams { max_gap: 16, ..track_params() });
    let standalone = standalone.input(
        PartialTracksPorts::peaks,
        Rate::hz(44_100),
        format,
        vec![SinePeak::default(); 1000],
    );
    assert_eq!(standalone.shape().unwrap_err().code, "F051");
}
