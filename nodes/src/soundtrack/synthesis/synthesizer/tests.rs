mod naive;

use super::super::choice::is_discarded;
use super::super::classes::source_value;
use super::super::rules::{CandidateSearch, MatchCount, MatchCriterion};
use super::super::step::{APPROXIMATE_ANCESTORS, predecessor};
use super::*;
use crate::core::random::Rng;
use crate::soundtrack::score::read_score;
use crate::soundtrack::synthesis::WeightBias;
use crate::soundtrack::wavelet::{
    BorderKind, ThresholdRules, TreeFit, TreeRecording, TreeRules, WaveletTree,
};
use naive::naive;

const RATE: f64 = 1000.0;

/// Noise whose colour and level change.
fn texture(samples: usize, channels: usize, seed: u64) -> Vec<Vec<f32>> {
    let mut rng = Rng::new(seed);
    (0..channels)
        .map(|_| {
            let (mut x, mut y) = (0.0, 0.0);
            (0..samples)
                .map(|k| {
                    let slow = (k as f64 / 97.0).sin();
                    x = 0.6 * x + rng.between(-1.0, 1.0) * (1.2 + slow);
                    y = 0.3 * y + x;
                    (0.1 * y) as f32
                })
                .collect()
        })
        .collect()
}

fn model_of(recordings: Vec<Vec<Vec<f32>>>, fit: TreeFit, block: f64, quantile: f64) -> Arc<TextureModel> {
    let recordings: Vec<TreeRecording> = recordings
        .into_iter()
        .enumerate()
        .map(|(k, channels)| TreeRecording { name: format!("{k}.wav"), content: String::new(), channels })
        .collect();
    let rules = TreeRules { fit, block: Some(block), ..TreeRules::default() };
    let tree = WaveletTree::analyse(RATE, &recordings, &rules).unwrap();
    let threshold = (!(0.0..1.0).contains(&quantile)).then_some(quantile.max(0.0));
    Arc::new(TextureModel::new(tree, &ThresholdRules { quantile, threshold, ..ThresholdRules::default() }))
}

fn constraints(model: &TextureModel, score: &str) -> Arc<Constraints> {
    let text = format!("SoundScore({score})");
    Arc::new(Constraints::new(&read_score(&text).unwrap(), &model.tree, true).unwrap())
}

/// Rules with no preference against repetition.
fn free() -> SynthesisRules {
    SynthesisRules { max_run: None, look_ahead: 0.0, ..SynthesisRules::default() }
}

/// The picks of all levels and roots.
fn synthesised(
    model: &Arc<TextureModel>,
    constraints: &Arc<Constraints>,
    rules: &SynthesisRules,
    roots: usize,
    seed: u64,
) -> (Vec<Vec<u32>>, SynthesisCounts) {
    let random = Random::new(seed, "texture");
    let mut synthesizer =
        Synthesizer::new(Arc::clone(model), Arc::clone(constraints), rules.clone(), random, 0, None);
    let mut picks = vec![Vec::new(); model.tree.depth as usize];
    for _ in 0..roots {
        synthesizer.advance(None);
        for (all, level) in picks.iter_mut().zip(&synthesizer.layers[0].tree.levels) {
            all.extend_from_slice(&level.picks[synthesizer.layers[0].tree.history..]);
        }
    }
    (picks, synthesizer.counts)
}

/// Rules with one of the 8 ways to count and to search.
fn variant(k: u64, rules: SynthesisRules) -> SynthesisRules {
    SynthesisRules {
        count: [MatchCount::Consecutive, MatchCount::Total][k as usize % 2],
        criterion: [MatchCriterion::PerCoefficient, MatchCriterion::RunningMean][k as usize / 2 % 2],
        search: [CandidateSearch::Exact, CandidateSearch::Narrow][k as usize / 4 % 2],
        continuity: [None, Some(0.5)][(k as usize + k as usize / 2) % 2],
        ..rules
    }
}

