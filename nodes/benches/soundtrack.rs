//! Time and quality of sound textures and of motion queries.
//!
//! Run with `cargo bench -p foley-nodes -- soundtrack`. Real recordings are those of the data beside the repository, or at `FOLEY_DATA`.

mod motions;

use super::common::{folder, load};
use foley_nodes::core::random::{Random, Rng};
use foley_nodes::dsp::{Band, Butterworth, zero_phase};
use foley_nodes::likeness::{LikenessRules, Take, compare};
use foley_nodes::soundtrack::score::{Constraints, read_score};
use foley_nodes::soundtrack::synthesis::{SourcePosition, SynthesisRules, TextureStream};
use foley_nodes::soundtrack::wavelet::{
    TextureModel, ThresholdRules, TreeRecording, TreeRules, Wavelet, WaveletTree, forward, inverse,
};
use std::collections::HashSet;
use std::sync::Arc;
use std::time::Instant;

/// The least time of five runs, ms.
fn least<T>(mut work: impl FnMut() -> T) -> f64 {
    let one = |_| {
        let start = Instant::now();
        std::hint::black_box(work());
        1e3 * start.elapsed().as_secs_f64()
    };
    (0..5).map(one).fold(f64::INFINITY, f64::min)
}

/// Noise whose colour and level wander.
fn noise(samples: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let (mut x, mut level) = (0.0, 0.0);
    let mut next = || {
        level = 0.9999 * level + 0.01 * rng.between(-1.0, 1.0);
        x = 0.8 * x + rng.between(-1.0, 1.0);
        (0.1 * x * (1.0 + level)) as f32
    };
    (0..samples).map(|_| next()).collect()
}

fn tree(rate: f64, channel: Vec<f32>, rules: &TreeRules) -> WaveletTree {
    let recording =
        TreeRecording { name: "recording".into(), content: String::new(), channels: vec![channel] };
    WaveletTree::analyse(rate, &[recording], rules).expect("a recording that is long enough")
}

pub fn model(rate: f64, channel: Vec<f32>) -> Arc<TextureModel> {
    model_by(rate, channel, &ThresholdRules::default())
}

fn model_by(rate: f64, channel: Vec<f32>, rules: &ThresholdRules) -> Arc<TextureModel> {
    Arc::new(TextureModel::new(tree(rate, channel, &TreeRules::default()), rules))
}

/// Seeds with which a texture is made for its statistics.
pub const SEEDS: u64 = 8;

/// The output of a synthesis, the leaves it was copied from, and the longest time in which as much as one root was made, in ms.
fn synthesise(model: &Arc<TextureModel>, score: &str, seconds: f64) -> (Vec<f32>, Vec<u32>, f64) {
    synthesise_by(model, score, seconds, SynthesisRules::default(), 1)
}

pub fn synthesise_by(
    model: &Arc<TextureModel>,
    score: &str,
    seconds: f64,
    rules: SynthesisRules,
    seed: u64,
) -> (Vec<f32>, Vec<u32>, f64) {
    let tree = &model.tree;
    let constraints = match score {
        "" => Constraints::default(),
        text => {
            Constraints::new(&read_score(text).expect("a score"), tree, false).expect("a score that fits")
        }
    };
    let random = Random::new(seed, "texture");
    let mut stream =
        TextureStream::new(Arc::clone(model), Arc::new(constraints), rules, random, Some(seconds));
    let frames = (seconds * tree.rate) as usize;
    let (mut out, mut positions) = (vec![0.0; frames], vec![SourcePosition::default(); frames.div_ceil(2)]);
    let (mut worst, span) = (0.0_f64, tree.span(0));
    for (k, (out, positions)) in out.chunks_mut(span).zip(positions.chunks_mut(span / 2)).enumerate() {
        let start = Instant::now();
        stream.fill((k * span) as i64, None, out, positions);
        // The first window needs those before it too.
        worst = if k == 0 { worst } else { worst.max(1e3 * start.elapsed().as_secs_f64()) };
    }
    (out, positions.iter().map(|p| p.frame / 2).collect(), worst)
}

fn transform() {
    let x: Vec<f64> = noise((960_000 >> 14) << 14, 1).into_iter().map(f64::from).collect();
    let single: Vec<f32> = x.iter().map(|x| *x as f32).collect();
    let c = forward(Wavelet::Db5, 14, &x);
    let c32 = forward(Wavelet::Db5, 14, &single);
    println!(
        "transform of {} samples, db5, 14 levels: f64 {:.1} ms forward, {:.1} ms inverse; f32 {:.1} and {:.1} ms",
        x.len(),
        least(|| forward(Wavelet::Db5, 14, &x)),
        least(|| inverse(Wavelet::Db5, &c)),
        least(|| forward(Wavelet::Db5, 14, &single)),
        least(|| inverse(Wavelet::Db5, &c32)),
    );
}

