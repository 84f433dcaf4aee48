use super::*;
use crate::soundtrack::score::NodeSet;
use crate::soundtrack::score::{WeightStream, read_score};
use crate::soundtrack::wavelet::{TreeFit, TreeRecording, TreeRules};

/// Four seconds at 1000 Hz as eight roots of 512 samples.
fn tree() -> WaveletTree {
    let x: Vec<f32> = (0..4096).map(|k| (0.1 * k as f32).sin()).collect();
    let recording =
        |name: &str| TreeRecording { name: name.into(), content: String::new(), channels: vec![x.clone()] };
    let rules = TreeRules { fit: TreeFit::Trim, block: Some(0.52), ..TreeRules::default() };
    WaveletTree::analyse(1000.0, &[recording("x/a.wav"), recording("b.wav")], &rules).unwrap()
}

fn compiled(sources: &str, targets: &str) -> Result<Constraints, TextError> {
    let text = format!("SoundScore(pad: 0, sources: [{sources}], targets: [\n{targets}\n])");
    Constraints::new(&read_score(&text).unwrap(), &tree(), false)
}

const A: &str = "(name: \"a\", segments: [(0.512, 1.0), (2.0, 2.1)])";
const B: &str = "(name: \"b\", segments: [(0, 0.1)], recording: \"b.wav\")";

#[test]
fn sets_have_the_nodes_of_all_segments_and_their_ancestors() {
    let c =
        compiled(&format!("{A}, {B}"), "(source: \"a\", from: 0, to: 1), (source: \"b\", from: 1, to: 2)")
            .unwrap();
    let [a, b] = &c.sets[..] else { panic!("{:?}", c.sets) };
    assert_eq!(a.included[0], NodeSet::new(vec![(1, 2), (3, 5)]));
    // Leaves have two samples.
    assert_eq!(a.included[8], NodeSet::new(vec![(256, 500), (1000, 1050)]));
    assert_eq!(b.included[8], NodeSet::new(vec![(2048, 2098)]));
    for set in [a, b] {
        for level in 1..9 {
            assert!(set.included[level].iter().all(|m| set.included[level - 1].contains(m / 2)), "{level}");
        }
    }
    // Of 2.0 to 2.1 s the centres of roots 3 and 4 are outside: that of its middle counts.
    assert_eq!(a.centred[0], NodeSet::new(vec![(1, 2), (4, 5)]));
    assert_eq!(a.centred[8], a.included[8]);
    assert_eq!(b.centred[0], NodeSet::new(vec![(8, 9)]));
    assert!(a.included[0].contains(4) && !a.included[0].contains(2) && !a.included[0].contains(5));
    assert_eq!((a.included[8].len(), a.included[8].iter().count()), (294, 294));
}

