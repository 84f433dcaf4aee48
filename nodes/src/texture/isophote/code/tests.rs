use super::*;
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::texture::{Drawing, Grid, Luma, LumaKind, isophotes};

fn texture(wrap: Wrap, simplify: f64) -> Isophotes {
    let mut rng = Rng::new(8);
    let grid = Grid::from_fn(128, 96, |_, _| rng.between(0.0, 100.0) as f32);
    let surface = Surface { density: [700.0, 512.0], depth: 2e-4, wrap };
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    isophotes(&luma, &Drawing { simplify, ..Drawing::default() }).unwrap()
}

#[test]
fn points_are_decoded_exactly_and_gradients_within_a_twentieth() {
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        let all = texture(wrap, 0.25);
        let bytes = encode_isophotes(&all);
        let back = decode_isophotes(&bytes).unwrap();
        assert_eq!((&back.points, &back.curves, &back.levels), (&all.points, &all.curves, &all.levels));
        assert_eq!((back.surface, back.width, back.height), (all.surface, all.width, all.height));
        let (mut wrong, mut sum) = (0.0, 0.0);
        for (a, b) in all.gradients.iter().zip(&back.gradients) {
            let size = a[0].hypot(a[1]);
            let miss = (a[0] - b[0]).hypot(a[1] - b[1]);
            assert!(miss <= 0.05 * size, "{a:?} {b:?}");
            wrong += f64::from(miss).powi(2);
            sum += f64::from(size).powi(2);
        }
        assert!((wrong / sum).sqrt() < 0.03, "{}", (wrong / sum).sqrt());
        let again = decode_isophotes(&encode_isophotes(&back)).unwrap();
        assert_eq!((again.points, again.curves), (all.points.clone(), all.curves.clone()));
        let moved =
            |(a, b): (&[f32; 2], &[f32; 2])| (a[0] - b[0]).hypot(a[1] - b[1]) > 1e-3 * a[0].hypot(a[1]);
        assert!(
            !back.gradients.iter().zip(&again.gradients).any(moved),
            "coding decoded gradients again does not change them"
        );
        let each = bytes.len() as f64 / all.points.len() as f64;
        assert!(each < 2.9, "{each} bytes per point");
    }
}

#[test]
fn curves_with_all_points_are_decoded_to_a_128th_of_a_pixel() {
    let all = texture(Wrap::Repeat, 0.0);
    let back = decode_isophotes(&encode_isophotes(&all)).unwrap();
    assert_eq!(back.curves, all.curves);
    for (a, b) in all.points.iter().zip(&back.points) {
        assert!((0..2).all(|i| (a[i] - b[i]).abs() <= 1.001 / 128.0), "{a:?} {b:?}");
    }
}

#[test]
fn trials_are_decoded() {
    let mut rng = Rng::new(3);
    for _ in 0..40 {
        let all = Isophotes::trial(&mut rng);
        let back = decode_isophotes(&encode_isophotes(&all)).unwrap();
        assert_eq!((back.points, back.curves), (all.points, all.curves));
    }
    let none = Isophotes { width: 4, height: 4, ..Isophotes::default() };
    assert_eq!(decode_isophotes(&encode_isophotes(&none)).unwrap(), none);
}

#[test]
fn files_of_version_2_are_read() {
    // A curve of two points in version 2: the same bits, with magnitudes in eighths of an octave.
    let all = Isophotes {
        width: 9,
        height: 9,
        levels: vec![1.0],
        curves: vec![Curve { level: 0, closed: false, len: 2 }],
        points: vec![[1.0, 0.5], [2.0, 0.75]],
        gradients: vec![[0.0, 2.0_f32.powi(9)]; 2],
        ..Isophotes::default()
    };
    let mut bytes = encode_isophotes(&all);
    assert_eq!(bytes[4], 3);
    bytes[4] = 2;
    let old = decode_isophotes(&bytes).unwrap();
    let (ours, theirs) = (decode_isophotes(&encode_isophotes(&all)).unwrap(), old.gradients[0]);
    assert_eq!((old.points, old.curves), (all.points, all.curves));
    // 81 ninths are nine octaves; 81 eighths are an eighth more than ten.
    let size = |g: [f32; 2]| g[0].hypot(g[1]).log2();
    assert!((size(ours.gradients[0]) - 9.0).abs() < 1e-5 && (size(theirs) - 81.0 / 8.0).abs() < 1e-5);
}

#[test]
fn damaged_files_are_refused_and_never_panic() {
    assert!(decode_isophotes(b"").unwrap_err().contains("fISO"));
    assert!(decode_isophotes(b"fISO\x09").unwrap_err().contains("version 9"));
    assert!(decode_isophotes(b"fISO\x03abc").unwrap_err().contains("header"));
    let bytes = encode_isophotes(&Isophotes::trial(&mut Rng::new(1)));
    assert!(decode_isophotes(&bytes[..bytes.len() - 4]).unwrap_err().contains("damaged"));
    let levels = encode_isophotes(&Isophotes { levels: vec![f32::NAN], ..Isophotes::default() });
    assert!(decode_isophotes(&levels).is_err());
    // A step that is too large, and sizes without their bytes.
    let far = Isophotes {
        width: 9,
        height: 9,
        levels: vec![1.0],
        points: vec![[0.0; 2], [900.0, 0.0]],
        ..Isophotes::default()
    };
    let far = Isophotes {
        curves: vec![Curve { level: 0, closed: false, len: 2 }],
        gradients: vec![[1.0; 2]; 2],
        ..far
    };
    assert!(decode_isophotes(&encode_isophotes(&far)).unwrap_err().contains("damaged"));
    let wide = Isophotes { width: 1 << 20, height: 1 << 20, ..Isophotes::default() };
    assert!(decode_isophotes(&encode_isophotes(&wide)).unwrap_err().contains("header"));
    let mut huge = bytes.clone();
    huge[21..25].fill(0xFF);
    assert!(decode_isophotes(&huge).unwrap_err().contains("header"));
    let mut rng = Rng::new(2);
    for _ in 0..3000 {
        let mut bad = bytes.clone();
        for _ in 0..1 + rng.below(4) {
            let at = rng.below(bad.len());
            bad[at] = rng.below(256) as u8;
        }
        bad.truncate(bad.len() - rng.below(3));
        if let Ok(back) = decode_isophotes(&bad) {
            assert_eq!((back.points.len(), back.gradients.len()), (back.points.len(), back.points.len()));
        }
    }
}
