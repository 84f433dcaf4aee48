use super::super::model::{fit, lag_correlation, persistence};
use super::*;
use crate::core::computation::NotStored;
use crate::core::random::{Random, Rng};
use crate::grain::correlation::{CorrelateRules, CorrelationPatterns, Pattern, correlate};
use crate::grain::dictionary::{ExtractRules, extract};
use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part};
use crate::grain::synthesis::{GapRule, sound_of, walk};
use crate::statistics::special::chi_square_above;

/// Crackling of two kinds of sounds, whose levels rise and fall slowly.
fn crackle(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut x = vec![0.0_f32; n];
    let (mut t, mut level, mut kind) = (0.0, 0.0, 0);
    while (t as usize) < n {
        level = 0.8 * level + 4.0 * rng.between(-1.0, 1.0);
        if rng.uniform() < 0.2 {
            kind = 1 - kind;
        }
        let amplitude = 0.1 * 10f64.powf(level / 20.0);
        let (pitch, decay) = [(0.05, 150.0), (0.31, 60.0)][kind];
        for (i, y) in x[t as usize..].iter_mut().enumerate().take(900) {
            let noise = 0.3 * rng.between(-1.0, 1.0);
            let i = i as f64;
            *y +=
                (amplitude * (-i / decay).exp() * ((std::f64::consts::TAU * pitch * i).sin() + noise)) as f32;
        }
        t += rng.between(400.0, 1600.0);
    }
    x
}

fn stored(count: u64) -> (GrainDictionary, CorrelationPatterns) {
    let recording = |k: u64| GrainRecording {
        name: format!("crackle_{k}.wav"),
        parts: vec![Part { component: Component::Whole, channels: vec![crackle(60_000, 40 + k)] }],
        ..GrainRecording::default()
    };
    let all = GrainRecordings { rate: 44_100.0, recordings: (0..count).map(recording).collect() };
    let (dictionary, _) = extract(&all, &ExtractRules::at_rate(44_100.0));
    let patterns = correlate(&all, &dictionary, &CorrelateRules::default(), &|_| false, &NotStored).unwrap();
    (dictionary, patterns)
}

fn model_of(dictionary: &GrainDictionary, patterns: &[Pattern]) -> PatternModel {
    let model = fit(dictionary, &patterns.iter().collect::<Vec<_>>(), 6, 0.1).unwrap();
    model.check_dictionary(dictionary).unwrap();
    model
}

fn many(
    models: [&PatternModel; 2],
    dictionary: &GrainDictionary,
    blend: f64,
    count: usize,
) -> Vec<GeneratedGrain> {
    let random = Random::new(11, "generator");
    let rules = GeneratorRules { blend, ..GeneratorRules::default() };
    let mut generator = Generator::default();
    (0..count)
        .map(|_| generator.next(models, dictionary, &rules, |index, lane| random.uniform(0, index, lane)))
        .collect()
}

/// Greatest distance of the distribution of values from the one that has these quantiles, times the root of their number.
fn distance(values: &[f64], quantiles: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let far = (1..200).map(|k| {
        let share = f64::from(k) / 200.0;
        let x = quantile(quantiles, share);
        let [below, to] =
            [sorted.partition_point(|y| *y < x - 1e-9), sorted.partition_point(|y| *y <= x + 1e-9)];
        // Values that occur often span several shares.
        (share - to as f64 / n).max(below as f64 / n - share).max(0.0)
    });
    far.fold(0.0, f64::max) * n.sqrt()
}

