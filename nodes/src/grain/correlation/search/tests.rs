use super::*;
use crate::core::computation::NotStored;
use crate::core::random::Rng;
use crate::grain::dictionary::{ExtractRules, extract};
use crate::grain::recording::SourceKind;

fn noise(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut last = 0.0;
    (0..n)
        .map(|_| {
            last = 0.7 * last + rng.between(-0.3, 0.3);
            last as f32
        })
        .collect()
}

fn recordings(sounds: Vec<Vec<f32>>) -> GrainRecordings {
    let recording = |(k, x): (usize, Vec<f32>)| GrainRecording {
        name: format!("{k}.wav"),
        kind: SourceKind::Impulsive,
        parts: vec![Part { component: Component::Whole, channels: vec![x] }],
        ..GrainRecording::default()
    };
    GrainRecordings { rate: 44_100.0, recordings: sounds.into_iter().enumerate().map(recording).collect() }
}

fn exact_rules() -> ExtractRules {
    ExtractRules { bits: 0, ..ExtractRules::at_rate(44_100.0) }
}

/// All peaks of all grains by the definition, with the greedy choice, and the best of each slot.
fn brute_force(
    x: &[f32],
    dictionary: &GrainDictionary,
    slots: &Slots,
    rules: &CorrelateRules,
) -> Vec<(u32, u32)> {
    let normaliser = Normaliser::new(x, rules.floor, rules.global);
    let mut all: Vec<(usize, f64, u32, u32)> = Vec::new();
    for (k, grain) in dictionary.grains.iter().enumerate() {
        let g = dictionary.windowed(grain);
        let norm = g.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        if g.len() > x.len() {
            continue;
        }
        let c: Vec<f64> = (0..=x.len() - g.len())
            .map(|t| {
                let dot: f64 = x[t..].iter().zip(&g).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                let c = normaliser.norm(t, g.len()).map_or(0.0, |n| dot / (n * norm));
                if rules.absolute { c.abs() } else { c }
            })
            .collect();
        let is_maximum = |t: usize| (t == 0 || c[t] > c[t - 1]) && (t + 1 == c.len() || c[t] >= c[t + 1]);
        let mut maxima: Vec<usize> = (0..c.len()).filter(|t| c[*t] >= rules.min && is_maximum(*t)).collect();
        maxima.sort_by(|a, b| c[*b].total_cmp(&c[*a]).then(a.cmp(b)));
        let mut taken: Vec<usize> = Vec::new();
        for t in maxima {
            if taken.iter().all(|u| u.abs_diff(t) > g.len() / 2) {
                taken.push(t);
                all.push((slots.slot(t), c[t], k as u32, t as u32));
            }
        }
    }
    all.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)).then(a.3.cmp(&b.3)));
    let best = all.chunk_by(|a, b| a.0 == b.0).flat_map(|slot| slot.iter().take(slots.per_slot));
    let mut peaks: Vec<(u32, u32)> = best.map(|p| (p.3, p.2)).collect();
    peaks.sort_unstable();
    peaks
}

#[test]
fn retained_peaks_are_those_of_the_definition() {
    let mut loud_and_quiet = noise(9000, 3);
    loud_and_quiet[4000..].iter_mut().for_each(|x| *x *= 0.002);
    let all = recordings(vec![noise(6000, 1), noise(5000, 2), loud_and_quiet, vec![0.2; 100]]);
    let (dictionary, _) = extract(&all, &exact_rules());
    for rules in [
        CorrelateRules::default(),
        CorrelateRules { retain: Retention::PerInterval(1), absolute: true, ..CorrelateRules::default() },
        CorrelateRules { retain: Retention::Largest(25), ..CorrelateRules::default() },
    ] {
        let found = correlate(&all, &dictionary, &rules, &|_| false, &NotStored).unwrap();
        for (pattern, recording) in found.patterns.iter().zip(&all.recordings) {
            let x = recording.parts[0].mono();
            let slots = match rules.retain {
                Retention::PerInterval(m) => {
                    let tapers: f64 =
                        dictionary.grains.iter().map(|g| f64::from(g.taper[0] + g.taper[1])).sum();
                    let lengths: f64 = dictionary.grains.iter().map(|g| g.window_len() as f64).sum();
                    Slots::new(x.len(), dictionary.mean_len() * (1.0 - 0.5 * tapers / lengths), m)
                }
                Retention::Largest(k) => Slots::new(x.len(), f64::MAX, k),
            };
            let want = brute_force(&x, &dictionary, &slots, &rules);
            let mut got: Vec<(u32, u32)> = pattern.peaks.iter().map(|p| (p.t, p.grain)).collect();
            got.sort_unstable();
            assert_eq!(got, want, "{} {rules:?}", pattern.name);
        }
        found.validate(&dictionary).unwrap();
    }
}