fn textures() {
    let source = noise(320_000, 2);
    println!("model of 10 s at 32 kHz: {:.1} ms", least(|| model(32_000.0, source.clone())));
    let model_10 = model(32_000.0, source);
    let soft = "SoundScore(sources: [(name: \"a\", segments: [(3, 6)])], targets: [(source: \"a\", from: 0, to: 30, weight: 0.5)])";
    let hard = "SoundScore(sources: [(name: \"a\", segments: [(1, 4)]), (name: \"b\", segments: [(5, 9)])],
        targets: [(source: \"a\", from: 0, to: 10), (source: \"b\", from: 10, to: 20), (source: \"a\", from: 20, to: 31)])";
    for (name, score) in [("undirected", ""), ("soft", soft), ("hard throughout", hard)] {
        println!("30 s of 32 kHz from 10 s, {name}: {:.0} ms", least(|| synthesise(&model_10, score, 30.0)));
    }
    for (source, output) in [
        (10.0, 10.0),
        (60.0, 10.0),
        (600.0, 10.0),
        (3600.0, 10.0),
        (10.0, 60.0),
        (10.0, 600.0),
        (600.0, 600.0),
    ] {
        let start = Instant::now();
        let model = model(32_000.0, noise((32_000.0 * source) as usize, 3));
        let made = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let _ = synthesise(&model, "", output);
        println!(
            "source of {source} s, output of {output} s: model {made:.2} s, synthesis {:.2} s",
            start.elapsed().as_secs_f64()
        );
    }
    let rules = TreeRules { wavelet: Wavelet::Db2, block: Some(0.04), ..TreeRules::default() };
    let live = TextureModel::new(tree(32_000.0, noise(320_000, 4), &rules), &ThresholdRules::default());
    let block = 1e3 * live.tree.span(0) as f64 / 32_000.0;
    let (_, _, worst) = synthesise(&Arc::new(live), soft, 30.0);
    println!("live, db2, blocks of {block:.0} ms: the slowest block takes {worst:.2} ms");
}

/// Levels and kurtosis of third octaves, and levels of modulation in four bands of octaves, of a sound.
pub fn statistics(x: &[f32], rate: f64) -> Vec<f64> {
    let x: Vec<f64> = x.iter().map(|x| f64::from(*x)).collect();
    // Without both ends, where the filters settle: a sound that is cut where it is loud begins and ends with a step.
    let band = |x: &[f64], rate: f64, low: f64, high: f64| {
        let pass = |band, cutoff: f64| Butterworth::design(band, 3, cutoff, rate);
        let y = match (pass(Band::HighPass, low), pass(Band::LowPass, high)) {
            (Ok(a), Ok(b)) => zero_phase(&b, &zero_phase(&a, x)),
            (Ok(a), Err(_)) => zero_phase(&a, x),
            _ => x.to_vec(),
        };
        let settled = ((2.0 * rate / (high - low)) as usize).min(x.len() / 4);
        y[settled..y.len() - settled].to_vec()
    };
    let power = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64;
    let mut out = Vec::new();
    let mut centre = 80.0;
    while centre * 1.2 < rate / 2.0 && centre < 16_500.0 {
        let y = band(&x, rate, centre * 2_f64.powf(-1.0 / 6.0), centre * 2_f64.powf(1.0 / 6.0));
        let p = power(&y) + 1e-15;
        let fourth = y.iter().map(|y| y.powi(4)).sum::<f64>() / y.len() as f64;
        out.extend([10.0 * p.log10(), (fourth / (p * p)).ln() * 4.0]);
        centre *= 2_f64.powf(1.0 / 3.0);
    }
    let mut centre = 125.0;
    while centre * 1.5 < rate / 2.0 {
        let y = band(&x, rate, centre / 1.414, centre * 1.414);
        let step = (rate / 400.0) as usize;
        let envelope: Vec<f64> = y.chunks(step).map(|y| power(y).sqrt()).collect();
        let mean = envelope.iter().sum::<f64>() / envelope.len() as f64;
        let relative: Vec<f64> = envelope.iter().map(|e| e / mean.max(1e-12) - 1.0).collect();
        for (low, high) in [(2.0, 8.0), (8.0, 32.0), (32.0, 128.0)] {
            out.push(10.0 * (power(&band(&relative, rate / step as f64, low, high)) + 1e-9).log10());
        }
        centre *= 2.0;
    }
    out
}

/// Joins by the measure of `LikenessReport`: 95th percentile of levels above 8 kHz in 5 ms at joins and in the recording, dB of the level of each,
/// and the share of joins above that of the recording. `y` is of several parts of `part` leaves each.
fn joins(x: &[f32], y: &[f32], leaves: &[u32], part: usize, rate: f64) -> Option<[f64; 3]> {
    let take = Take { name: "recording".into(), rate, samples: x.to_vec() };
    let is_join = |k: &usize| leaves[k - 1] + 1 != leaves[*k] && !k.is_multiple_of(part);
    let joins = (1..leaves.len()).filter(is_join).map(|k| 2.0 * k as f64 / rate);
    let rules = LikenessRules { joins: Some(joins.collect()), ..LikenessRules::default() };
    let report = compare(y, rate, &[take], &rules).joins?;
    Some([report.joins_db?, report.recordings_db?, report.share_above?])
}

/// Root mean square of the differences of two lists of [`statistics`] in levels, kurtosis and modulation.
fn differences(a: &[f64], b: &[f64], thirds: usize) -> [f64; 3] {
    let rms = |of: &dyn Fn(usize) -> bool| {
        let squares: Vec<f64> = (0..a.len()).filter(|k| of(*k)).map(|k| (a[k] - b[k]).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    [rms(&|k| k < thirds && k % 2 == 0), rms(&|k| k < thirds && k % 2 == 1), rms(&|k| k >= thirds)]
}

/// The share of segments of 0.25 s at least half of which is heard again within 2 s.
fn returns(leaves: &[u32], rate: f64) -> f64 {
    let frames = |seconds: f64| (seconds * rate / 2.0) as usize;
    let (segment, reach) = (frames(0.25), frames(2.0));
    let starts = || (0..leaves.len().saturating_sub(segment + reach)).step_by(segment);
    let comes_back = |start: &usize| {
        let later: HashSet<u32> = leaves[start + segment..start + segment + reach].iter().copied().collect();
        2 * leaves[*start..start + segment].iter().filter(|m| later.contains(m)).count() >= segment
    };
    starts().filter(comes_back).count() as f64 / starts().count().max(1) as f64
}

/// Lengths of stretches that are copied, in samples.
fn runs(leaves: &[u32]) -> Vec<usize> {
    let mut all = vec![2];
    for pair in leaves.windows(2) {
        if pair[1] == pair[0] + 1 {
            if let Some(last) = all.last_mut() {
                *last += 2;
            }
        } else {
            all.push(2);
        }
    }
    all.sort_unstable();
    all
}

fn recordings() {
    let names = [
        "rain.flac",
        "rain_mono.wav",
        "ocean_mono.wav",
        "sea_waves.ogg",
        "fire_fireplace.flac",
        "crowd_coffee_shop.flac",
        "traffic_city.flac",
        "machine_3d_printer.flac",
        "jungle_day.flac",
        "explosions_fireworks.flac",
    ];
    println!(
        "recording, {SEEDS} times 60 s: share of statistics within those of the halves and quarters of the source (and of each quarter within the others); \
         greatest difference of a third octave; 95th percentile of levels above 8 kHz at joins and of the source, and the share of joins above that of the source; longest and median stretch; \
         difference from the source, rms and greatest over seeds (of its halves from each other), in levels, kurtosis, modulation; share of 0.25 s heard again within 2 s, and with repetition 0.1; \
         differences with quantile 0.25 and without gains at joins"
    );
    let mut back = [0.0; 2];
    for name in names {
        let Some((rate, x)) = load(folder("recordings/texture").join(name)) else {
            println!("{name}: not found, skipped");
            continue;
        };
        let seconds = 60.0;
        let own_model = model(rate, x.clone());
        let quarter = x.len() / 4;
        let mut parts: Vec<Vec<f64>> =
            (0..4).map(|k| statistics(&x[k * quarter..(k + 1) * quarter], rate)).collect();
        let within = |s: &[f64], parts: &[Vec<f64>]| {
            let is_within = |k: &usize| {
                let of = parts.iter().map(|p| p[*k]);
                let (low, high) =
                    of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
                s[*k] >= low - 0.5 && s[*k] <= high + 0.5
            };
            (0..s.len()).filter(is_within).count() as f64 / s.len() as f64
        };
        let own: f64 = (0..4)
            .map(|k| {
                let mut others = parts.clone();
                let one = others.remove(k);
                within(&one, &others) / 4.0
            })
            .sum();
        parts.push(statistics(&x[..x.len() / 2], rate));
        parts.push(statistics(&x[x.len() / 2..], rate));
        let whole = statistics(&x, rate);
        let thirds =
            whole.len() - 3 * (0..20).take_while(|k| 125.0 * 2_f64.powi(*k) * 1.5 < rate / 2.0).count();
        let own_kinds = differences(&parts[4], &parts[5], thirds);
        let (mut share, mut worst) = (0.0, 0.0_f64);
        let (mut sound, mut all_leaves, mut all_kinds) = (Vec::new(), Vec::new(), Vec::new());
        let (mut all_runs, mut heard_again) = (Vec::new(), 0.0);
        for seed in 1..=SEEDS {
            let (y, leaves, _) = synthesise_by(&own_model, "", seconds, SynthesisRules::default(), seed);
            let s = statistics(&y, rate);
            share += within(&s, &parts) / SEEDS as f64;
            worst = (0..thirds).step_by(2).map(|k| (s[k] - whole[k]).abs()).fold(worst, f64::max);
            all_kinds.push(differences(&s, &whole, thirds));
            all_runs.extend(runs(&leaves));
            heard_again += returns(&leaves, rate) / SEEDS as f64;
            sound.extend(y);
            all_leaves.extend(leaves);
        }
        all_runs.sort_unstable();
        let part = all_leaves.len() / SEEDS as usize;
        let [at_joins, in_recording, louder] =
            joins(&x, &sound, &all_leaves, part, rate).unwrap_or([f64::NAN; 3]);
        let length = |n: usize| n as f64 / rate;
        let text = |all: &[[f64; 3]]| -> Vec<String> {
            let one = |kind: usize| {
                let of = || all.iter().map(move |one| one[kind]);
                let rms = (of().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt();
                format!("{rms:.2}, at most {:.2} ({:.2})", of().fold(0.0, f64::max), own_kinds[kind])
            };
            (0..3).map(one).collect()
        };
        let loose = ThresholdRules { quantile: 0.25, ..ThresholdRules::default() };
        let rules = SynthesisRules { join_gain: 0.0, ..SynthesisRules::default() };
        let (loose, _, _) = synthesise_by(&model_by(rate, x.clone(), &loose), "", seconds, rules, 1);
        let loose = differences(&statistics(&loose, rate), &whole, thirds);
        let rules = SynthesisRules { repetition: 0.1, ..SynthesisRules::default() };
        let varied = synthesise_by(&own_model, "", seconds, rules, 1).1;
        let heard_again = [heard_again, returns(&varied, rate)];
        back.iter_mut().zip(heard_again).for_each(|(sum, share)| *sum += share / names.len() as f64);
        println!(
            "{name}: {:.0} % ({:.0} %); {worst:.1} dB; {:.1} and {:.1} dB, {:.1} %; {:.2} s, {:.3} s; {}; {:.0} %, {:.0} %; {loose:.2?}",
            100.0 * share,
            100.0 * own,
            at_joins,
            in_recording,
            100.0 * louder,
            length(all_runs[all_runs.len() - 1]),
            length(all_runs[all_runs.len() / 2]),
            text(&all_kinds).join("; "),
            100.0 * heard_again[0],
            100.0 * heard_again[1],
        );
    }
    println!(
        "heard again within 2 s, mean: {:.1} %, with repetition 0.1 {:.1} %",
        100.0 * back[0],
        100.0 * back[1]
    );
}

/// Times at which a change of a score is heard: the first sample that differs, and the first at which only the new sound is heard.
fn reaction() {
    let rate = 32_000.0;
    for (wavelet, block) in [(Wavelet::Haar, 0.016), (Wavelet::Db2, 0.04), (Wavelet::Db5, 0.064)] {
        let rules = TreeRules { wavelet, block: Some(block), ..TreeRules::default() };
        let tree = tree(rate, noise(320_000, 4), &rules);
        let span = tree.span(0) as f64 / rate;
        let model = Arc::new(TextureModel::new(tree, &ThresholdRules::default()));
        let score = |targets: &str| {
            format!(
                "SoundScore(sources: [(name: \"a\", segments: [(1, 4)]), (name: \"b\", segments: [(5, 9)])], targets: [(source: \"a\", from: 0, to: 2), {targets}], pad: 0)"
            )
        };
        let rules = SynthesisRules { look_ahead: 0.0, ..SynthesisRules::default() };
        let make = |targets| synthesise_by(&model, &score(targets), 4.0, rules.clone(), 1);
        let (before, _, _) = make("(source: \"a\", from: 2, to: 5)");
        let (after, leaves, _) = make("(source: \"b\", from: 2, to: 5)");
        let first = before.iter().zip(&after).position(|(a, b)| a != b).unwrap_or(before.len());
        let wanted = ((5.0 * rate / 2.0) as u32)..((9.0 * rate / 2.0) as u32);
        let last = leaves.iter().rposition(|m| !wanted.contains(m)).map_or(0, |k| 2 * k + 2);
        println!(
            "{wavelet:?}, blocks of {:.0} ms: a change of the score at 2 s changes samples from {:+.0} ms on (bound {:+.0} ms), nothing else is copied from {:+.0} ms on",
            1e3 * span,
            1e3 * (first as f64 / rate - 2.0),
            -1e3 * (wavelet.reach() as f64 + 1.0) * span,
            1e3 * (last as f64 / rate - 2.0),
        );
    }
}

pub fn bench() {
    transform();
    textures();
    reaction();
    motions::queries();
    motions::gestures();
    recordings();
}