#[test]
fn the_search_finds_what_comparing_all_nodes_finds() {
    for seed in 0..96_u64 {
        let channels = 1 + seed as usize % 2;
        let quantile = [0.02, 0.1, 0.25, 0.5][seed as usize % 4];
        let fit = [TreeFit::Circular, TreeFit::PadReflect, TreeFit::Trim][seed as usize % 3];
        let mut first = texture(1100, channels, seed);
        if seed % 5 == 0 {
            first.iter_mut().for_each(|x| x[300..800].fill(0.0));
        }
        let model = model_of(vec![first, texture(700, channels, seed + 99)], fit, 0.13, quantile);
        let rules = SynthesisRules {
            max_run: [Some(0.2), None, Some(0.3), None, Some(0.45), None][seed as usize % 6],
            ..variant(seed / 12, free())
        };
        let none = Arc::new(Constraints::default());
        // Some of the recordings have digital silence.
        let (fast, counts) = synthesised(&model, &none, &rules, 12, seed);
        assert_eq!(fast, naive(&model, &none, &rules, 12, seed), "seed {seed}");
        assert!(counts.capped == 0 && counts.steps == 12 * 64, "{counts:?}");
    }
}

#[test]
fn roots_are_joined_at_borders_of_a_class_and_chosen_equally_often() {
    let model = model_of(vec![texture(6000, 1, 4)], TreeFit::Circular, 0.13, 0.002);
    let roots = model.tree.roots();
    let rules = SynthesisRules { max_run: Some(0.3), ..free() };
    let (picks, _) = synthesised(&model, &Arc::new(Constraints::default()), &rules, 100 * roots, 7);
    let borders = |root: u32| model.envelopes.borders(root);
    let finest = model.tree.depth as usize - 1;
    // Roots of what is heard, by their first halves.
    let first = picks[finest].iter().skip((1 << finest) / 4).step_by(1 << finest);
    let heard: Vec<u32> = first.map(|leaf| leaf >> finest).collect();
    let mut counts = vec![0; roots];
    heard.iter().for_each(|root| counts[*root as usize] += 1);
    assert!(counts.iter().all(|n| (70..140).contains(n)), "{counts:?}");
    // Few roots come back before half as many as there are roots: a sixth, as borders leave little choice. Without preferences 40 % would.
    let again = heard.windows(roots / 2 + 1).filter(|w| w[..roots / 2].contains(&w[roots / 2])).count();
    assert!(5 * again < heard.len(), "{again} of {}", heard.len());
    // The roots of the last leaf before each root, and the root.
    let pairs = || (1..picks[0].len()).map(|k| (picks[finest][(k << finest) - 1] >> finest, picks[0][k]));
    let joins = || pairs().filter(|(before, root)| predecessor(&model, 0, *root, 1) != Some(*before));
    let alike = joins().filter(|(before, root)| borders(*before)[1] == borders(*root)[0]).count();
    assert_eq!(alike, joins().count());
    // Fewer at loud borders.
    let loud = |roots: &mut dyn Iterator<Item = u32>| {
        roots.filter(|m| borders(*m)[1].kind == BorderKind::Loud).count()
    };
    let share = loud(&mut joins().map(|pair| pair.0)) as f64 / joins().count() as f64;
    let expected = loud(&mut picks[0].iter().copied()) as f64 / picks[0].len() as f64;
    assert!(expected > 0.05 && share < 0.8 * expected, "{share} {expected}");
    // The same holds for the leaves, which are what is heard. Some stretches end within a root, where there are no borders.
    let leaves = picks[finest].windows(2).skip((1 << finest) - 1).step_by(1 << finest);
    let heard =
        leaves.filter(|pair| pair[0] + 1 != pair[1] && ((pair[0] + 1) | pair[1]) % (1 << finest) == 0);
    let heard: Vec<[u32; 2]> = heard.map(|pair| [pair[0] >> finest, pair[1] >> finest]).collect();
    let unlike = heard.iter().filter(|[before, root]| borders(*before)[1] != borders(*root)[0]).count();
    assert!(heard.len() > 10 * roots && 10 * unlike < heard.len(), "{unlike} of {}", heard.len());
}

