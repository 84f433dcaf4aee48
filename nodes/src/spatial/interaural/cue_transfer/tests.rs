use super::*;
use crate::core::random::Rng;

const RATE: f64 = 48_000.0;

fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut rng = Rng::new(seed);
    (0..n).map(|_| rng.between(-0.5, 0.5)).collect()
}

/// Runs whole sounds of interleaved channels, without the first and the last 8000 samples.
fn transferred(target: &[Vec<f64>], audio: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut transfer = CueTransfer::new(RATE, target.len(), audio.len());
    let CueFrames { length, hop } = CueFrames::at_rate(RATE);
    let interleaved = |channels: &[Vec<f64>], from: usize| -> Vec<f32> {
        (from..from + length).flat_map(|i| channels.iter().map(move |c| c[i] as f32)).collect()
    };
    let mut out = vec![Vec::new(); target.len()];
    let mut samples = vec![0.0; hop * target.len()];
    // The first hop is the one of the frame before the first sample of memory.
    let skip = transfer.latency();
    for (frame, from) in (0..target[0].len() - length).step_by(hop).enumerate() {
        transfer.next(&interleaved(target, from), &interleaved(audio, from), &mut samples);
        for (k, x) in samples.iter().enumerate().filter(|_| frame >= skip) {
            out[k % target.len()].push(f64::from(*x));
        }
    }
    out.into_iter().map(|channel| channel[8000..channel.len() - 8000].to_vec()).collect()
}

fn power(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64
}

fn level_difference(out: &[Vec<f64>]) -> f64 {
    10.0 * (power(&out[0]) / power(&out[1])).log10()
}

/// Correlation coefficient of the first channel with the second one `lag` samples earlier.
fn correlation(out: &[Vec<f64>], lag: i64) -> f64 {
    let n = out[0].len() as i64;
    let pairs = (100..n - 100).map(|i| out[0][i as usize] * out[1][(i - lag) as usize]);
    pairs.sum::<f64>() / (n - 200) as f64 / (power(&out[0]) * power(&out[1])).sqrt()
}

/// The lag of the largest correlation.
fn delay(out: &[Vec<f64>]) -> i64 {
    (-48..=48).max_by(|a, b| correlation(out, *a).total_cmp(&correlation(out, *b))).unwrap()
}

/// Halves of a sound below and above some 2 kHz: a moving average, and the rest.
fn split(x: &[f64]) -> [Vec<f64>; 2] {
    let low: Vec<f64> =
        (0..x.len()).map(|i| (0..16).filter_map(|k| x.get(i.checked_sub(k)?)).sum::<f64>() / 16.0).collect();
    let high = x.iter().zip(&low).map(|(x, low)| x - low).collect();
    [low, high]
}

#[test]
fn a_delayed_and_softer_ear_is_delayed_and_softer_in_another_sound() {
    let n = 96_000;
    let (sound, audio) = (noise(1, n), noise(2, n));
    for lag in [-31_i64, 0, 12] {
        let shifted: Vec<f64> = (0..n as i64)
            .map(|i| usize::try_from(i - lag).ok().and_then(|i| sound.get(i)).map_or(0.0, |x| *x))
            .collect();
        let target = [shifted, sound.iter().map(|x| 0.4 * x).collect()];
        let out = transferred(&target, std::slice::from_ref(&audio));
        let wanted = 20.0 * 2.5_f64.log10();
        assert!((level_difference(&out) - wanted).abs() < 0.1, "{lag}: {}", level_difference(&out));
        assert_eq!(delay(&out), lag);
        assert!(correlation(&out, lag) > 0.95, "{lag}: {}", correlation(&out, lag));
        // The mean power of the ears is that of the sound.
        let mean = 0.5 * (power(&out[0]) + power(&out[1]));
        assert!((10.0 * (mean / power(&audio)).log10()).abs() < 0.2, "{mean}");
    }
}

#[test]
fn each_band_gets_its_own_level_difference() {
    let n = 96_000;
    let [low, high] = split(&noise(1, n));
    let target = [
        low.iter().zip(&high).map(|(l, h)| l + 0.3 * h).collect::<Vec<f64>>(),
        low.iter().zip(&high).map(|(l, h)| 0.5 * l + h).collect(),
    ];
    let mono = [noise(2, n)];
    let stereo = [noise(3, n), noise(4, n)];
    for audio in [&mono[..], &stereo[..]] {
        let out = transferred(&target, audio);
        for band in 0..2 {
            let of = |channels: &[Vec<f64>]| {
                level_difference(&channels.iter().map(|c| split(c)[band].clone()).collect::<Vec<_>>())
            };
            let (found, wanted) = (of(&out), of(&target));
            assert!((found - wanted).abs() < 0.4, "{} channels, {band}: {found} {wanted}", audio.len());
        }
    }
}

#[test]
fn ears_that_differ_get_a_decorrelated_part() {
    let n = 192_000;
    let (common, left, right) = (noise(1, n), noise(2, n), noise(3, n));
    for share in [0.0_f64, 0.3, 0.7, 1.0] {
        let mix = |own: &[f64]| {
            common
                .iter()
                .zip(own)
                .map(|(c, o)| share.sqrt() * c + (1.0 - share).sqrt() * o)
                .collect::<Vec<f64>>()
        };
        let out = transferred(&[mix(&left), mix(&right)], &[noise(4, n)]);
        let found = (-48..=48).map(|lag| correlation(&out, lag)).fold(f64::MIN, f64::max);
        assert!((found - share).abs() < 0.12, "{share}: {found}");
        assert!(level_difference(&out).abs() < 0.2, "{share}: {}", level_difference(&out));
    }
}

#[test]
fn a_sound_of_two_channels_keeps_its_power_and_its_correlation() {
    let n = 96_000;
    let (common, own) = (noise(1, n), noise(2, n));
    let audio =
        [common.clone(), common.iter().zip(&own).map(|(c, o)| 0.6 * c + 0.8 * o).collect::<Vec<f64>>()];
    let target = [noise(3, n), noise(4, n).iter().map(|x| 3.0 * x).collect()];
    let out = transferred(&target, &audio);
    assert!((level_difference(&out) + 20.0 * 3.0_f64.log10()).abs() < 0.2, "{}", level_difference(&out));
    let (before, after) = (power(&audio[0]) + power(&audio[1]), power(&out[0]) + power(&out[1]));
    assert!((after / before - 1.0).abs() < 0.03, "{before} {after}");
    assert!((correlation(&out, 0) - 0.6).abs() < 0.03, "{}", correlation(&out, 0));
}

#[test]
fn with_a_silent_target_both_ears_get_the_sound_as_it_is() {
    let n = 48_000;
    let audio = noise(5, n);
    let out = transferred(&[vec![0.0; n], vec![0.0; n]], std::slice::from_ref(&audio));
    for ear in &out {
        assert!(ear.iter().zip(&audio[8000..]).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}

#[test]
fn a_louder_target_gives_the_same() {
    let n = 24_000;
    let (left, right, audio) = (noise(1, n), noise(2, n), noise(3, n));
    let times = |gain: f64| {
        let scaled = |x: &[f64]| x.iter().map(|x| gain * x).collect::<Vec<f64>>();
        transferred(&[scaled(&left), scaled(&right)], std::slice::from_ref(&audio))
    };
    let (once, twice) = (times(1.0), times(2.0));
    assert!(once.iter().flatten().zip(twice.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-4));
}
