use super::super::segment::sound_of;
use super::*;
use crate::core::computation::NotStored;
use crate::core::random::{Random, Rng};
use crate::grain::correlation::{CorrelateRules, CorrelationPatterns, Retention, correlate};
use crate::grain::dictionary::{ExtractRules, extract};
use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part};

/// Noise with an attack every 4000 samples that decays.
fn knocks(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    (0..n)
        .map(|i| {
            let since = (i % 4000) as f64;
            ((-since / 900.0).exp() * rng.between(-0.6, 0.6) + rng.between(-0.01, 0.01)) as f32
        })
        .collect()
}

fn recordings(sounds: Vec<Vec<f32>>) -> GrainRecordings {
    let recording = |x: Vec<f32>| GrainRecording {
        parts: vec![Part { component: Component::Whole, channels: vec![x] }],
        ..GrainRecording::default()
    };
    GrainRecordings { rate: 44_100.0, recordings: sounds.into_iter().map(recording).collect() }
}

fn all_of(sounds: Vec<Vec<f32>>, bits: u16, retain: Retention) -> (GrainDictionary, CorrelationPatterns) {
    let all = recordings(sounds);
    let rules = ExtractRules { bits, discard: [-300.0, -300.0], ..ExtractRules::at_rate(44_100.0) };
    let (dictionary, _) = extract(&all, &rules);
    let rules = CorrelateRules { retain, ..CorrelateRules::default() };
    let patterns = correlate(&all, &dictionary, &rules, &|_| false, &NotStored).unwrap();
    (dictionary, patterns)
}

fn snr(x: &[f32], y: &[f32]) -> f64 {
    let energy = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>();
    let signal = energy(&mut x.iter().map(|x| f64::from(*x)));
    let noise = energy(&mut x.iter().zip(y).map(|(x, y)| f64::from(x - y)));
    10.0 * (signal / noise.max(1e-300)).log10()
}

#[test]
fn a_recording_of_the_dictionary_comes_back() {
    let x = knocks(30_000, 1);
    for (bits, least) in [(0, 70.0), (16, 60.0)] {
        let (dictionary, patterns) = all_of(vec![x.clone()], bits, Retention::Largest(2000));
        let read = CorrelationPatterns::from_bytes(&patterns.to_bytes().unwrap()).unwrap();
        assert_eq!(read, patterns);
        let steps = walk(&read.patterns[0], &dictionary, GapRule::Extend);
        let own: Vec<(u32, i64)> =
            dictionary.grains.iter().zip(0..).map(|(g, k)| (k, g.window_start() as i64)).collect();
        assert_eq!(steps.iter().map(|s| (s.grain, s.t)).collect::<Vec<_>>(), own);
        let y = sound_of(&dictionary, [&steps], x.len());
        // Gains are stored in steps of 1/256 dB; the ends are tapered.
        let inner = 100..x.len() - 100;
        let found = snr(&x[inner.clone()], &y[inner]);
        assert!(found >= least, "{found}");
    }
}

#[test]
fn the_walk_leaves_few_gaps_with_few_peaks() {
    let x = knocks(40_000, 2);
    let (dictionary, patterns) = all_of(vec![x.clone(), knocks(30_000, 3)], 16, Retention::PerInterval(4));
    let steps = walk(&patterns.patterns[0], &dictionary, GapRule::Extend);
    let y = sound_of(&dictionary, [&steps], x.len());
    let silent = y.chunks(64).filter(|part| part.iter().all(|y| *y == 0.0)).count();
    assert!(silent * 50 <= y.len() / 64, "{silent}");
    // A recording of half the level has the same grains at half their gains.
    let halved = recordings(vec![x.iter().map(|x| 0.5 * x).collect()]);
    let halved = correlate(&halved, &dictionary, &CorrelateRules::default(), &|_| false, &NotStored).unwrap();
    let quiet = walk(&halved.patterns[0], &dictionary, GapRule::Extend);
    assert_eq!(quiet.len(), steps.len());
    for (a, b) in steps.iter().zip(&quiet) {
        assert!((a.grain, a.t) == (b.grain, b.t) && (b.gain / a.gain - 0.5).abs() < 0.001, "{a:?} {b:?}");
    }
}

