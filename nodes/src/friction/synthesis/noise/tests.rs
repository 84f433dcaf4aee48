use super::*;
use crate::friction::builder::psd::{AnalysisWindow, centroid, welch};
use crate::friction::testing::{bump_model, third_octaves};
use crate::friction::{ClipStream, Gain, SpectrumInterpolator, Window};
use proptest::prelude::*;

const RATES: [f64; 3] = [44100.0, 48000.0, 96000.0];

fn model() -> FrictionModel {
    bump_model(&[(0.1, 1000.0), (0.5, 3000.0), (1.0, 5000.0)], 600.0, 48000.0, 2400)
}

fn stream(fs: f64, params: IftNoiseParams, areas: &[f32]) -> ClipStream {
    ClipStream::new(IftNoise::new(&model(), fs, params, areas, Random::new(11, "noise")).unwrap())
}

fn constant<'a>(speeds: &'a [f32]) -> impl FnMut(u64) -> ClipInput<'a> {
    move |_| ClipInput { speeds, ..ClipInput::default() }
}

fn render(stream: &mut ClipStream, seconds: f64, fs: f64, speeds: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; (seconds * fs) as usize];
    stream.fill(0, &mut out, constant(speeds)).unwrap();
    out
}

fn mean_square(x: &[f32]) -> f64 {
    x.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / x.len() as f64
}

fn decibels(a: f64, b: f64) -> f64 {
    10.0 * (a / b).log10()
}

/// Largest level difference in third octaves that hold more than 0.1 % of `expected`'s power.
fn worst_third_octave(found: &[(f64, f64)], expected: &[(f64, f64)]) -> f64 {
    let total: f64 = expected.iter().map(|b| b.1).sum();
    let loud = found.iter().zip(expected).filter(|(_, e)| e.1 > 1e-3 * total);
    loud.map(|(f, e)| decibels(f.1, e.1).abs()).fold(0.0, f64::max)
}

const ONE: [f32; 1] = [REFERENCE_AREA as f32];

#[test]
fn a_minute_at_constant_speed_has_the_models_spectrum_and_level() {
    let fs = 44100.0;
    for (speed, params) in [
        (0.7_f32, IftNoiseParams::default()),
        (
            0.3,
            IftNoiseParams {
                window: Window::Sine,
                magnitude: Some(Magnitude::Rayleigh),
                ..Default::default()
            },
        ),
    ] {
        let x = render(&mut stream(fs, params, &ONE), 60.0, fs, &[speed]);
        let m = model();
        let mut amplitude = vec![0.0; m.bins()];
        SpectrumInterpolator::new(&m, Gain::Rms).unwrap().amplitude(f64::from(speed), &mut amplitude);
        let exact: Vec<f64> = amplitude.iter().map(|a| a * a / m.df).collect();
        let psd = welch(&x, fs, 8820, 4410, AnalysisWindow::Hann).unwrap();
        let worst = worst_third_octave(&third_octaves(&psd, fs / 8820.0), &third_octaves(&exact, m.df));
        assert!(worst < 1.0, "{speed}: {worst} dB");
        let rms = (mean_square(&x) / m.power(f64::from(speed))).sqrt();
        assert!((rms - 1.0).abs() < 0.01, "{speed}: {rms}");
    }
}

#[test]
fn one_clip_has_exactly_the_power_of_the_spectrum() {
    for fs in RATES {
        let params = IftNoiseParams { magnitude: Some(Magnitude::Fixed), ..Default::default() };
        let mut noise = IftNoise::new(&model(), fs, params, &ONE, Random::new(1, "x")).unwrap();
        noise.window.fill(1.0);
        let mut out = vec![0.0; noise.clip_len()];
        noise.clip(3, ClipInput { speeds: &[1.0], ..ClipInput::default() }, &mut out).unwrap();
        let expected: f64 = noise.table.row(255)[1..].iter().map(|&p| f64::from(p)).sum();
        assert!((mean_square(&out) / expected - 1.0).abs() < 1e-5, "{fs}");
        assert!((expected / model().power(1.0) - 1.0).abs() < 1e-3);
    }
}

/// Power in the middle of an overlap over power at the centre of a clip.
fn ripple(window: Window) -> f64 {
    let fs = 44100.0;
    let mut s = stream(fs, IftNoiseParams { window, ..Default::default() }, &ONE);
    let x = render(&mut s, 60.0, fs, &[0.7]);
    let hop = s.hop();
    let around = |centre: usize| {
        let radius = hop / 20;
        let near =
            x.iter().enumerate().filter(|(i, _)| (i % hop + hop + radius - centre) % hop <= 2 * radius);
        let (n, sum) = near.fold((0.0, 0.0), |(n, s), (_, &x)| (n + 1.0, s + f64::from(x).powi(2)));
        sum / n
    };
    around(hop / 2) / around(0)
}