#[test]
fn many_grains_have_the_statistics_of_the_model() {
    let (dictionary, patterns) = stored(3);
    let model = model_of(&dictionary, &patterns.patterns);
    let grains = many([&model, &model], &dictionary, 0.0, 100_000);
    // The limit of Kolmogorov and Smirnov for p = 0.01.
    let intervals: Vec<f64> = grains.iter().map(|g| g.interval).collect();
    assert!(distance(&intervals, &model.intervals) < 1.63);
    let levels: Vec<f64> = grains.iter().map(|g| g.residual).collect();
    // Levels are correlated, so that there are fewer independent ones.
    assert!(distance(&levels, &model.levels) < 1.63 * 2.0);
    let total = |g: &GeneratedGrain| g.residual + model.cluster_levels[g.cluster];
    let correlation = lag_correlation(&[&grains.iter().map(total).collect::<Vec<_>>()]);
    assert!((correlation - model.correlation).abs() < 0.02, "{correlation} {}", model.correlation);
    let n = model.clusters.len();
    let mut counts = vec![0.0; n * n];
    grains.windows(2).for_each(|w| counts[w[0].cluster * n + w[1].cluster] += 1.0);
    let (mut sum, mut freedom) = (0.0, 0.0);
    for (row, chances) in counts.chunks(n).zip(model.transitions.chunks(n)) {
        let total: f64 = row.iter().sum();
        let cells = row.iter().zip(chances).filter(|(_, p)| **p * total >= 5.0);
        let used = cells.clone().count() as f64;
        sum += cells.map(|(x, p)| (x - p * total).powi(2) / (p * total)).sum::<f64>();
        freedom += (used - 1.0).max(0.0);
    }
    // The distribution of Wilson and Hilferty for many degrees of freedom.
    let z = ((sum / freedom).cbrt() - (1.0 - 2.0 / (9.0 * freedom))) / (2.0 / (9.0 * freedom)).sqrt();
    assert!(chi_square_above(z.max(0.0).powi(2)) > 0.02, "{sum} of {freedom}");
}

#[test]
fn levels_of_any_distribution_have_the_wanted_correlation() {
    let (dictionary, patterns) = stored(1);
    // Mostly soft, sometimes loud.
    let levels: Vec<f64> = (0..500).map(|k| -60.0 + 40.0 * (f64::from(k) / 499.0).powi(6)).collect();
    for wanted in [-0.3, 0.2, 0.6, 0.9] {
        let persistence = persistence(&levels, wanted);
        let model =
            PatternModel { levels: levels.clone(), persistence, ..model_of(&dictionary, &patterns.patterns) };
        let grains = many([&model, &model], &dictionary, 0.0, 100_000);
        let found = lag_correlation(&[&grains.iter().map(|g| g.residual).collect::<Vec<_>>()]);
        assert!((found - wanted).abs() < 0.02, "{found} {wanted}");
    }
}

#[test]
fn between_two_models_quantiles_are_interpolated() {
    let (dictionary, patterns) = stored(2);
    let slow = model_of(&dictionary, &patterns.patterns);
    let mut fast = slow.clone();
    fast.intervals.iter_mut().for_each(|x| *x *= 0.5);
    fast.levels.iter_mut().for_each(|x| *x += 6.0);
    let grains = many([&slow, &fast], &dictionary, 0.5, 20_000);
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let interval = mean(&grains.iter().map(|g| g.interval).collect::<Vec<_>>());
    let wanted =
        mean(&many([&slow, &slow], &dictionary, 0.0, 20_000).iter().map(|g| g.interval).collect::<Vec<_>>());
    assert!((interval / wanted - 0.75).abs() < 0.01, "{interval} {wanted}");
    let levels: Vec<f64> = grains.iter().map(|g| g.residual).collect();
    assert!((mean(&levels) - mean(&slow.levels) - 3.0).abs() < 0.3);
}

#[test]
fn density_loudness_and_duration_are_followed() {
    let (dictionary, patterns) = stored(2);
    let model = model_of(&dictionary, &patterns.patterns);
    let random = Random::new(3, "generator");
    let of = |density: f64, gain: f64, seed: u32| {
        let rules = GeneratorRules { density, gain, blend: 0.0 };
        let uniform = |index: u64, lane: u32| random.uniform(seed, index, lane);
        generated([&model, &model], &dictionary, &rules, 441_000, false, uniform)
    };
    let (plain, dense, loud) = (of(1.0, 1.0, 0), of(2.0, 1.0, 0), of(1.0, 2.0, 0));
    assert!((dense.len() as f64 / plain.len() as f64 - 2.0).abs() < 0.1);
    assert!(plain.iter().zip(&loud).all(|(a, b)| (b.gain - 2.0 * a.gain).abs() < 1e-6));
    assert_ne!(of(1.0, 1.0, 1), plain);
    assert_eq!(of(1.0, 1.0, 0), plain);
    assert!(plain.windows(2).all(|w| w[0].t < w[1].t && w[0].grain != w[1].grain));
}

