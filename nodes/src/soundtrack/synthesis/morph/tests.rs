use super::*;
use crate::core::random::{Random, Rng};
use crate::soundtrack::score::{Constraints, read_score};
use crate::soundtrack::synthesis::{SynthesisRules, Synthesizer};
use crate::soundtrack::wavelet::{ThresholdRules, TreeRecording, TreeRules, WaveletTree};
use std::sync::Arc;

const RATE: f64 = 1000.0;
const SOURCES: &str =
    "sources: [(name: \"a\", segments: [(0, 8)]), (name: \"b\", segments: [(0, 8)], recording: \"b\")]";

/// Steady noise, and soft noise of another colour with bursts.
fn model() -> Arc<TextureModel> {
    let mut rng = Rng::new(3);
    let mut last = 0.0;
    let a = (0..8192).map(|_| rng.between(-0.5, 0.5) as f32).collect();
    let b = (0..8192).map(|k: u32| {
        last = 0.8 * last + rng.between(-0.1, 0.1) * if (k / 13).is_multiple_of(5) { 3.0 } else { 0.5 };
        last as f32
    });
    let recording = |name: &str, channel| TreeRecording {
        name: name.into(),
        content: String::new(),
        channels: vec![channel],
    };
    let rules = TreeRules { block: Some(0.13), ..TreeRules::default() };
    let tree = WaveletTree::analyse(RATE, &[recording("a", a), recording("b", b.collect())], &rules).unwrap();
    Arc::new(TextureModel::new(tree, &ThresholdRules::default()))
}

/// The details of an output by level, and its leaves.
fn synthesised(
    model: &Arc<TextureModel>,
    overlap: OverlapMode,
    targets: &str,
    roots: usize,
) -> (Vec<Vec<f32>>, Vec<u32>) {
    let score = read_score(&format!("SoundScore({SOURCES}, targets: [{targets}])")).unwrap();
    let constraints = Arc::new(Constraints::new(&score, &model.tree, overlap.is_mixed()).unwrap());
    let rules = SynthesisRules { overlap, look_ahead: 0.0, ..SynthesisRules::default() };
    let mut s = Synthesizer::new(Arc::clone(model), constraints, rules, Random::new(1, "morph"), 0, None);
    let depth = model.tree.depth as usize;
    let (mut details, mut leaves) = (vec![Vec::new(); depth], Vec::new());
    for _ in 0..roots {
        s.advance(None);
        details.iter_mut().enumerate().for_each(|(level, all)| all.extend_from_slice(s.details(level)));
        leaves.extend_from_slice(s.leaves());
    }
    (details, leaves)
}

const A: &str = "(source: \"a\", from: 0, to: 100)";
const B: &str = "(source: \"b\", from: 0, to: 100)";

#[test]
fn an_overlap_is_a_mixture_of_what_each_sound_alone_gives() {
    let model = model();
    for mode in [OverlapMode::Geometric, OverlapMode::Linear] {
        let [a, b] = [A, B].map(|targets| synthesised(&model, mode, targets, 40).0);
        let (mixed, _) = synthesised(&model, mode, &format!("{A}, {B}"), 40);
        let score = read_score(&format!("SoundScore({SOURCES}, targets: [])")).unwrap();
        let sets = Constraints::new(&score, &model.tree, true).unwrap().sets;
        let morph = Morph::new(mode, &model, &sets);
        for level in 0..model.tree.depth as usize {
            let mixture = morph.mixture(level, [0, 1], 0.5);
            for (mixed, (a, b)) in mixed[level].iter().zip(a[level].iter().zip(&b[level])) {
                assert_eq!(*mixed, mixture.mix(*a, *b));
            }
        }
    }
}

#[test]
fn the_level_of_a_mixture_lies_between_those_of_both_sounds() {
    let model = model();
    let power = |x: &[f32]| x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len() as f64;
    for mode in [OverlapMode::Geometric, OverlapMode::Linear] {
        let [a, b] = [A, B].map(|targets| synthesised(&model, mode, targets, 400).0);
        for share in [0.25, 0.5, 0.75] {
            let weights = |w: f64| format!(", from: 0, to: 100, weight: {w})");
            let targets = [A, B].map(|t| {
                t.replace(", from: 0, to: 100)", &weights(if t == A { share } else { 1.0 - share }))
            });
            let (mixed, _) = synthesised(&model, mode, &targets.join(","), 400);
            for level in 1..model.tree.depth as usize {
                let [m, a, b] = [&mixed, &a, &b].map(|x| power(&x[level]));
                let expected = match mode {
                    OverlapMode::Geometric => (share * a.ln() + (1.0 - share) * b.ln()).exp(),
                    _ => share * a + (1.0 - share) * b,
                };
                let difference = 10.0 * (m / expected).log10();
                assert!(difference.abs() < 1.0, "{mode:?} {share} {level}: {difference}");
            }
        }
    }
}

