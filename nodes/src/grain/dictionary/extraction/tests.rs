use super::*;
use crate::core::random::Rng;
use crate::grain::recording::SourceKind;

fn noise(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    (0..n).map(|i| (rng.between(-0.4, 0.4) * (1.1 + (i as f64 / 700.0).sin())) as f32).collect()
}

fn recordings(channels: Vec<Vec<f32>>) -> GrainRecordings {
    let recording = GrainRecording {
        name: "a.wav".into(),
        kind: SourceKind::Impulsive,
        parts: vec![Part { component: Component::Whole, channels }],
        ..GrainRecording::default()
    };
    GrainRecordings { rate: 44_100.0, recordings: vec![recording] }
}

fn rules() -> ExtractRules {
    ExtractRules { bits: 0, discard: [-300.0, -300.0], ..ExtractRules::at_rate(44_100.0) }
}

#[test]
fn grains_outside_their_cuts_add_up_to_the_recording() {
    let x = noise(20_000, 1);
    let (dictionary, found) = extract(&recordings(vec![x.clone()]), &rules());
    dictionary.validate().unwrap();
    assert_eq!(dictionary.len(), found[0].segments.cuts.len() - 1);
    let mut sum = vec![0.0_f32; x.len()];
    for grain in &dictionary.grains {
        let at = grain.window_start() as usize;
        let windowed = dictionary.windowed(grain);
        sum[at..at + windowed.len()].iter_mut().zip(windowed).for_each(|(y, g)| *y += g);
    }
    assert!(x.iter().zip(&sum).skip(40).take(x.len() - 80).all(|(a, b)| (a - b).abs() < 1e-6));
    // One run holds each sample once.
    assert_eq!((dictionary.runs.len(), dictionary.samples.len()), (1, x.len()));
}

#[test]
fn tapers_inside_their_cuts_have_the_power_of_their_segment() {
    let x = noise(20_000, 2);
    let rules = ExtractRules { placement: TaperPlacement::Inside, ..rules() };
    let (dictionary, _) = extract(&recordings(vec![x.clone()]), &rules);
    for grain in &dictionary.grains {
        assert_eq!((grain.reach, grain.window_len()), ([0, 0], grain.len as usize));
        let of_segment = mean_square(&x[grain.start as usize..(grain.start + u64::from(grain.len)) as usize]);
        assert!((grain.power / of_segment - 1.0).abs() < 1e-5);
        let windowed = mean_square(&dictionary.windowed(grain));
        assert!((windowed / of_segment - 1.0).abs() < 1e-5);
    }
}

#[test]
fn quiet_grains_are_discarded_and_counted() {
    let mut x = noise(30_000, 3);
    x[10_000..20_000].iter_mut().for_each(|y| *y *= 1e-4);
    let plain = ExtractRules { discard: [-50.0, -70.0], ..rules() };
    let (dictionary, found) = extract(&recordings(vec![x.clone()]), &plain);
    let [count, samples] = found[0].discarded;
    assert!(count > 2 && (7000..10_500).contains(&samples), "{count} {samples}");
    assert_eq!(dictionary.len() + count, found[0].segments.cuts.len() - 1);
    assert_eq!(dictionary.runs.len(), 2);
    let (all, found) = extract(&recordings(vec![x]), &rules());
    assert_eq!((found[0].discarded[0], all.runs.len()), (0, 1));
    // Silence has no grain.
    assert!(extract(&recordings(vec![vec![0.0; 5000]]), &rules()).0.validate().is_err());
}

#[test]
fn sixteen_bits_are_enough_for_96_db_of_each_grain() {
    let x = noise(20_000, 4);
    let all = recordings(vec![x.clone(), x.iter().map(|y| 0.3 * y).collect()]);
    let (exact, _) = extract(&all, &rules());
    let (compact, _) = extract(&all, &ExtractRules { bits: 16, ..rules() });
    assert_eq!((exact.bytes() - 48 * exact.len()) / 2, compact.bytes() - 48 * compact.len());
    let (mut signal, mut noise) = (0.0, 0.0);
    for (a, b) in exact.samples.iter().zip(&compact.samples) {
        signal += f64::from(*a).powi(2);
        noise += f64::from(a - b).powi(2);
    }
    assert!(10.0 * (signal / noise).log10() > 85.0);
    // Both channels have one list of cuts.
    assert_eq!(compact.runs[0].channels, 2);
    let again = {
        let mut again = compact.clone();
        again.quantise(16);
        again
    };
    assert!(again.samples.iter().zip(&compact.samples).all(|(a, b)| (a - b).abs() <= 1e-7 * a.abs()));
}

#[test]
fn a_recording_shorter_than_a_grain_is_one_grain() {
    let (dictionary, found) = extract(&recordings(vec![noise(120, 5)]), &rules());
    assert_eq!((dictionary.len(), found[0].segments.cuts.clone()), (1, vec![0, 120]));
    let table = extraction_table(&recordings(vec![noise(120, 5)]), &found, &rules());
    assert_eq!((table.rows.len(), table.charts.len()), (1, 1));
}

#[test]
fn cuts_move_to_zero_crossings_in_reach() {
    let x = noise(20_000, 6);
    let (_, plain) = extract(&recordings(vec![x.clone()]), &rules());
    let (dictionary, snapped) = extract(&recordings(vec![x.clone()]), &ExtractRules { snap: 16, ..rules() });
    dictionary.validate().unwrap();
    let (before, after) = (&plain[0].segments.cuts, &snapped[0].segments.cuts);
    assert_eq!(before.len(), after.len());
    assert!(after.windows(2).all(|w| w[0] < w[1]) && before != after);
    for (from, to) in before.iter().zip(after).skip(1).take(before.len() - 2) {
        assert!(from.abs_diff(*to) <= 16 && (x[to - 1] < 0.0) != (x[*to] < 0.0), "{from} {to}");
        // None is nearer.
        let nearer = (1..from.abs_diff(*to)).flat_map(|d| [from - d, from + d]);
        assert!(nearer.into_iter().all(|t| (x[t - 1] < 0.0) == (x[t] < 0.0)), "{from} {to}");
    }
    // A constant has no crossing: cuts remain.
    let mut cuts = [0, 100, 200];
    snap_to_zero_crossings(&[1.0; 200], &mut cuts, 16);
    assert_eq!(cuts, [0, 100, 200]);
}
