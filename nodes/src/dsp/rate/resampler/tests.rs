use super::*;
use crate::dsp::testing::assert_block_invariant;

/// Converts a function of the input index to `frames` outputs from `first` on, in one block.
fn convert(r: &Resampler, first: i64, frames: usize, signal: impl Fn(i64) -> f64) -> Vec<f32> {
    let inputs = r.inputs(first..first + frames as i64);
    let input: Vec<f32> = inputs.clone().map(|n| signal(n) as f32).collect();
    let mut out = vec![f32::NAN; frames];
    r.process(first, &input, inputs.start, 1, &mut out).unwrap();
    out
}

fn tone(f: f64) -> impl Fn(i64) -> f64 {
    move |n| (2.0 * PI * f * n as f64).sin()
}

/// Returns the largest error relative to full scale, in dB.
fn error_db(out: &[f32], first: i64, ideal: impl Fn(i64) -> f64) -> f64 {
    let worst = (first..).zip(out).map(|(n, &x)| (f64::from(x) - ideal(n)).abs()).fold(1e-12, f64::max);
    20.0 * worst.log10()
}

const PAIRS: [(u32, u32); 4] = [(44_100, 48_000), (48_000, 44_100), (96_000, 48_000), (22_050, 96_000)];

#[test]
fn high_quality_passes_tones_with_an_error_below_100_db() {
    for (from, to) in PAIRS {
        let r = Resampler::new(Rate::hz(from), Rate::hz(to), Quality::High).unwrap();
        let low = f64::from(from.min(to)) / 2.0;
        for f in [0.01, 0.3, 0.7, 0.9, 0.92] {
            let out = convert(&r, 1000, 600, tone(f * low / f64::from(from)));
            let db = error_db(&out, 1000, tone(f * low / f64::from(to)));
            assert!(db < -100.0, "{from} -> {to}, {f}: {db}");
        }
    }
}

#[test]
fn high_quality_attenuates_aliases_by_100_db() {
    for (from, to) in [(48_000_u32, 44_100_u32), (96_000, 48_000), (96_000, 44_100), (192_000, 8000)] {
        let r = Resampler::new(Rate::hz(from), Rate::hz(to), Quality::High).unwrap();
        let nyquist = f64::from(to) / 2.0 / f64::from(from);
        for f in [nyquist * 1.0001, nyquist * 1.03, nyquist + 0.8 * (0.5 - nyquist)] {
            let db = error_db(&convert(&r, 0, 500, tone(f)), 0, |_| 0.0);
            assert!(db < -100.0, "{from} -> {to}, {f}: {db}");
        }
    }
}

#[test]
fn each_quality_has_its_stated_error() {
    for (quality, edge, expected) in [(Quality::Draft, 0.74, -55.0), (Quality::Standard, 0.87, -95.0)] {
        let r = Resampler::new(Rate::hz(48_000), Rate::hz(44_100), quality).unwrap();
        let pass = convert(&r, 0, 500, tone(edge * 22_050.0 / 48_000.0));
        assert!(error_db(&pass, 0, tone(edge * 0.5)) < expected);
        let stop = convert(&r, 0, 500, tone(22_060.0 / 48_000.0));
        assert!(error_db(&stop, 0, |_| 0.0) < expected);
    }
}

#[test]
fn rates_without_a_small_ratio_are_interpolated() {
    let uncommon = Rate::new(48_000 * 1000, 1001).unwrap();
    let r = Resampler::new(Rate::hz(44_101), uncommon, Quality::High).unwrap();
    assert!(r.interpolated);
    let to = 48_000_000.0 / 1001.0;
    let out = convert(&r, -300, 600, tone(15_000.0 / 44_101.0));
    let db = error_db(&out, -300, tone(15_000.0 / to));
    assert!(db < -100.0, "{db}");
}

#[test]
fn constants_pass_and_equal_rates_copy() {
    let r = Resampler::new(Rate::hz(44_100), Rate::hz(48_000), Quality::Draft).unwrap();
    assert!(convert(&r, 5, 400, |_| 0.7).iter().all(|&x| x == 0.7));
    let r = Resampler::new(Rate::new(96_000, 2).unwrap(), Rate::hz(48_000), Quality::High).unwrap();
    assert_eq!((r.look_behind(), r.look_ahead()), (0, 0));
    assert_eq!(convert(&r, -3, 3, |n| n as f64), [-3.0, -2.0, -1.0]);
}

#[test]
fn blocks_and_positions_do_not_change_a_bit() {
    let r = Resampler::new(Rate::hz(44_100), Rate::hz(48_000), Quality::Standard).unwrap();
    let signal = |n: i64| ((n % 1009).pow(2) % 97) as f32 / 97.0 - 0.5;
    for start in [0, 1_000_000_000_007] {
        assert_block_invariant(
            &vec![0.0; 2 * 2500],
            2,
            || (),
            |(), at, out| {
                let first = start + at;
                let inputs = r.inputs(first..first + out.len() as i64 / 2);
                // The start of the input varies with the block.
                let first_in = inputs.start - at % 5;
                let input: Vec<f32> = (first_in..inputs.end).flat_map(|n| [signal(n), -signal(n)]).collect();
                r.process(first, &input, first_in, 2, out).unwrap();
            },
        );
    }
}

#[test]
fn the_declared_look_ahead_is_sufficient_and_necessary() {
    let r = Resampler::new(Rate::hz(48_000), Rate::hz(44_100), Quality::Draft).unwrap();
    let inputs = r.inputs(10..11);
    assert_eq!(inputs, r.position(10) - r.look_behind() as i64..r.position(10) + r.look_ahead() as i64 + 1);
    let mut out = [0.0];
    let short = vec![0.0; (inputs.end - inputs.start) as usize - 1];
    assert!(r.process(10, &short, inputs.start, 1, &mut out).is_err());
    let mut last = vec![0.0; short.len() + 1];
    last[short.len()] = 1.0;
    r.process(10, &last, inputs.start, 1, &mut out).unwrap();
    assert!(out[0] != 0.0);
}

#[test]
fn impossible_rates_are_errors() {
    assert_eq!(
        Resampler::new(Rate::hz(1), Rate::hz(48_000), Quality::High).unwrap_err().what,
        "ratio of the rates"
    );
}

#[test]
fn a_filter_that_exceeds_the_memory_limit_is_refused_before_its_design() {
    let (from, to) = (Rate::hz(192_001), Rate::hz(191));
    assert!(Resampler::lookaround(from, to, Quality::Draft).is_ok());
    let to = Rate::new(191_000, 1001).unwrap();
    assert!(Resampler::new(from, to, Quality::High).unwrap_err().expected.contains("two steps"));
}