#[test]
fn without_an_overlap_nothing_is_mixed() {
    let model = model();
    let targets = "(source: \"a\", from: 0, to: 1), (source: \"b\", from: 1.5, to: 2, weight: 0.5), (source: \"a\", from: 3, to: 4),
        (source: \"b\", from: 4, to: 5, weight: -1)";
    // A node of a coarse level that two targets share would be a mixture: these are apart.
    let winner = synthesised(&model, OverlapMode::Winner, targets, 50);
    assert!(synthesised(&model, OverlapMode::Geometric, targets, 50) == winner);
    // What precedes an overlap has the same bits.
    let overlap = format!("{targets}, (source: \"b\", from: 3.4, to: 4, weight: 0.5)");
    let (details, morphed) = synthesised(&model, OverlapMode::Geometric, &overlap, 50);
    let roots = (3.3 * RATE) as usize / model.tree.span(0);
    let leaves = roots << (model.tree.depth - 1);
    assert!(morphed[..leaves] == winner.1[..leaves] && details != winner.0);
}

#[test]
fn ramps_that_cross_go_from_one_sound_to_the_other() {
    let model = model();
    let targets = "(source: \"a\", curve: [(0, 1), (10, 1), (40, 0)]), (source: \"b\", curve: [(10, 0), (40, 1), (50, 1)])";
    let (details, _) = synthesised(&model, OverlapMode::Geometric, targets, 390);
    // The level of the finest details falls from that of the first to that of the second, steadily.
    let finest = details.last().unwrap();
    let seconds: Vec<f64> = finest
        .chunks(5 * 500)
        .map(|x| 10.0 * (x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len() as f64).log10())
        .collect();
    assert!(seconds[..9].windows(2).all(|pair| pair[1] < pair[0] + 0.5), "{seconds:?}");
    assert!(seconds[1] - seconds[8] > 10.0, "{seconds:?}");
    let steps: Vec<f64> = seconds[1..9].windows(2).map(|pair| pair[0] - pair[1]).collect();
    assert!(steps.iter().all(|step| *step < 6.0), "{seconds:?}");
}

#[test]
fn weights_that_make_up_one_are_hard_together() {
    let c =
        |weight, layer| crate::soundtrack::score::Constraint { set: layer, weight, is_hard: false, layer };
    let (both, share) = super::super::node_constraints::layered([c(0.6, 1), c(0.4, 0)]);
    assert!((share - 0.4).abs() < 1e-12 && both.iter().all(|c| c.is_hard && c.weight == 1.0));
    assert_eq!(both.map(|c| c.set), [0, 1]);
    let (both, share) = super::super::node_constraints::layered([c(0.3, 0), c(0.1, 0)]);
    assert!(
        (share - 0.75).abs() < 1e-12 && both.iter().all(|c| !c.is_hard && (c.weight - 0.4).abs() < 1e-12)
    );
}

#[test]
fn moments_are_means_of_powers() {
    let mut moments = Moments([0.0; STEPS + 1]);
    for k in 0..=STEPS {
        moments.0[k] = 0.3 * k as f64;
    }
    assert!((moments.at(0.53) - 0.3 * 0.53 * 16.0).abs() < 1e-12);
    assert_eq!((moments.at(0.0), moments.at(1.0)), (0.0, 0.3 * 16.0));
}

#[test]
fn a_mixture_of_one_sound_alone_is_that_sound() {
    let mut rng = Rng::new(1);
    for mode in [OverlapMode::Geometric, OverlapMode::Linear] {
        let morph = Morph { mode, moments: Vec::new() };
        for _ in 0..100 {
            let (a, b) = (rng.between(-1.0, 1.0) as f32, rng.between(-1.0, 1.0) as f32);
            assert_eq!(morph.mixture(0, [0, 1], 1.0).mix(a, b).to_bits(), a.to_bits());
            assert_eq!(morph.mixture(0, [0, 1], 0.0).mix(a, b).to_bits(), b.to_bits());
        }
    }
    let geometric = Morph { mode: OverlapMode::Geometric, moments: Vec::new() };
    let half = geometric.mixture(0, [0, 1], 0.5);
    assert!((half.mix(-0.4, 0.1) + 0.2).abs() < 1e-7 && (half.mix(0.1, 0.4) - 0.2).abs() < 1e-7);
}
