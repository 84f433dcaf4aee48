use super::*;
use crate::crumple::CrumpleBank;
use crate::crumple::matching::nearest_sample::Nearest;
use crate::crumple::matching::testing::log_normal;
use proptest::prelude::*;

const ALL: [Mapping; 3] = [Mapping::Ecdf, Mapping::Linear20, Mapping::Log20];

#[test]
fn ranks_map_a_set_onto_itself() {
    let energies = log_normal(500, 2.0, 0.0, 1);
    let map = EnergyMap::new(&energies, &energies, Mapping::Ecdf);
    let mut nearest = Nearest::new(&CrumpleBank::testing(&energies));
    for (k, &e) in energies.iter().enumerate() {
        assert_eq!(nearest.pick(map.wanted(map.rank(e)), 1, 0.0), Some(k));
    }
}

/// Kolmogorov's distance of two sorted sets: the maximum difference of their distribution functions.
fn kolmogorov(a: &[f64], b: &[f64]) -> f64 {
    let share = |set: &[f64], x: f64| set.partition_point(|e| *e <= x) as f64 / set.len() as f64;
    a.iter().chain(b).map(|x| (share(a, *x) - share(b, *x)).abs()).fold(0.0, f64::max)
}

#[test]
fn ranks_match_heavy_tails_where_equal_bins_do_not() {
    // A thousand events and two hundred samples, both log-normal of sigma 2. The distance of ranks is half a step of
    // each set, 0.003, as in the specification. That of bins depends on the maximum of the draw, here 0.11 to 0.53 and
    // 0.029 to 0.037. The specification has 0.117 and 0.040 for a draw and a bank that it does not state.
    let (n, m) = (1000, 200);
    let mut all = Vec::new();
    for seed in 0..12 {
        let (events, bank) = (log_normal(n, 2.0, 3.0, 2 * seed), log_normal(m, 2.0, -4.0, 2 * seed + 1));
        let distance = |mapping| {
            let map = EnergyMap::new(&events, &bank, mapping);
            let mut mapped: Vec<f64> = events.iter().map(|e| map.wanted(map.rank(*e))).collect();
            mapped.sort_unstable_by(f64::total_cmp);
            kolmogorov(&mapped, &bank)
        };
        let [ecdf, linear, log] = ALL.map(distance);
        let first = Binned::new(&events, false).rank(events[0] + (events[n - 1] - events[0]) / 20.0);
        println!("first bin {first:.3}, linear {linear:.3}, log {log:.3}, ranks {ecdf:.4}");
        assert!((ecdf - 0.003).abs() < 1e-9, "{ecdf}");
        assert!(
            (0.02..0.05).contains(&log) && (0.09..0.6).contains(&linear) && first > 0.8,
            "{linear} {log} {first}"
        );
        all.push([first, linear, log]);
    }
    let mean = |k: usize| all.iter().map(|x| x[k]).sum::<f64>() / all.len() as f64;
    let range = |k: usize| all.iter().fold([1.0, 0.0_f64], |[low, high], x| [low.min(x[k]), high.max(x[k])]);
    let around = |k: usize, x: f64| range(k)[0] < x && x < range(k)[1];
    let message = format!("{all:?}");
    assert!(
        (mean(0) - 0.94).abs() < 0.03 && (0.15..0.4).contains(&mean(1)) && (mean(2) - 0.03).abs() < 0.01,
        "{message}"
    );
    assert!(around(0, 0.94) && around(1, 0.117), "{message}");
}

proptest! {
    #[test]
    fn matching_is_monotone_and_stays_in_the_bank(
        seed in 0_u64..1000, n in 1_usize..60, m in 1_usize..60, a in -9.0..9.0, b in -9.0..9.0,
    ) {
        let (events, energies) = (log_normal(n, 2.0, 0.0, seed), log_normal(m, 1.0, 2.0, seed + 1));
        let (low, high) = if a < b { (f64::exp(a), f64::exp(b)) } else { (f64::exp(b), f64::exp(a)) };
        for mapping in ALL {
            let map = EnergyMap::new(&events, &energies, mapping);
            let mut nearest = Nearest::new(&CrumpleBank::testing(&energies));
            let mut pick = |e: f64| nearest.pick(map.wanted(map.rank(e)), 1, 0.0).unwrap();
            let (low, high) = (pick(low), pick(high));
            prop_assert!(low <= high && high < m, "{:?} {} {}", mapping, low, high);
        }
    }

    #[test]
    fn ranks_are_invariant_under_increasing_transforms(seed in 0_u64..1000, power in 0.3..3.0, e in -4.0..4.0) {
        let (events, energies) = (log_normal(40, 1.5, 0.0, seed), log_normal(30, 1.0, 2.0, seed + 1));
        let other: Vec<f64> = events.iter().map(|e| 7.0 * e.powf(power)).collect();
        let e = f64::exp(e);
        let map = EnergyMap::new(&events, &energies, Mapping::Ecdf);
        let same = EnergyMap::new(&other, &energies, Mapping::Ecdf);
        prop_assert_eq!(map.wanted(map.rank(e)), same.wanted(same.rank(7.0 * e.powf(power))));
        prop_assert_eq!(map.wanted(map.rank(events[7])), same.wanted(same.rank(other[7])));
    }
}
