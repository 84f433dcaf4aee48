use super::*;
use crate::grain::dictionary::{ExtractRules, GrainDictionary, extract};
use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part, SourceKind};

const RATE: f64 = 44_100.0;
const TONES: [[f64; 2]; 2] = [[440.0, 0.2], [1513.0, 0.1]];

/// A second of two tones, the second of which begins and ends within it, and noise without tracks.
fn dictionary(channels: usize) -> GrainDictionary {
    let sample = |i: usize, channel: usize| {
        let t = i as f64 / RATE;
        let tone = |[f, a]: [f64; 2]| a * (TAU * f * t + 0.4).cos();
        let is_on = (0.3..0.7).contains(&t);
        ((tone(TONES[0]) + if is_on { tone(TONES[1]) } else { 0.0 }) / (1 + channel) as f64) as f32
    };
    let part = |component, scale: f32| Part {
        component,
        channels: (0..channels).map(|c| (0..44_100).map(|i| scale * sample(i, c)).collect()).collect(),
    };
    let recording = GrainRecording {
        name: "a.wav".into(),
        kind: SourceKind::Continuous,
        parts: vec![part(Component::Steady, 1.0), part(Component::Transient, 0.5)],
        ..GrainRecording::default()
    };
    let rules = ExtractRules { tracks: true, ..ExtractRules::at_rate(RATE) };
    extract(&GrainRecordings { rate: RATE, recordings: vec![recording] }, &rules).0
}

/// The steady grain that contains a time of the recording, s.
fn grain_at(dictionary: &GrainDictionary, seconds: f64) -> usize {
    let sample = (seconds * RATE) as u64;
    let contains = |g: &Grain| g.source == 0 && g.start <= sample && sample < g.start + u64::from(g.len);
    dictionary.grains.iter().position(contains).unwrap()
}

/// Samples `from..from + n` of the recording by the tracks of a grain.
fn played(
    dictionary: &GrainDictionary,
    index: usize,
    channel: usize,
    factor: f64,
    from: i64,
    n: usize,
) -> Vec<f32> {
    let grain = &dictionary.grains[index];
    let mut out = vec![0.0; n];
    let at = from - grain.start as i64 + i64::from(grain.position);
    let tracks = dictionary.tracks.as_ref().unwrap();
    tracks.add((index as u32, grain), channel, [factor, RATE], at, &mut out);
    out
}

/// Amplitude of a sinusoid of a frequency in a sound, under a Hann window.
fn amplitude(x: &[f32], frequency: f64) -> f64 {
    let (mut sum, mut weight, n) = ([0.0; 2], 0.0, x.len() as f64);
    for (i, x) in x.iter().enumerate() {
        let w = 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / n).cos();
        let angle = TAU * frequency * i as f64 / RATE;
        sum = [sum[0] + w * f64::from(*x) * angle.cos(), sum[1] + w * f64::from(*x) * angle.sin()];
        weight += w;
    }
    2.0 * sum[0].hypot(sum[1]) / weight
}

#[test]
fn a_factor_changes_the_frequency_and_neither_amplitude_nor_duration() {
    let dictionary = dictionary(2);
    dictionary.validate().unwrap();
    let index = grain_at(&dictionary, 0.5);
    let grain = &dictionary.grains[index];
    for factor in [0.5, 0.9, 1.25, 2.0] {
        for channel in 0..2 {
            let x = played(&dictionary, index, channel, factor, grain.start as i64, grain.len as usize);
            for [f, a] in TONES {
                let (want, got) = (a / (1 + channel) as f64, amplitude(&x, factor * f));
                assert!((got / want - 1.0).abs() < 0.04, "{factor} {channel} {f}: {got} {want}");
            }
        }
    }
    // Above 0.45 times the rate there is nothing.
    let x = played(&dictionary, index, 0, 15.0, grain.start as i64, grain.len as usize);
    assert!(amplitude(&x, 0.5 * RATE - 15.0 * 1513.0 + 0.5 * RATE) < 1e-3 && amplitude(&x, 6600.0) > 0.19);
}