#[test]
fn the_greatest_weight_counts_and_hard_ones_need_the_whole_span() {
    let targets = "(source: \"a\", curve: [(1, 0), (2, 1), (3, 1), (4, 0)]), (source: \"b\", from: 2, to: 5, weight: -0.6),
        (source: \"b\", from: 6, to: 7, weight: -1)";
    let c = compiled(&format!("{A}, {B}"), targets).unwrap();
    let at = |from, to| {
        let mut out = Vec::new();
        let found = c.at(from, to, Some(&mut out));
        (found.greatest().map(|c| (c.set, (c.weight * 1e6).round() / 1e6, c.is_hard)), out)
    };
    assert_eq!(at(0.0, 1.0), (None, vec![]));
    assert_eq!(at(1.0, 1.5), (Some((0, 0.25, false)), vec![]));
    assert_eq!(at(2.0, 3.0), (Some((0, 1.0, true)), vec![]));
    assert_eq!(at(2.5, 3.5), (Some((0, 0.875, false)), vec![]));
    assert_eq!(at(3.5, 4.0), (Some((1, -0.6, false)), vec![]));
    assert_eq!(at(5.5, 6.5), (Some((1, -0.5, false)), vec![]));
    assert_eq!(at(6.0, 6.5), (None, vec![1]));
    assert_eq!(at(7.0, 8.0), (None, vec![]));
    // Without a list of those, an exclusion counts as any other.
    assert_eq!(c.at(6.0, 6.5, None).greatest().map(|c| c.weight), Some(-SOFT));
}

#[test]
fn streams_of_weights_are_averaged_over_the_span() {
    let items = [0.0, 1.0, 0.5, -1.0, 1.0, -1.0, f32::NAN, -1.0];
    let stream = WeightStream { rate: 10.0, first: 0, width: 2, items: &items };
    let at = |from, to| {
        let mut out = Vec::new();
        let mut found = Overlap::default();
        stream.add(from, to, &mut found, Some(&mut out));
        (found.greatest().map(|c| (c.set, (c.weight * 1e6).round() / 1e6, c.is_hard)), out)
    };
    assert_eq!(at(0.0, 0.1), (Some((1, 1.0, true)), vec![]));
    assert_eq!(at(0.1, 0.3), (Some((0, 0.75, false)), vec![1]));
    assert_eq!(at(0.2, 0.25), (Some((0, 1.0, true)), vec![1]));
    assert_eq!(at(0.05, 0.15), (Some((0, 0.25, false)), vec![]));
    assert_eq!(at(0.3, 9.0), (None, vec![1]));
}

#[test]
fn outside_of_its_targets_a_sound_can_be_excluded() {
    let c = compiled(
        "(name: \"a\", segments: [(1, 2)], outside: Exclude)",
        "(source: \"a\", from: 1, to: 2, weight: 0.5)",
    );
    let c = c.unwrap();
    let forbidden = |from, to| {
        let mut out = Vec::new();
        let _ = c.at(from, to, Some(&mut out));
        out
    };
    assert_eq!(
        (forbidden(0.0, 1.0), forbidden(1.0, 2.0), forbidden(500.0, 501.0)),
        (vec![0], vec![], vec![0])
    );
}

#[test]
fn ramps_fill_the_time_that_is_free() {
    let text = "SoundScore(pad: 0.1, sources: [(name: \"a\", segments: [(1, 2)])], targets: [(source: \"a\", from: 1, to: 2),
        (source: \"a\", from: 2.05, to: 3), (source: \"a\", from: 4, to: 5, weight: 0.5)])";
    let c = Constraints::new(&read_score(text).unwrap(), &tree(), false).unwrap();
    let ends: Vec<(f64, f64)> = c.targets.iter().map(|t| (t.from, (t.to * 1e6).round() / 1e6)).collect();
    assert_eq!(ends, [(0.9, 2.05), (2.0, 3.1), (4.0, 5.0)]);
    let mean = c.at(0.9, 1.0, None).greatest().unwrap().weight;
    assert!((mean - SOFT / 2.0).abs() < 1e-9, "{mean}");
    assert!(
        c.at(0.99, 1.0, None).greatest().unwrap().weight > 0.95
            && c.at(0.9, 0.91, None).greatest().unwrap().weight < 0.05
    );
    // An exclusion has a ramp of its own sign.
    let text = text.replace("to: 2)", "to: 2, weight: -1)");
    let c = Constraints::new(&read_score(&text).unwrap(), &tree(), false).unwrap();
    assert!(c.at(0.99, 1.0, None).greatest().unwrap().weight < -0.95);
}

#[test]
fn contradictions_and_the_impossible_have_a_location() {
    let c =
        "(name: \"c\", segments: [(0, 4.096)]), (name: \"d\", segments: [(0, 4.096)], recording: \"b.wav\")";
    for (sources, targets, location, part) in [
        ("(name: \"a\", segments: [(4, 4.2)])", "", "1:30", "\"x/a.wav\" ends at 4.096 s"),
        ("(name: \"a\", segments: [(1, 1.002)])", "", "1:30", "2.0 samples long"),
        (
            "(name: \"a\", segments: [(1, 2)], recording: \"c.wav\")",
            "",
            "1:30",
            "recordings are x/a.wav, b.wav",
        ),
        (
            A,
            "(source: \"a\", from: 0, to: 1),\n(source: \"a\", from: 0.5, to: 2, weight: -1)",
            "2:1",
            "excluded by a",
        ),
        (
            &format!("{A}, {B}"),
            "(source: \"a\", from: 0, to: 1),\n(source: \"b\", from: 0.5, to: 2)",
            "3:1",
            "b has the weight 1 from 0.5 s to 1 s, where a has it too (2:1)",
        ),
        (
            c,
            "(source: \"c\", from: 0, to: 2, weight: -1),\n(source: \"d\", from: 1, to: 3, weight: -1)",
            "3:1",
            "impossible from 1 s to 2 s: c and d",
        ),
    ] {
        let e = compiled(sources, targets).unwrap_err();
        assert!(e.location.to_string() == location && e.message.contains(part), "{targets}: {e}");
    }
    // One after the other is no contradiction.
    let after = "(source: \"a\", from: 0, to: 1), (source: \"b\", from: 1, to: 2), (source: \"a\", from: 1, to: 2, weight: -1)";
    assert!(compiled(&format!("{A}, {B}"), after).is_ok());
}

#[test]
fn what_is_excluded_outside_of_its_targets_can_leave_nothing() {
    let error = |text: &str| {
        let score = read_score(&format!("SoundScore(sources: [\n{text})")).unwrap();
        Constraints::new(&score, &tree(), false).unwrap_err()
    };
    // Both recordings are a sound each, and both are excluded but for a second.
    let all = "(name: \"a\", segments: [(0, 4.096)], outside: Exclude),
        (name: \"b\", segments: [(0, 4.096)], recording: \"b.wav\", outside: Exclude)],
        targets: [(source: \"a\", from: 0, to: 1, weight: 0.5)]";
    let e = error(all).to_string();
    assert!(e.starts_with("2:1: impossible from 1 s on: a and b are excluded"), "{e}");
    // A sound that is excluded where a part of it is a hard inclusion under another name.
    let part = "(name: \"a\", segments: [(1, 2)], outside: Exclude),
        (name: \"b\", segments: [(1.2, 1.8)])],
        targets: [(source: \"b\", from: 3, to: 4)]";
    let e = error(part).to_string();
    assert!(e.contains("impossible from 3 s to 4 s: b has the weight 1, and is excluded by a"), "{e}");
}

#[test]
fn many_sounds_and_targets_are_found_in_time() {
    let sources: Vec<String> =
        (0..3000).map(|k| format!("(name: \"s{k}\", segments: [({0}, {0}.05)])", k % 4)).collect();
    let targets: Vec<String> =
        (0..3000).map(|k| format!("(source: \"s{}\", from: {k}, to: {})", 2999 - k, k + 1)).collect();
    let c = compiled(&sources.join(","), &targets.join(",")).unwrap();
    assert_eq!((c.sets.len(), c.at(7.2, 7.3, None).greatest().map(|c| c.set)), (3000, Some(2992)));
}

#[test]
fn overlaps_are_the_two_greatest_inclusions_of_different_sets_in_layers_of_their_own() {
    let sources = format!("{A}, {B}, (name: \"c\", segments: [(3, 3.5)])");
    let targets = "(source: \"a\", curve: [(0, 1), (1, 1), (2, 0)]), (source: \"b\", curve: [(1, 0), (2, 1), (3, 1), (4, 0)]),
        (source: \"c\", curve: [(3, 0), (4, 1), (5, 1)]), (source: \"a\", from: 4.2, to: 5, weight: 0.2),
        (source: \"b\", from: 4.2, to: 5, weight: -0.5)";
    let text = format!("SoundScore(pad: 0, sources: [{sources}], targets: [{targets}])");
    let c = Constraints::new(&read_score(&text).unwrap(), &tree(), true).unwrap();
    let at = |from, to| {
        let both = c.at(from, to, None).both();
        both.map(|[a, b]| {
            (a.set, (100.0 * a.weight).round(), a.layer, b.set, (100.0 * b.weight).round(), b.layer)
        })
    };
    assert_eq!(at(0.0, 1.0), None);
    assert_eq!(at(1.2, 1.3), Some((0, 75.0, 0, 1, 25.0, 1)));
    assert_eq!(at(1.7, 1.8), Some((1, 75.0, 1, 0, 25.0, 0)));
    assert_eq!(at(3.2, 3.3), Some((1, 75.0, 1, 2, 25.0, 0)));
    assert_eq!(at(4.5, 4.6), Some((2, 100.0, 0, 0, 20.0, 1)));
    // Two hard ones may overlap where they morph, and an exclusion of one of them is a contradiction as before.
    let hard = "(source: \"a\", from: 0, to: 1), (source: \"b\", from: 0, to: 1)";
    let new = |targets: &str, morphs| {
        let text = format!("SoundScore(sources: [{sources}], targets: [{targets}])");
        Constraints::new(&read_score(&text).unwrap(), &tree(), morphs)
    };
    assert!(new(hard, true).is_ok() && new(hard, false).is_err());
    assert!(new(&format!("{hard}, (source: \"b\", from: 0, to: 1, weight: -1)"), true).is_err());
    let mut overlap = Overlap::default();
    for (set, weight) in [(0, 0.5), (1, -0.8), (2, 0.3), (0, 0.9), (2, 0.95), (0, 0.1), (3, 0.9)] {
        overlap.add(Constraint { set, weight, is_hard: false, layer: 0 });
    }
    let [a, b] = overlap.both().unwrap();
    assert_eq!((a.set, a.weight, b.set, b.weight), (2, 0.95, 0, 0.9));
}