#[test]
fn the_envelope_is_flat_for_the_default_window_and_dips_for_the_triangle() {
    let (flat, dips) = (ripple(Window::SqrtTriangle), ripple(Window::Triangle));
    assert!((flat - 1.0).abs() < 0.03, "{flat}");
    assert!((dips - 0.5).abs() < 0.06, "{dips}");
}

#[test]
fn a_speed_ramp_moves_the_centroid_as_the_model_predicts() {
    let fs = 48000.0;
    let m = model();
    let spectra = SpectrumInterpolator::new(&m, Gain::Rms).unwrap();
    let mut s = stream(fs, IftNoiseParams::default(), &ONE);
    let (hop, seconds) = (s.hop(), 30.0);
    let clips = (seconds * fs) as usize / hop + 2;
    let ramp: Vec<[f32; 1]> = (0..clips).map(|k| [0.1 + 0.9 * k as f32 / clips as f32]).collect();
    let mut x = vec![0.0; (clips - 2) * hop];
    s.fill(0, &mut x, |k| ClipInput { speeds: &ramp[k as usize], ..ClipInput::default() }).unwrap();
    for part in 0..6 {
        let from = part * (clips - 2) / 6;
        let to = (part + 1) * (clips - 2) / 6;
        let psd = welch(&x[from * hop..to * hop], fs, 2400, 1200, AnalysisWindow::Hann).unwrap();
        let mut expected = vec![0.0; m.bins()];
        let mut amplitude = vec![0.0; m.bins()];
        for r in &ramp[from..to] {
            spectra.amplitude(f64::from(r[0]), &mut amplitude);
            expected.iter_mut().zip(&amplitude).for_each(|(e, a)| *e += a * a);
        }
        let (found, expected) = (centroid(&psd, 20.0), centroid(&expected, 20.0));
        assert!((found / expected - 1.0).abs() < 0.02, "{part}: {found} Hz instead of {expected} Hz");
    }
}

#[test]
fn a_mesh_refined_fourfold_is_equally_loud_and_without_area_weight_six_decibels_louder() {
    let fs = 44100.0;
    let level = |vertices: usize, params| {
        let areas = vec![0.01 / vertices as f32; vertices];
        let speeds: Vec<f32> = (0..vertices).map(|v| 0.05 + (v as f32 + 0.5) / vertices as f32).collect();
        mean_square(&render(&mut stream(fs, params, &areas), 10.0, fs, &speeds))
    };
    for emitters in [Emitters::default(), Emitters::PerVertex] {
        let n = if emitters == Emitters::PerVertex { 6 } else { 100 };
        let weighted = IftNoiseParams { emitters, ..Default::default() };
        let plain = IftNoiseParams { area_weight: AreaWeight::None, ..weighted };
        let change = decibels(level(4 * n, weighted), level(n, weighted));
        assert!(change.abs() < 0.5, "{emitters:?}: {change} dB");
        let change = decibels(level(4 * n, plain), level(n, plain));
        assert!((change - 6.02).abs() < 0.5, "{emitters:?}: {change} dB");
    }
}

/// One channel that uses positions and filters no emitter.
struct Placed;

impl Receiver for Placed {
    fn channels(&self) -> usize {
        1
    }

    fn add(&mut self, c: usize, at: Option<[f32; 3]>, x: (&[f32], &[f32]), sum: (&mut [f32], &mut [f32])) {
        Mono.add(c, at, x, sum);
    }
}

#[test]
fn clusters_and_single_vertices_have_the_same_spectrum() {
    let fs = 44100.0;
    let areas = [4e-4_f32; 16];
    let speeds: Vec<f32> = (0..16).map(|v| 0.03 + 0.07 * v as f32).collect();
    let positions: Vec<[f32; 3]> = (0..16).map(|v| [0.04 * v as f32, 0.0, 0.0]).collect();
    let spectrum = |emitters, positions| {
        let (params, random) =
            (IftNoiseParams { emitters, ..Default::default() }, Random::new(5, "clusters"));
        let noise = IftNoise::with_receiver(&model(), fs, params, &areas, random, Placed).unwrap();
        let mut s = ClipStream::new(noise);
        let mut x = vec![0.0; (20.0 * fs) as usize];
        s.fill(0, &mut x, |_| ClipInput { speeds: &speeds, positions, pressures: None }).unwrap();
        third_octaves(&welch(&x, fs, 4410, 2205, AnalysisWindow::Hann).unwrap(), 10.0)
    };
    let reference = spectrum(Emitters::PerVertex, None);
    for positions in [None, Some(&positions[..])] {
        let worst = worst_third_octave(&spectrum(Emitters::default(), positions), &reference);
        assert!(worst < 0.5, "{worst} dB");
    }
}