#[test]
fn neighbours_at_one_factor_are_one_sound() {
    let dictionary = dictionary(1);
    for seconds in [0.2, 0.5] {
        let a = grain_at(&dictionary, seconds);
        let cut = dictionary.grains[a + 1].start as i64;
        assert!(GrainDictionary::are_neighbours(&dictionary.grains[a], &dictionary.grains[a + 1]));
        let [x, y] = [a, a + 1].map(|k| played(&dictionary, k, 0, 1.37, cut - 200, 400));
        assert!(x.iter().any(|x| x.abs() > 0.1));
        assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-4), "{seconds}");
        // Another factor has other phases.
        let z = played(&dictionary, a, 0, 1.38, cut - 200, 400);
        assert!(x.iter().zip(&z).any(|(x, z)| (x - z).abs() > 0.05));
    }
}

#[test]
fn at_the_recorded_frequency_tracks_are_the_recording() {
    let dictionary = dictionary(1);
    let index = grain_at(&dictionary, 0.2);
    let grain = &dictionary.grains[index];
    let x = played(&dictionary, index, 0, 1.0, grain.start as i64, grain.len as usize);
    let (start, end) = (grain.position as usize, (grain.position + grain.len) as usize);
    let stored = &dictionary.run(grain.run, 0)[start..end];
    let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let error: Vec<f32> = x.iter().zip(stored).map(|(x, y)| x - y).collect();
    assert!(energy(&error) < 0.01 * energy(stored), "{}", energy(&error) / energy(stored));
}

#[test]
fn blocks_of_any_length_have_the_same_samples_and_tracks_fade_where_they_begin() {
    let dictionary = dictionary(1);
    for seconds in [0.3, 0.5, 0.7] {
        let index = grain_at(&dictionary, seconds);
        let grain = &dictionary.grains[index];
        let (start, n) = (grain.start as i64, grain.len as usize);
        let whole = played(&dictionary, index, 0, 0.8, start, n);
        for block in [1, 37, 256] {
            let parts = (0..n)
                .step_by(block)
                .flat_map(|k| played(&dictionary, index, 0, 0.8, start + k as i64, block.min(n - k)));
            assert_eq!(parts.collect::<Vec<f32>>(), whole, "{block}");
        }
        let steepest = whole.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        assert!(steepest < 0.05, "{seconds}: {steepest}");
    }
    // Nothing beyond what is stored.
    assert!(played(&dictionary, 0, 0, 0.8, -900, 300).iter().all(|x| *x == 0.0));
}

#[test]
fn files_and_subsets_have_the_tracks_and_damage_is_found() {
    let all = dictionary(2);
    let bytes = all.to_bytes().unwrap();
    assert_eq!(GrainDictionary::from_bytes(&bytes).unwrap(), all);
    let without = GrainDictionary { tracks: None, ..all.clone() };
    assert!(without.bytes() < all.bytes() && without.id() == all.id());
    assert_eq!(GrainDictionary::from_bytes(&without.to_bytes().unwrap()).unwrap(), without);
    let retained: Vec<bool> = (0..all.len()).map(|k| k % 3 == 1).collect();
    let some = all.subset(&retained, 200);
    some.validate().unwrap();
    let by_run = all.grains_of_runs().into_iter().enumerate();
    let bytes = by_run.map(|(run, own)| all.bytes_of(run, own.into_iter().filter(|k| retained[*k]), 200));
    assert_eq!(bytes.sum::<usize>(), some.bytes());
    let start = all.grains[4].start as i64;
    assert_eq!(played(&some, 1, 1, 0.7, start, 300), played(&all, 4, 1, 0.7, start, 300));
    type Damage = fn(&mut SteadyTracks);
    let damages: [Damage; 7] = [
        |t| t.hop = 0,
        |t| t.hop = u32::MAX,
        |t| drop(t.grains.pop()),
        |t| t.grains[4].rows = 2,
        |t| t.grains[4].lines[0].channel = 2,
        |t| t.grains[4].lines[0].points.clear(),
        |t| t.grains[4].lines[0].points[0][1] = f32::NAN,
    ];
    for damage in damages {
        let mut damaged = all.clone();
        damage(damaged.tracks.as_mut().unwrap());
        assert!(damaged.validate().is_err());
        assert!(GrainDictionary::from_bytes(&damaged.to_bytes().unwrap()).is_err());
    }
}