#[test]
fn stretches_end_before_loud_borders() {
    let mut recording = texture(6000, 1, 4);
    // Short bangs at borders of roots, which have 128 samples.
    for border in (6..46).step_by(8).map(|root| 128 * root) {
        recording[0][border - 24..border + 24].iter_mut().for_each(|x| *x *= 30.0);
    }
    let model = model_of(vec![recording], TreeFit::Circular, 0.13, 0.002);
    let kind = |root: u32| model.envelopes.borders(root)[1].kind;
    let rules = SynthesisRules { max_run: Some(0.3), ..free() };
    let none = Arc::new(Constraints::default());
    let (picks, _) = synthesised(&model, &none, &rules, 100 * model.tree.roots(), 7);
    let finest = model.tree.depth as usize - 1;
    let at = |kinds: BorderKind| {
        // The leaves before and after each root of the output that ends at borders of a kind.
        let ends = picks[finest].windows(2).skip((1 << finest) - 1).step_by(1 << finest);
        let of_kind =
            ends.filter(|pair| (pair[0] + 1) % (1 << finest) == 0 && kind(pair[0] >> finest) == kinds);
        let goes_on: Vec<bool> =
            of_kind.map(|pair| predecessor(&model, finest, pair[1], 1) == Some(pair[0])).collect();
        (goes_on.iter().filter(|on| **on).count(), goes_on.len())
    };
    // Two roots fit into a stretch: after the first of two, the loud border would be its end.
    let (on, all) = at(BorderKind::BeforeLoud);
    assert!(all > 200 && 20 * on < all, "{on} of {all}");
    let (on, all) = at(BorderKind::Loud);
    assert!(all > 200 && 2 * on > all, "{on} of {all}");
    // Stretches have one root at least.
    let pairs = picks[finest].windows(2).enumerate();
    let joins = pairs.filter(|(_, pair)| predecessor(&model, finest, pair[1], 1) != Some(pair[0]));
    let joins: Vec<usize> = joins.map(|(k, _)| k + 1).collect();
    let within = joins.iter().filter(|leaf| *leaf % (1 << finest) != 0).count();
    assert!(joins.len() > 2000 && 20 * within < joins.len(), "{within} of {}", joins.len());
    for seed in 0..4 {
        let (fast, _) = synthesised(&model, &none, &rules, 12, seed);
        assert_eq!(fast, naive(&model, &none, &rules, 12, seed), "seed {seed}");
    }
}