#[test]
fn silence_and_an_empty_pattern_have_no_grains() {
    let (dictionary, patterns) =
        all_of(vec![knocks(9000, 4), vec![0.0; 5000]], 16, Retention::PerInterval(2));
    assert!(patterns.patterns[1].peaks.is_empty());
    assert!(walk(&patterns.patterns[1], &dictionary, GapRule::Extend).is_empty());
    assert!(time_scaled(&patterns.patterns[1], &dictionary, 2.0).is_empty());
}

#[test]
fn time_scaling_by_one_is_the_walk_and_keeps_the_onsets() {
    let x = knocks(44_100, 5);
    let (dictionary, patterns) = all_of(vec![x], 16, Retention::PerInterval(4));
    let pattern = &patterns.patterns[0];
    let source = walk(pattern, &dictionary, GapRule::Extend);
    let times = |steps: &[GrainStep]| -> Vec<i64> {
        onset_steps(&dictionary, steps).into_iter().map(|k| steps[k].t).collect()
    };
    assert_eq!(time_scaled(pattern, &dictionary, 1.0), source);
    for factor in [0.5, 2.0, 3.7] {
        let scaled = time_scaled(pattern, &dictionary, factor);
        assert!(scaled.windows(2).all(|w| w[0].t < w[1].t), "{factor}");
        let ratio = scaled.len() as f64 / source.len() as f64 / factor;
        assert!((0.8..1.25).contains(&ratio), "{factor}: {ratio}");
        for k in onset_steps(&dictionary, &source).into_iter().skip(1) {
            let at = (source[k].t as f64 * factor).round() as i64;
            let is_there = |step: &GrainStep| step.t == at && step.grain == source[k].grain;
            assert!(at >= 44_100 || scaled.iter().any(is_there), "{factor}: {at}");
        }
        let (before, after) = (times(&source).len(), times(&scaled).len());
        assert!(before.abs_diff(after) <= 2, "{factor}: {before} {after}");
    }
}

#[test]
fn variations_differ_in_grains_and_keep_the_rhythm() {
    let (dictionary, patterns) =
        all_of(vec![knocks(60_000, 6), knocks(60_000, 7)], 16, Retention::PerInterval(4));
    let pattern = &patterns.patterns[0];
    let rules = VariationRules::default();
    let of = |seed: u64| {
        let random = Random::new(seed, "variation");
        varied(pattern, &dictionary, &rules, |index, lane| random.uniform(0, index, lane))
    };
    let (a, b) = (of(1), of(2));
    assert_eq!(a, of(1));
    let same = a.iter().filter(|s| b.iter().any(|t| t.grain == s.grain && t.t == s.t)).count();
    assert!((same as f64) < 0.6 * a.len() as f64, "{same} of {}", a.len());
    let source = walk(pattern, &dictionary, GapRule::Extend);
    for k in onset_steps(&dictionary, &source) {
        assert!(a.iter().any(|step| step.t == source[k].t));
    }
    // The best alone, without jitter, is the walk up to ties of correlation.
    let first = varied(pattern, &dictionary, &VariationRules { among: 1, ..rules }, |_, _| 0.0);
    assert!(first.len() as f64 > 0.7 * source.len() as f64);
}

#[test]
fn a_density_leaves_out_or_adds_grains_between_onsets() {
    let (dictionary, patterns) = all_of(vec![knocks(400_000, 8)], 16, Retention::PerInterval(4));
    let pattern = &patterns.patterns[0];
    let random = Random::new(9, "variation");
    let of = |density: f64| {
        let rules = VariationRules { density, ..VariationRules::default() };
        varied(pattern, &dictionary, &rules, |index, lane| random.uniform(0, index, lane))
    };
    let source = walk(pattern, &dictionary, GapRule::Extend);
    let onsets: Vec<i64> = onset_steps(&dictionary, &source).into_iter().map(|k| source[k].t).collect();
    let plain = of(1.0);
    let others = |steps: &[GrainStep]| steps.iter().filter(|s| !onsets.contains(&s.t)).count() as f64;
    for density in [0.0, 0.3, 1.5, 3.0] {
        let steps = of(density);
        let ratio = others(&steps) / others(&plain);
        assert!((ratio - density).abs() <= 0.1 * density.max(0.5), "{density}: {ratio}");
        assert!(onsets.iter().all(|t| steps.iter().any(|s| s.t == *t)), "{density}");
        assert!(steps.windows(2).all(|w| w[0].t <= w[1].t));
    }
}
