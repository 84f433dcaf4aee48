use super::*;
use crate::core::random::Random;
use proptest::prelude::*;

const FS: f64 = 48_000.0;

/// Decaying bursts of noise at these times in seconds, with these levels, on a floor 60 dB down.
fn bursts(at: &[(f64, f64)], seconds: f64) -> Vec<f32> {
    let random = Random::new(3, "bursts");
    let n = (seconds * FS) as usize;
    let noise = |k: usize| 2.0 * random.uniform(0, k as u64, 0) - 1.0;
    let level = |k: usize| {
        let t = k as f64 / FS;
        let burst =
            |&(start, level): &(f64, f64)| if t < start { 0.0 } else { level * (-(t - start) / 0.01).exp() };
        1e-4 + at.iter().map(burst).sum::<f64>()
    };
    (0..n).map(|k| (level(k) * noise(k)) as f32).collect()
}

#[test]
fn the_window_equals_that_of_scipy() {
    // scipy.ndimage.uniform_filter1d(x**2, W, mode="constant") * W for x = 1..6 and W = 4, then W = 3
    let x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    assert_eq!(windowed_energy(&x, 4), [5.0, 14.0, 30.0, 54.0, 86.0, 77.0]);
    assert_eq!(windowed_energy(&x, 3), [5.0, 14.0, 29.0, 50.0, 77.0, 61.0]);
    assert_eq!(windowed_energy(&x, 1)[3], 16.0);
}

#[test]
fn the_energy_of_a_soft_sound_after_a_long_loud_one_is_exact() {
    // Twenty seconds at full scale, then a sound 60 dB below: sums in single precision would round it away, and after 6
    // minutes at 48 kHz would not grow any more. In double precision a window is right to 2^-52 of the sum before it.
    let n = 20 * 48_000;
    let x: Vec<f32> =
        (0..n + 4800).map(|k| if k < n { 1.0 } else { 1e-3 } * if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let energy = windowed_energy(&x, 960);
    let wanted = 960.0 * f64::from(1e-3_f32).powi(2);
    for found in &energy[n + 960..n + 3840] {
        assert!((found / wanted - 1.0).abs() < 2e-4, "{found} for {wanted}");
    }
    let single = x[..n + 960].iter().map(|x| x * x).sum::<f32>();
    assert_eq!(single + 1e-6, single, "a sum in single precision does not see it");
    assert_eq!(energy[n / 2], 960.0);
}

#[test]
fn separate_bursts_are_samples_that_begin_and_end_where_the_sign_changes() {
    let times: Vec<(f64, f64)> =
        (0..12).map(|k| (0.1 + 0.2 * f64::from(k), 0.1 * 1.25_f64.powi(k))).collect();
    let x = bursts(&times, 2.6);
    let params = Extraction { threshold: 1e-5, ..Extraction::default() };
    let found = extents(&x, FS, &params);
    assert_eq!(found.len(), 12);
    let square = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    for (extent, (start, _)) in found.iter().zip(&times) {
        assert_eq!(extent.fades, [false; 2]);
        for n in [extent.start, extent.end] {
            assert!(x[n - 1] * x[n] <= 0.0);
        }
        let from = (start * FS) as usize;
        let whole = square(&x[from - 2000..from + 7000]);
        let taken = square(&cut(&x, FS, extent));
        assert!((taken / whole - 1.0).abs() < 0.01, "{taken} {whole}");
    }
}

#[test]
fn twice_as_loud_with_four_times_the_threshold_is_the_same() {
    let x = bursts(&[(0.1, 0.1), (0.13, 0.2), (0.4, 0.05)], 0.7);
    let loud: Vec<f32> = x.iter().map(|x| 2.0 * x).collect();
    let params = Extraction { threshold: 1e-4, ..Extraction::default() };
    let found = extents(&x, FS, &params);
    assert!(!found.is_empty());
    assert_eq!(found, extents(&loud, FS, &Extraction { threshold: 4e-4, ..params }));
}

#[test]
fn an_end_without_a_zero_crossing_is_faded() {
    // A slow swell that never comes to 0 for 50 ms around the threshold.
    let x: Vec<f32> =
        (0..4800).map(|n| 0.02 + 0.3 * (-((n as f32 - 2400.0) / 400.0).powi(2)).exp()).collect();
    let params = Extraction { threshold: 4e-3, window: 0.005, ..Extraction::default() };
    let found = extents(&x, FS, &params);
    assert_eq!((found.len(), found[0].fades), (1, [true; 2]));
    let samples = cut(&x, FS, &found[0]);
    assert!(samples[0] < 0.01 * x[found[0].start] && samples[samples.len() - 1] < 1e-3);
    assert_eq!(samples[60], x[found[0].start + 60]);
}

#[test]
fn long_sounds_are_split_where_they_are_quiet_and_short_ones_left_out() {
    let x = bursts(&[(0.05, 0.3), (0.11, 0.3), (0.17, 0.3), (0.23, 0.3)], 0.4);
    let params = Extraction { threshold: 1e-8, max_len: 0.1, ..Extraction::default() };
    let whole = extents(&x, FS, &Extraction { max_len: 10.0, ..params });
    assert_eq!(whole.len(), 1);
    let parts = extents(&x, FS, &params);
    assert!(parts.len() >= 4 && parts.iter().all(|p| p.end - p.start <= 4800), "{parts:?}");
    assert!(parts.windows(2).all(|w| w[0].end == w[1].start));
    assert_eq!((parts[0].start, parts[parts.len() - 1].end), (whole[0].start, whole[0].end));
    assert!(extents(&x, FS, &Extraction { min_len: 1.0, max_len: 10.0, ..params }).is_empty());
    // With a gap to bridge, two bursts are one.
    let two = bursts(&[(0.1, 0.3), (0.3, 0.3)], 0.5);
    let params = Extraction { threshold: 1e-4, ..Extraction::default() };
    assert_eq!(extents(&two, FS, &params).len(), 2);
    assert_eq!(extents(&two, FS, &Extraction { merge_gap: 0.18, ..params }).len(), 1);
}

#[test]
fn silence_and_nothing_hold_no_sample() {
    assert!(extents(&[], FS, &Extraction::default()).is_empty());
    assert!(extents(&[0.0; 5000], FS, &Extraction::default()).is_empty());
    // All of it is loud: one sample, from end to end.
    let full = extents(&[0.5; 3000], FS, &Extraction::default());
    assert_eq!((full[0].start, full[0].end), (0, 3000));
}

proptest! {
    #[test]
    fn extents_are_in_order_and_inside(
        x in prop::collection::vec(-1.0_f32..1.0, 0..3000), threshold in 0.0..0.5, max_len in 0.001..0.05, gap in 0.0..0.01,
    ) {
        let params = Extraction { threshold, window: 0.002, min_len: 0.0, max_len, merge_gap: gap };
        let found = extents(&x, 8000.0, &params);
        prop_assert!(found.windows(2).all(|w| w[0].end <= w[1].start));
        prop_assert!(found.iter().all(|e| e.start < e.end && e.end <= x.len()));
        prop_assert!(found.iter().all(|e| cut(&x, 8000.0, e).iter().all(|s| s.is_finite())));
    }
}