#[test]
fn clusters_are_as_lively_as_the_sum_of_their_vertices() {
    // Variance of the power of clips over the squared mean: 1 over the number of independent bins of Gaussian noise, and
    // less where magnitudes are fixed.
    let fs = 44100.0;
    let spread = |emitters, magnitude| {
        let params = IftNoiseParams { emitters, magnitude, ..Default::default() };
        let mut noise = IftNoise::new(&model(), fs, params, &[4e-4; 24], Random::new(8, "lively")).unwrap();
        noise.window.fill(1.0);
        let mut out = vec![0.0; noise.clip_len()];
        let powers: Vec<f64> = (0..400)
            .map(|k| {
                noise.clip(k, ClipInput { speeds: &[0.7; 24], ..ClipInput::default() }, &mut out).unwrap();
                mean_square(&out)
            })
            .collect();
        let mean = powers.iter().sum::<f64>() / powers.len() as f64;
        (powers.iter().map(|p| (p / mean - 1.0).powi(2)).sum::<f64>() / powers.len() as f64).sqrt()
    };
    let [vertices, clustered] = [Emitters::PerVertex, Emitters::default()].map(|e| spread(e, None));
    assert!((clustered / vertices - 1.0).abs() < 0.15, "{clustered} for {vertices}");
    let fixed = spread(Emitters::default(), Some(Magnitude::Fixed));
    assert!(fixed < 0.1 * vertices, "{fixed} for {vertices}");
}

#[test]
fn without_sliding_vertices_the_output_is_exactly_silent() {
    let mut s = stream(48000.0, IftNoiseParams::default(), &[1e-4, 1e-4]);
    let mut out = vec![1.0; 5000];
    s.fill(0, &mut out, constant(&[0.0, 0.0])).unwrap();
    assert!(out.iter().all(|&x| x.to_bits() == 0));
    assert_eq!(s.noise().coverage(), SpeedCoverage::default());
    let mut noise =
        IftNoise::new(&model(), 48000.0, IftNoiseParams::default(), &[0.0], Random::new(1, "x")).unwrap();
    let mut out = vec![1.0; noise.clip_len()];
    let sliding = noise.clip(0, ClipInput { speeds: &[1.0], ..ClipInput::default() }, &mut out).unwrap();
    assert_eq!((sliding, out.iter().all(|&x| x == 0.0)), (0, true), "no area, no sound");
}

#[test]
fn time_outside_the_models_speeds_is_counted() {
    let mut s = stream(48000.0, IftNoiseParams::default(), &[1e-4; 4]);
    let mut out = vec![0.0; s.hop() * 9];
    s.fill(0, &mut out, constant(&[0.0, 0.01, 0.5, 2.0])).unwrap();
    let coverage = s.noise().coverage();
    assert_eq!(coverage, SpeedCoverage { sliding: 30, above: 10, below: 10 });
    assert!((coverage.share_above() - 1.0 / 3.0).abs() < 1e-12);
}

#[test]
fn each_window_touches_the_clips_that_overlap_it() {
    let s = stream(48000.0, IftNoiseParams::default(), &ONE);
    assert_eq!(s.hop(), 1200);
    assert_eq!(s.clips_touching(0, 1), 0..=1);
    assert_eq!(s.clips_touching(1199, 2), 0..=2);
    assert_eq!(s.clips_touching(2400, 1200), 2..=3);
}

#[test]
fn wrong_input_is_named_by_clip_and_vertex() {
    let mut noise =
        IftNoise::new(&model(), 48000.0, IftNoiseParams::default(), &[1e-4; 2], Random::new(1, "x")).unwrap();
    let mut out = vec![0.0; noise.clip_len()];
    let mut clip = |speeds: &[f32], positions| {
        noise.clip(7, ClipInput { speeds, positions, pressures: None }, &mut out).unwrap_err()
    };
    assert!(matches!(clip(&[0.1, f32::NAN], None), NoiseError::Speed { clip: 7, vertex: 1, .. }));
    assert!(matches!(clip(&[-0.1, 0.0], None), NoiseError::Speed { vertex: 0, .. }));
    assert!(matches!(clip(&[0.1], None), NoiseError::Length { found: 1, expected: 2, .. }));
    assert!(matches!(
        clip(&[0.1; 2], Some(&[[0.0; 3]; 3][..])),
        NoiseError::Length { what: "positions", .. }
    ));
    let far = [[0.0; 3], [0.0, f32::INFINITY, 0.0]];
    assert!(matches!(clip(&[0.1; 2], Some(&far[..])), NoiseError::Position { vertex: 1, .. }));
    let new =
        |fs, params, areas: &[f32]| IftNoise::new(&model(), fs, params, areas, Random::new(1, "x")).err();
    assert!(matches!(
        new(48000.0, IftNoiseParams::default(), &[-1.0]),
        Some(NoiseError::Area { vertex: 0, .. })
    ));
    assert!(matches!(new(f64::NAN, IftNoiseParams::default(), &[]), Some(NoiseError::Model(_))));
    let long = IftNoiseParams { clip: 1e9, ..Default::default() };
    assert!(matches!(new(48000.0, long, &[]), Some(NoiseError::Model(ModelError::Target { .. }))));
}