#[test]
fn a_grain_is_found_at_its_origin_and_where_it_was_planted_at_any_gain() {
    let source = noise(8000, 5);
    let (dictionary, _) = extract(&recordings(vec![source.clone()]), &exact_rules());
    let grain = dictionary.grains[1];
    let g = dictionary.windowed(&grain);
    for gain in [0.01_f32, 1.0, 10.0] {
        let mut x: Vec<f32> = noise(6000, 6).iter().map(|x| 0.01 * gain * x).collect();
        x[2500..2500 + g.len()].iter_mut().zip(&g).for_each(|(x, g)| *x += gain * g);
        let found =
            correlate(&recordings(vec![x]), &dictionary, &CorrelateRules::default(), &|_| false, &NotStored)
                .unwrap();
        let peak = found.patterns[0].peaks.iter().find(|p| p.grain == 1 && p.t == 2500).copied();
        let peak = peak.expect("the planted grain is a peak");
        assert!(peak.correlation > 0.99 && (peak.gain / gain - 1.0).abs() < 0.02, "{peak:?}");
    }
    let own =
        correlate(&recordings(vec![source]), &dictionary, &CorrelateRules::default(), &|_| false, &NotStored)
            .unwrap();
    for (k, grain) in dictionary.grains.iter().enumerate() {
        let at = grain.window_start() as u32;
        let peak = own.patterns[0].peaks.iter().find(|p| p.grain == k as u32 && p.t == at).copied();
        let peak = peak.expect("each grain is found at its origin");
        assert!(peak.correlation > 0.985 && (peak.gain - 1.0).abs() < 1e-3, "{peak:?}");
    }
}

#[test]
fn pruning_changes_nothing() {
    // Sounds of other frequencies, so that most transforms are left out; some are loud and some soft.
    let tone = |k: u64| {
        let mut rng = Rng::new(20 + k);
        let w = 0.05 * 2_f64.powf(0.8 * k as f64);
        let sample = |t: usize| {
            let level =
                (-((t % 4000) as f64) / (500.0 + 200.0 * k as f64)).exp() * if t > 9000 { 0.01 } else { 1.0 };
            (level * ((w * t as f64).sin() + 0.1 * rng.between(-1.0, 1.0))) as f32
        };
        (0..16_000).map(sample).collect::<Vec<f32>>()
    };
    let all = recordings((0..5).map(tone).chain([noise(12_000, 50), vec![0.0; 3000]]).collect());
    let (dictionary, _) = extract(&all, &exact_rules());
    for rules in [
        CorrelateRules::default(),
        CorrelateRules { global: true, absolute: true, ..CorrelateRules::default() },
        CorrelateRules { retain: Retention::Largest(25), ..CorrelateRules::default() },
    ] {
        let of = |prune| {
            let rules = CorrelateRules { prune, ..rules };
            correlate(&all, &dictionary, &rules, &|_| false, &NotStored).unwrap()
        };
        assert_eq!(of(true), of(false), "{rules:?}");
    }
}

#[test]
fn the_number_of_threads_changes_nothing_and_work_can_be_stopped() {
    let all = recordings(vec![noise(20_000, 7), noise(9000, 8)]);
    let (dictionary, _) = extract(&all, &exact_rules());
    let rules = CorrelateRules::default();
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| correlate(&all, &dictionary, &rules, &|_| false, &NotStored).unwrap())
    };
    assert_eq!(of(1), of(3));
    let unpruned = CorrelateRules { prune: false, ..rules };
    assert_eq!(of(2), correlate(&all, &dictionary, &unpruned, &|_| false, &NotStored).unwrap());
    assert!(correlate(&all, &dictionary, &rules, &|_| true, &NotStored).is_none());
    assert!(memory(&dictionary, 20_000, 2) > 0);
}

/// Partial results in memory.
#[derive(Default)]
struct InMemory(std::sync::Mutex<Option<Vec<u8>>>);

impl crate::core::computation::Partial for InMemory {
    fn load(&self) -> Option<Vec<u8>> {
        self.0.lock().unwrap().clone()
    }

    fn offer(&self, encode: &dyn Fn() -> Option<Vec<u8>>) {
        *self.0.lock().unwrap() = encode();
    }
}

#[test]
fn a_stopped_correlation_goes_on_where_it_was() {
    let all = recordings((0..4).map(|k| noise(6000, 30 + k)).collect());
    let (dictionary, _) = extract(&all, &exact_rules());
    let rules = CorrelateRules::default();
    let whole = correlate(&all, &dictionary, &rules, &|_| false, &NotStored).unwrap();
    let partial = InMemory::default();
    assert!(correlate(&all, &dictionary, &rules, &|share| share > 0.6, &partial).is_none());
    let first = std::cell::Cell::new(None);
    let resumed = correlate(
        &all,
        &dictionary,
        &rules,
        &|share| {
            first.set(first.get().or(Some(share)));
            false
        },
        &partial,
    );
    assert_eq!(resumed.unwrap(), whole);
    assert!(first.get().is_some_and(|share| share > 0.5), "{first:?}");
    // What belongs to other recordings, or is damaged, is not used.
    let others = recordings((0..2).map(|k| noise(5000, 60 + k)).collect());
    let found = correlate(&others, &dictionary, &rules, &|_| false, &partial).unwrap();
    assert_eq!(found, correlate(&others, &dictionary, &rules, &|_| false, &NotStored).unwrap());
    partial.offer(&|| Some(b"nothing".to_vec()));
    assert_eq!(correlate(&all, &dictionary, &rules, &|_| false, &partial).unwrap(), whole);
}
