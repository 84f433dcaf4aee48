use super::super::similarity::{norms, similar_pairs};
use super::super::testing::stored;
use super::*;

fn found(dictionary: &GrainDictionary, patterns: &CorrelationPatterns, merge: f64) -> Vec<Substitute> {
    let pairs = similar_pairs(dictionary, 32, &|_| false).unwrap();
    substitutes(&norms(dictionary), &pairs, patterns, merge)
}

#[test]
fn errors_of_substitutes_are_within_their_bound() {
    let (_, dictionary, patterns) = stored(3);
    let norms = norms(&dictionary);
    let mut count = 0;
    for (k, substitute) in found(&dictionary, &patterns, 0.8).iter().enumerate() {
        if substitute.grain as usize == k {
            continue;
        }
        count += 1;
        let [member, leader] =
            [k, substitute.grain as usize].map(|k| dictionary.windowed(&dictionary.grains[k]));
        // Both windows continue with zeros.
        let reach = leader.len() as i64 + i64::from(substitute.lag);
        let error: f64 = (i64::from(substitute.lag).min(0)..reach.max(member.len() as i64))
            .map(|n| {
                let at = |x: &[f32], n: i64| usize::try_from(n).ok().and_then(|n| x.get(n)).copied();
                let played = at(&leader, n - i64::from(substitute.lag)).unwrap_or(0.0);
                f64::from(at(&member, n).unwrap_or(0.0) - substitute.gain * played).powi(2)
            })
            .sum::<f64>()
            .sqrt();
        let c = f64::from(substitute.correlation);
        assert!(c >= 0.8);
        let bound = (1.0 - c * c).max(0.0).sqrt() * norms[k];
        assert!((error - bound).abs() < 1e-3 * norms[k], "{k}: {error} {bound}");
    }
    assert!(count > 3, "{count}");
}

#[test]
fn a_correlation_of_1_merges_scaled_copies_only() {
    let (_, one, _) = stored(1);
    let mut two = one.clone();
    // The second source is the first one at half the level, and inverted.
    let (runs, frames) = (one.runs.len() as u32, one.samples.len() as u64);
    two.sources.extend(one.sources.clone());
    two.samples.extend(one.samples.iter().map(|x| -0.5 * x));
    two.runs.extend(
        one.runs.iter().map(|run| crate::grain::dictionary::Run { offset: run.offset + frames, ..*run }),
    );
    two.grains.extend(one.grains.iter().map(|g| crate::grain::Grain {
        source: 1,
        run: g.run + runs,
        power: 0.25 * g.power,
        ..*g
    }));
    two.quantise(16);
    two.validate().unwrap();
    let patterns = CorrelationPatterns::none(&two);
    let all = found(&two, &patterns, 1.0);
    for (k, substitute) in all.iter().enumerate() {
        let leader = (k % one.len()) as u32;
        assert_eq!((substitute.grain, substitute.lag), (leader, 0));
        let gain = if k < one.len() { 1.0 } else { -0.5 };
        assert!((substitute.gain - gain).abs() < 1e-3, "{substitute:?}");
    }
    let less = merged(&two, &patterns, &all, 220);
    assert_eq!(less.dictionary.len(), one.len());
    // Without copies nothing is merged.
    let none = found(&one, &CorrelationPatterns::none(&one), 1.0);
    assert!(none.iter().enumerate().all(|(k, s)| s.grain as usize == k));
}

#[test]
fn patterns_are_rewritten_and_belong_to_the_smaller_dictionary() {
    let (_, dictionary, patterns) = stored(3);
    let mut last = usize::MAX;
    for merge in [1.0, 0.95, 0.8] {
        let less = merged(&dictionary, &patterns, &found(&dictionary, &patterns, merge), 220);
        less.patterns.validate(&less.dictionary).unwrap();
        less.dictionary.validate().unwrap();
        assert!(less.dictionary.len() <= last);
        last = less.dictionary.len();
        let again = CorrelationPatterns::from_bytes(&less.patterns.to_bytes().unwrap()).unwrap();
        assert_eq!(again, less.patterns);
    }
    assert!(last < dictionary.len());
}
