use super::*;
use crate::core::random::Rng;

fn rules() -> SegmentRules {
    SegmentRules::at_rate(44_100.0)
}

#[test]
fn smoothing_equals_scipy() {
    // scipy.ndimage.gaussian_filter1d([0, 0, 0, 1, 0, 0, 0, 0, 0, 2], 2, mode='reflect').
    let x = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0];
    let want = [
        0.09175589, 0.12988563, 0.17925825, 0.20521562, 0.19806321, 0.19250801, 0.24827173, 0.39849081,
        0.60287772, 0.75367313,
    ];
    let got = smooth(&x, 2.0);
    assert!(got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-8), "{got:?}");
}

#[test]
fn a_gaussian_bump_is_cut_at_the_joint_standard_deviation() {
    let (centre, width, sigma) = (60.0, 6.0_f64, 2.0_f64);
    let bump: Vec<f64> = (0..121).map(|k| (-0.5 * ((k as f64 - centre) / width).powi(2)).exp()).collect();
    let found = inflections(&smooth(&bump, sigma));
    let offset = (width * width + sigma * sigma).sqrt();
    let near: Vec<f64> = found.iter().map(|i| i.position).filter(|p| (p - centre).abs() < 12.0).collect();
    assert_eq!(near.len(), 2, "{found:?}");
    assert!((near[0] - centre + offset).abs() < 0.05 && (near[1] - centre - offset).abs() < 0.05, "{near:?}");
    assert!(found.iter().any(|i| i.rising && (i.position - near[0]).abs() < 1e-9));
}

#[test]
fn a_constant_or_linear_flux_is_cut_by_the_longest_length_only() {
    for slope in [0.0, 0.001] {
        let s: Vec<f64> = (0..400).map(|k| 0.1 + slope * k as f64).collect();
        let cuts = cuts(&s, 400 * 128, &rules());
        let lengths: Vec<usize> = cuts.windows(2).map(|w| w[1] - w[0]).collect();
        // Cuts nearest the middle halve each segment.
        assert!(lengths.iter().all(|n| (1400..=3000).contains(n)), "{lengths:?}");
    }
}

#[test]
fn segments_partition_and_keep_to_the_lengths() {
    let mut rng = Rng::new(7);
    for trial in 0..1000 {
        let len = 1 + rng.below(20_000);
        let min = 2 + rng.below(600);
        let rules = SegmentRules { min, max: 2 * min + rng.below(4000), ..rules() };
        let roughness = rng.uniform();
        let s: Vec<f64> = (0..len / 128 + 1)
            .map(|k| 0.5 + roughness * rng.uniform() + 0.2 * (k as f64 * 0.1).sin())
            .collect();
        let s = if trial % 2 == 0 { smooth(&s, 2.0) } else { s };
        let cuts = cuts(&s, len, &rules);
        assert_eq!((cuts[0], *cuts.last().unwrap()), (0, len));
        for pair in cuts.windows(2) {
            assert!(pair[0] < pair[1]);
            let n = pair[1] - pair[0];
            assert!(n <= rules.max && (n >= rules.min || len < rules.min), "{cuts:?} {rules:?}");
        }
    }
}

#[test]
fn short_segments_lose_the_cut_at_the_smaller_slope() {
    // Segments of 100, 10, 90: the cut at 110 has the smaller slope.
    assert_eq!(join_short(200, &[(100, 0.5), (110, 0.2)], 20), [100]);
    // Equal slopes: the later one.
    assert_eq!(join_short(200, &[(100, 0.5), (110, 0.5)], 20), [100]);
    assert_eq!(join_short(200, &[(100, 0.1), (110, 0.5)], 20), [110]);
    assert!(join_short(15, &[(5, 1.0), (10, 1.0)], 20).is_empty());
}

#[test]
fn attacks_are_onsets_and_cuts() {
    let mut rng = Rng::new(3);
    let mut x = vec![0.0_f32; 44_100];
    let times = [4000, 15_000, 22_050, 35_000];
    for (k, t) in times.iter().enumerate() {
        for (i, y) in x[*t..].iter_mut().take(9000).enumerate() {
            *y += (0.5
                * (-(i as f64) / 1500.0).exp()
                * (rng.between(-0.3, 0.3) + (0.1 * (k + 1) as f64 * i as f64).sin()))
                as f32;
        }
    }
    for y in &mut x {
        *y += rng.between(-1e-4, 1e-4) as f32;
    }
    let found = segment(&x, &rules());
    let near = |list: &[usize], t: usize| list.iter().any(|o| o.abs_diff(t) < 1102);
    assert!(times.iter().all(|t| near(&found.onsets, *t)), "{:?}", found.onsets);
    assert!(times.iter().all(|t| near(&found.cuts, *t)));
    // The same at any gain.
    let quiet: Vec<f32> = x.iter().map(|x| x / 4.0).collect();
    assert_eq!(segment(&quiet, &rules()), found);
}
