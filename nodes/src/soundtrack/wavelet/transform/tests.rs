use super::*;
use crate::core::random::Rng;

fn wave(n: usize) -> Vec<f64> {
    (0..n).map(|n| (0.3 * n as f64).sin() + 0.01 * ((n * n) % 17) as f64).collect()
}

/// The first values of approximation and details of 64 samples over three levels, as `pywt.wavedec(x, name, "periodization", level=3)`
/// returns them.
const PYWAVELETS: [(Wavelet, [[f64; 4]; 4]); 5] = [
    (
        Wavelet::Haar,
        [
            [2.1072067254753963, -0.38649576943015906, -0.7806634902528513, 2.35616537030661],
            [-0.8460891424343266, 1.4586233568345253, -1.471775183841002, 0.6561809331010587],
            [-0.5862245881805896, 0.08123853752210564, 0.6047343734341811, 0.4144096437999298],
            [-0.21603540991974862, -0.1899885868592484, 0.010284231285949685, -0.013690814658988804],
        ],
    ),
    (
        Wavelet::Db2,
        [
            [-0.7075171627497469, 2.6576891843590995, -1.9943957179910807, 1.0977423393850652],
            [0.7361097939854093, 0.14497830605586992, -1.0446711433621008, 1.4009454003057173],
            [-0.075228104577473, 0.21346526475881283, 0.15809240854920908, -0.14121709981011082],
            [-0.053325194127159345, 0.028073693326859335, 0.06355989327149643, 0.09635434619475833],
        ],
    ),
    (
        Wavelet::Db5,
        [
            [2.5819322408996244, -0.609861333476492, -1.1970137207404226, 2.9694838342698926],
            [-0.5827611279668454, 0.09531383286022677, 0.5064759820992129, -1.0410630329116273],
            [-0.12784768340361416, -0.004638447268575657, 0.12299529519627292, 0.011897496401706622],
            [-0.0033927692832704205, -0.022082760112607295, -0.04099191268746198, 0.041678116965933557],
        ],
    ),
    (
        Wavelet::Sym4,
        [
            [2.008278782009694, -2.4434501581735333, 2.3822502740194174, -0.3121679015391795],
            [-0.7968606426478532, 0.4655265014578694, 0.28522507990955703, -0.9726633951181608],
            [0.22395769524592907, -0.04221834205550824, -0.0660660640025379, -0.053131179648877785],
            [0.19118016272113458, -0.020950312757202987, -0.06753500578687505, 0.06888669276518275],
        ],
    ),
    (
        Wavelet::Db10,
        [
            [-2.0169832645343626, 3.0620781807483253, -1.7485493110579564, 0.3306316224658466],
            [-0.12441793107839498, -0.3491805890984799, 0.5688307059393931, -0.6782842858349453],
            [-0.05131089160619028, -0.042697583757481825, 0.04679929512048552, 0.044214307884213086],
            [0.07659115421726895, -0.07172017333410564, -0.029895890582182293, 0.06720017040115125],
        ],
    ),
];

#[test]
fn coefficients_equal_those_of_pywavelets() {
    for (wavelet, expected) in PYWAVELETS {
        let found = forward(wavelet, 3, &wave(64));
        let levels = std::iter::once(&found.approximation).chain(&found.details);
        for (level, (found, expected)) in levels.zip(expected).enumerate() {
            for (a, b) in found.iter().zip(expected) {
                assert!((a - b).abs() < 1e-10, "{wavelet:?} level {level}: {found:?} {expected:?}");
            }
        }
    }
}

#[test]
fn coefficients_equal_the_formula_at_any_length() {
    let wavelet = Wavelet::Db5;
    let (h, g) = (wavelet.low_pass(), wavelet.high_pass());
    for n in [2, 4, 6, 8, 10, 40] {
        let x = wave(n);
        let (low, high) = FilterBank::new(wavelet).analyse(&x);
        for i in 0..n / 2 {
            let sum = |f: &[f64]| -> f64 {
                (0..10)
                    .map(|k| f[k] * x[(2 * i as isize + k as isize - 4).rem_euclid(n as isize) as usize])
                    .sum()
            };
            assert!((low[i] - sum(h)).abs() < 1e-12 && (high[i] - sum(&g)).abs() < 1e-12, "{n} {i}");
        }
    }
}

fn noise(n: usize) -> Vec<f64> {
    let mut rng = Rng::new(5);
    (0..n).map(|_| rng.between(-1.0, 1.0)).collect()
}

#[test]
fn the_inverse_restores_the_signal_and_energy_is_preserved() {
    use Wavelet::*;
    for wavelet in [Haar, Db2, Db3, Db4, Db5, Db10, Sym5, Sym8] {
        let x = noise(3 << 7);
        let coefficients = forward(wavelet, 7, &x);
        let restored = inverse(wavelet, &coefficients);
        let worst = x.iter().zip(&restored).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{wavelet:?}: {worst:e}");
        let energy = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        let all: f64 =
            energy(&coefficients.approximation) + coefficients.details.iter().map(|d| energy(d)).sum::<f64>();
        assert!((all / energy(&x) - 1.0).abs() < 1e-9, "{wavelet:?}: {all}");
    }
    let x = noise(3 << 10);
    let worst = |restored: Vec<f64>| x.iter().zip(restored).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let exact = worst(inverse(Wavelet::Db5, &forward(Wavelet::Db5, 10, &x)));
    assert!(exact < 1e-12, "{exact:e}");
    let single: Vec<f32> = x.iter().map(|x| *x as f32).collect();
    let single = inverse(Wavelet::Db5, &forward(Wavelet::Db5, 10, &single));
    let rounded = worst(single.into_iter().map(f64::from).collect());
    assert!(rounded < 2e-6, "{rounded:e}");
}

#[test]
fn the_energy_of_a_node_is_centred_on_its_span() {
    let (depth, roots) = (6, 32);
    for l in 0..depth as usize {
        let mut coefficients = forward(Wavelet::Db5, depth, &vec![0.0; roots << depth]);
        let node = coefficients.details[l].len() / 2;
        coefficients.details[l][node] = 1.0;
        let x = inverse(Wavelet::Db5, &coefficients);
        let centroid: f64 = x.iter().enumerate().map(|(n, x)| n as f64 * x * x).sum();
        let span = (1 << (depth as usize - l)) as f64;
        let centre = (node as f64 + 0.5) * span - 0.5;
        assert!((centroid - centre).abs() < 3.4, "level {l}: {centroid} {centre}");
    }
}

#[test]
fn the_stream_equals_the_periodic_inverse_away_from_the_ends() {
    use Wavelet::*;
    for wavelet in [Haar, Db2, Db5, Sym8] {
        let (depth, roots) = (5, 40);
        let x = noise(roots << depth);
        let coefficients = forward(wavelet, depth, &x);
        let mut stream = StreamingInverse::new(wavelet, depth);
        let mut out = Vec::new();
        for n in 0..roots {
            let detail = |l: usize| &coefficients.details[l][n << l..(n + 1) << l];
            stream.add(coefficients.approximation[n], detail, &mut out);
            let complete = (n + 1).saturating_sub(wavelet.reach()) << depth;
            assert!(out.len() >= complete, "{wavelet:?}: {} of {complete}", out.len());
        }
        let reach = wavelet.reach() + 1;
        for n in reach << depth..(roots - reach) << depth {
            assert!((out[n] - x[n]).abs() < 1e-9, "{wavelet:?} {n}: {} {}", out[n], x[n]);
        }
    }
}