/// Shares of the power of the envelope in four octaves from 2 to 32 Hz.
fn modulation(x: &[f32], rate: f64) -> [f64; 4] {
    let block = (0.005 * rate) as usize;
    let level = |x: &[f32]| (x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len() as f64).sqrt();
    let envelope: Vec<f64> = x.chunks(block).map(level).collect();
    let mean = envelope.iter().sum::<f64>() / envelope.len() as f64;
    let resolution = rate / x.len() as f64;
    let power = |k: usize| {
        let step = std::f64::consts::TAU * k as f64 * resolution * block as f64 / rate;
        let at = |(i, y): (usize, &f64)| {
            [(y - mean) * (step * i as f64).cos(), (y - mean) * (step * i as f64).sin()]
        };
        let sums = envelope.iter().enumerate().map(at).fold([0.0; 2], |s, x| [s[0] + x[0], s[1] + x[1]]);
        sums[0] * sums[0] + sums[1] * sums[1]
    };
    let octave = |j: i32| {
        let [low, high] = [j, j + 1].map(|j| (2f64.powi(j) / resolution).round() as usize);
        (low..high.max(low + 1)).map(power).sum::<f64>()
    };
    let all = [1, 2, 3, 4].map(octave);
    all.map(|x| x / all.iter().sum::<f64>())
}

#[test]
fn what_is_drawn_without_a_recording_is_within_the_range_of_the_recordings() {
    let (dictionary, patterns) = stored(5);
    // Variation of the intervals, correlation of the levels, and the spectrum of the envelope, of a walk.
    let figures = |steps: &[GrainStep], frames: usize| -> Vec<f64> {
        let intervals: Vec<f64> = steps.windows(2).map(|w| (w[1].t - w[0].t) as f64).collect();
        let mean = intervals.iter().sum::<f64>() / intervals.len() as f64;
        let variance = intervals.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / intervals.len() as f64;
        let level = |s: &GrainStep| {
            10.0 * (f64::from(dictionary.grains[s.grain as usize].power) * f64::from(s.gain).powi(2)).log10()
        };
        let levels: Vec<f64> = steps.iter().map(level).collect();
        let mut all = vec![variance.sqrt() / mean, lag_correlation(&[&levels])];
        all.extend(modulation(&sound_of(&dictionary, [steps], frames), dictionary.rate));
        all
    };
    let walked = |pattern: &Pattern| walk(pattern, &dictionary, GapRule::Extend);
    let recorded: Vec<Vec<f64>> =
        patterns.patterns.iter().map(|p| figures(&walked(p), p.frames as usize)).collect();
    for k in 0..recorded.len() {
        let rest = patterns.patterns.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, p)| p.clone());
        let model = model_of(&dictionary, &rest.collect::<Vec<_>>());
        let random = Random::new(k as u64, "generator");
        let uniform = |index: u64, lane: u32| random.uniform(0, index, lane);
        let rules = GeneratorRules::default();
        let steps = generated([&model, &model], &dictionary, &rules, 1_200_000, false, uniform);
        let drawn = figures(&steps, 1_200_000);
        let names = ["intervals", "levels", "2 to 4 Hz", "4 to 8 Hz", "8 to 16 Hz", "16 to 32 Hz"];
        for (j, name) in names.into_iter().enumerate() {
            let low = recorded.iter().map(|f| f[j]).fold(f64::INFINITY, f64::min);
            let high = recorded.iter().map(|f| f[j]).fold(f64::NEG_INFINITY, f64::max);
            assert!((low..=high).contains(&drawn[j]), "{name} without {k}: {} {recorded:?}", drawn[j]);
        }
    }
}