/// Two channels, the second delayed by `delay` samples.
struct Delayed {
    delay: f32,
    len: usize,
}

impl Receiver for Delayed {
    fn channels(&self) -> usize {
        2
    }

    fn add(
        &mut self,
        channel: usize,
        _: Option<[f32; 3]>,
        x: (&[f32], &[f32]),
        sum: (&mut [f32], &mut [f32]),
    ) {
        for k in 0..x.0.len() {
            let angle = -std::f32::consts::TAU * k as f32 * self.delay * channel as f32 / self.len as f32;
            let (s, c) = angle.sin_cos();
            sum.0[k] += x.0[k] * c - x.1[k] * s;
            sum.1[k] += x.0[k] * s + x.1[k] * c;
        }
    }
}

#[test]
fn channels_share_phases_so_a_delay_between_them_is_the_peak_of_their_correlation() {
    let params = IftNoiseParams::default();
    let ears = Delayed { delay: 20.0, len: 2400 };
    let random = Random::new(4, "ears");
    let noise = IftNoise::with_receiver(&model(), 48000.0, params, &[1e-4; 3], random, ears).unwrap();
    let mut s = ClipStream::new(noise);
    let positions = [[0.0; 3], [1.0; 3], [2.0; 3]];
    let t = 48000;
    let mut out = vec![0.0; 2 * t];
    s.fill(0, &mut out, |_| ClipInput {
        speeds: &[0.3, 0.5, 0.9],
        positions: Some(&positions),
        pressures: None,
    })
    .unwrap();
    let (left, right) = out.split_at(t);
    let correlation =
        |lag: usize| -> f64 { left[..t - 60].iter().zip(&right[lag..]).map(|(a, b)| f64::from(a * b)).sum() };
    let peak = (0..60).max_by(|&a, &b| correlation(a).total_cmp(&correlation(b))).unwrap();
    assert!((19..=21).contains(&peak), "{peak}");
    let share = correlation(peak) / left.iter().map(|&x| f64::from(x * x)).sum::<f64>();
    assert!(share > 0.9, "{share}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn any_partition_into_windows_gives_the_same_bits(
        cuts in prop::collection::vec(1..4000_usize, 1..12),
        per_vertex: bool,
        placed: bool,
        rate in 0..3_usize,
    ) {
        let fs = RATES[rate];
        let emitters = if per_vertex { Emitters::PerVertex } else { Emitters::Clustered { max: 2, cell: 0.1 } };
        let params = IftNoiseParams { emitters, clip: 0.02, ..Default::default() };
        let positions = [[0.0; 3], [1.0; 3], [3.0; 3]];
        let speeds: Vec<[f32; 3]> = (0..200).map(|k| [0.0, 0.01 * k as f32, 1.5 - 0.005 * k as f32]).collect();
        let input = |k: u64| ClipInput { speeds: &speeds[k as usize], positions: placed.then_some(&positions[..]), pressures: None };
        let total: usize = cuts.iter().sum();
        let mut whole = vec![f32::NAN; total];
        let stream = || {
            let random = Random::new(6, "windows");
            ClipStream::new(IftNoise::with_receiver(&model(), fs, params, &[1e-4; 3], random, Placed).unwrap())
        };
        stream().fill(0, &mut whole, input).unwrap();
        let mut parts = stream();
        let mut from = 0;
        for cut in cuts {
            let mut out = vec![f32::NAN; cut];
            parts.fill(from as u64, &mut out, input).unwrap();
            for (a, b) in out.iter().zip(&whole[from..]) {
                prop_assert_eq!(a.to_bits(), b.to_bits());
            }
            from += cut;
        }
        // Reading backwards renders the same again.
        let mut out = vec![0.0; total.min(100)];
        parts.fill(0, &mut out, input).unwrap();
        prop_assert_eq!(&out[..], &whole[..out.len()]);
    }
}