#[test]
fn the_directed_search_finds_what_comparing_all_nodes_finds() {
    let mut seen = SynthesisCounts::default();
    for seed in 0..48_u64 {
        let quantile = [0.1, 0.25, 0.5][seed as usize % 3];
        let model = model_of(
            vec![texture(1500, 1, seed), texture(700, 1, seed + 99)],
            TreeFit::Circular,
            0.13,
            quantile,
        );
        let bias = [WeightBias::Probability, WeightBias::Monotone, WeightBias::Paper][seed as usize % 3];
        let look_ahead = [0.0, 0.1][seed as usize % 2];
        let rules = SynthesisRules { bias, look_ahead, ..variant(seed / 2, free()) };
        let score = "sources: [(name: \"a\", segments: [(0.2, 0.5), (0.8, 0.9)]), (name: \"b\", segments: [(0.05, 0.3)], recording: \"1.wav\"),
            (name: \"c\", segments: [(0.5, 0.7)])],
            targets: [(source: \"a\", curve: [(0.1, 0), (0.3, 1), (0.6, 1), (0.7, 0.2)]), (source: \"b\", from: 0.55, to: 0.9, weight: 0.5),
            (source: \"a\", from: 0.9, to: 1.2, weight: -0.7), (source: \"c\", from: 0.2, to: 1.3, weight: -1)]";
        let directed = constraints(&model, score);
        let (fast, counts) = synthesised(&model, &directed, &rules, 12, seed);
        assert_eq!(fast, naive(&model, &directed, &rules, 12, seed), "seed {seed}");
        seen.partial += counts.partial;
        seen.discarded += counts.discarded;
        seen.unprepared += counts.unprepared;
    }
    assert!(seen.partial > 0 && seen.discarded > 0 && seen.unprepared > 0, "{seen:?}");
}

#[test]
fn an_undirected_choice_matches_all_its_ancestors() {
    let model = model_of(vec![texture(3000, 1, 3)], TreeFit::Circular, 0.13, 0.25);
    let (_, counts) = synthesised(&model, &Arc::default(), &free(), 40, 1);
    assert_eq!((counts.partial, counts.approximate), (0, 0));
}

#[test]
fn with_threshold_0_whole_roots_follow_each_other_and_with_infinity_children_are_free() {
    let model = model_of(vec![texture(3000, 1, 3)], TreeFit::Circular, 0.13, -1.0);
    let (picks, _) = synthesised(&model, &Arc::default(), &free(), 30, 1);
    let roots = model.tree.roots() as u32;
    for (n, root) in picks[0].iter().enumerate() {
        assert_eq!(*root, (picks[0][0] + n as u32) % roots);
        let leaves = &picks[6][n << 6..(n + 1) << 6];
        assert!(leaves.iter().enumerate().all(|(k, leaf)| *leaf == (root << 6) + k as u32));
    }
    let model = model_of(vec![texture(3000, 1, 3)], TreeFit::Circular, 0.13, 1e9);
    let rules = SynthesisRules { predecessors: 0, root_predecessors: 0, candidates: usize::MAX, ..free() };
    let (picks, _) = synthesised(&model, &Arc::default(), &rules, 200, 1);
    // Each of the nodes of a level is as likely as any other.
    let nodes = model.tree.nodes(3);
    let mut found = vec![0_u32; nodes];
    picks[3].iter().for_each(|m| found[*m as usize] += 1);
    let expected = picks[3].len() as f64 / nodes as f64;
    let chi: f64 = found.iter().map(|n| (f64::from(*n) - expected).powi(2) / expected).sum();
    // Pairs of siblings are drawn together, which doubles the variance.
    assert!(chi < 2.0 * (nodes as f64 + 4.0 * (2.0 * nodes as f64).sqrt()), "{chi} of {nodes}");
}

#[test]
fn values_are_those_of_the_model_and_siblings_stay_together() {
    let model = model_of(vec![texture(3000, 2, 5)], TreeFit::Circular, 0.13, 0.25);
    let random = Random::new(2, "texture");
    let mut s = Synthesizer::new(Arc::clone(&model), Arc::default(), free(), random, -3, None);
    for root in -3..5 {
        s.advance(None);
        assert_eq!((s.next, s.leaves().len()), (root + 1, 64));
        for level in 0..7 {
            let picks = &s.layers[0].tree.levels[level].picks[s.layers[0].tree.history..];
            for (node, pick) in picks.iter().enumerate() {
                assert_eq!(&s.details(level)[2 * node..2 * node + 2], source_value(&model, level, *pick));
                assert!(level == 0 || *pick % 2 == node as u32 % 2 && picks[node ^ 1] == pick ^ 1);
            }
        }
    }
}

#[test]
fn seeds_differ_and_one_seed_does_not() {
    let model = model_of(vec![texture(3000, 1, 3)], TreeFit::Circular, 0.13, 0.25);
    let of = |seed| synthesised(&model, &Arc::default(), &SynthesisRules::default(), 10, seed).0;
    assert!(of(1) == of(1) && of(1) != of(2));
}

#[test]
fn hard_constraints_hold_whatever_the_score() {
    let mut rng = Rng::new(8);
    for seed in 0..20 {
        let model = model_of(
            vec![texture(2000, 1, seed), texture(1500, 1, seed + 50)],
            TreeFit::Circular,
            0.13,
            0.25,
        );
        let (from, a, b) = (rng.between(0.2, 0.8), rng.between(0.0, 1.2), rng.between(0.0, 0.7));
        let score = format!(
            "sources: [(name: \"a\", segments: [({a}, {})]), (name: \"b\", segments: [({b}, {})], recording: \"1.wav\")],
             targets: [(source: \"a\", from: {from}, to: {}), (source: \"b\", from: 1.2, to: 1.9, weight: -1)]",
            a + 0.3,
            b + 0.4,
            from + 0.4
        );
        let directed = constraints(&model, &score);
        let rules = SynthesisRules { look_ahead: 0.05, ..SynthesisRules::default() };
        let (picks, _) = synthesised(&model, &directed, &rules, 16, seed);
        let leaves = &picks[6];
        let sets = &directed.sets;
        for (n, leaf) in leaves.iter().enumerate() {
            // The span of the parent of the leaf.
            let (start, end) = ((n / 2 * 4) as f64 / RATE, (n / 2 * 4 + 4) as f64 / RATE);
            if start >= from && end <= from + 0.4 {
                let near = [leaf.saturating_sub(1), *leaf, leaf + 1];
                assert!(near.iter().any(|m| sets[0].included[6].contains(*m)), "seed {seed} leaf {n}");
            }
            if start >= 1.2 && end <= 1.9 {
                assert!(!sets[1].included[6].contains(*leaf), "seed {seed} leaf {n}");
            }
        }
    }
}

/// The share of the leaves between two times that are of the first set.
fn share(picks: &[Vec<u32>], directed: &Constraints, from: f64, to: f64) -> f64 {
    let leaves = &picks[6][(from * RATE / 2.0) as usize..(to * RATE / 2.0) as usize];
    let found = leaves.iter().filter(|leaf| directed.sets[0].included[6].contains(**leaf)).count();
    found as f64 / leaves.len() as f64
}

#[test]
fn more_weight_means_more_of_a_sound() {
    let model = model_of(vec![texture(8000, 1, 3)], TreeFit::Circular, 0.13, 0.25);
    let mut shares = Vec::new();
    for weight in [-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9, 1.0] {
        let score = format!(
            "sources: [(name: \"a\", segments: [(2, 5)])], targets: [(source: \"a\", from: 0, to: 40, weight: {weight:?})]"
        );
        let directed = constraints(&model, &score);
        let (picks, _) = synthesised(
            &model,
            &directed,
            &SynthesisRules { look_ahead: 0.0, ..SynthesisRules::default() },
            300,
            7,
        );
        shares.push(share(&picks, &directed, 1.0, 37.0));
    }
    assert!(shares.windows(2).all(|pair| pair[1] >= pair[0] - 0.03), "{shares:?}");
    assert!(shares[0] == 0.0 && shares[7] == 1.0, "{shares:?}");
}

#[test]
fn sounds_that_were_chosen_lately_are_chosen_less() {
    let model = model_of(vec![texture(4000, 1, 3)], TreeFit::Circular, 0.13, 0.4);
    let returns = |repetition: f64| {
        let rules = SynthesisRules { repetition, memory: 2.0, ..free() };
        let (picks, _) = synthesised(&model, &Arc::default(), &rules, 200, 4);
        // Nodes of a middle level that return within a second.
        let level = &picks[4];
        (128..level.len()).filter(|n| level[n - 128..*n].contains(&level[*n])).count()
    };
    let (without, with) = (returns(1.0), returns(0.1));
    assert!(2 * with < without, "{with} {without}");
}

#[test]
fn silence_and_one_value_are_synthesised_too() {
    for (x, y) in [(0.0, 0.0), (0.5, 0.5), (0.0, 0.4)] {
        let samples: Vec<f32> = (0..3000).map(|k| if k < 1500 { x } else { y }).collect();
        let model = model_of(vec![vec![samples]], TreeFit::Circular, 0.13, 0.25);
        let (_, counts) = synthesised(&model, &Arc::default(), &SynthesisRules::default(), 10, 1);
        assert!(counts.steps == 640 && counts.candidates < 2000, "{counts:?}");
    }
}

#[test]
fn a_texture_follows_another_one_with_more_or_less_history() {
    let model = model_of(vec![texture(4000, 2, 3)], TreeFit::Circular, 0.13, 0.25);
    let with = |predecessors: usize| {
        let rules = SynthesisRules { predecessors, root_predecessors: 3, ..free() };
        Synthesizer::new(Arc::clone(&model), Arc::default(), rules, Random::new(1, "texture"), 0, None)
    };
    let mut old = with(5);
    (0..9).for_each(|_| old.advance(None));
    // With the same rules the same follows.
    let mut same = with(5);
    same.follow(&old);
    let mut on = old.clone();
    on.advance(None);
    same.advance(None);
    assert_eq!((same.leaves(), same.next), (on.leaves(), on.next));
    for predecessors in [1, 64] {
        let mut other = with(predecessors);
        other.follow(&old);
        assert_eq!(other.leaves(), old.leaves());
        (0..9).for_each(|_| other.advance(None));
        assert_eq!(other.next, 18);
    }
}
