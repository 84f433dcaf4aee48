use super::*;
use crate::texture::{Grid, LumaKind, Surface};
use std::f64::consts::TAU;

fn luma(mut tone: impl FnMut(usize, usize) -> f64) -> Luma {
    let grid = Grid::from_fn(512, 512, |x, y| tone(x, y).round().clamp(0.0, 255.0) as f32);
    Luma { grid, holes: Vec::new(), kind: LumaKind::Rec601, surface: Surface::default() }
}

fn normal(rng: &mut Rng) -> f64 {
    (-2.0 * (1.0 - rng.uniform()).ln()).sqrt() * (TAU * rng.uniform()).cos()
}

/// Tiles of one tone, with joints of another on 6 % of the pixels.
fn tile(x: usize, y: usize) -> f64 {
    if x % 66 < 2 || y % 66 < 2 { 60.0 } else { 200.0 }
}

#[test]
fn unstretched_bandwidths_are_those_of_the_table() {
    let mut rng = Rng::new(2);
    let near = |luma: &Luma, expected: f64| {
        let b = f64::from(bandwidth(&histogram(luma)));
        assert!((b / expected - 1.0).abs() < 0.03, "{b} against {expected}");
    };
    near(&luma(tile), 0.0049);
    near(&luma(|x, y| tile(x, y) + 4.0 * normal(&mut rng)), 0.082);
    for (sd, b) in [(4.0, 0.065), (8.0, 0.129), (16.0, 0.259), (32.0, 0.514)] {
        near(&luma(|_, _| 128.0 + sd * normal(&mut rng)), b);
    }
    near(&luma(|_, _| (256.0 * rng.uniform()).floor()), 0.9995);
    near(&luma(|_, _| 77.0), 1.0 / 256.0);
}

#[test]
fn bandwidth_does_not_depend_on_order_or_brightness_and_holes_do_not_count() {
    let image = luma(|x, y| 60.0 + ((x * 31 + y * 17) % 83) as f64);
    let b = classify(&image, 0.2, None).bandwidth;
    let mut other = image.clone();
    let mut rng = Rng::new(4);
    (1..other.grid.samples.len()).rev().for_each(|k| other.grid.samples.swap(k, rng.below(k + 1)));
    other.grid.samples.iter_mut().for_each(|x| *x += 40.0);
    assert_eq!(classify(&other, 0.2, None).bandwidth, b);
    let mut pierced = luma(tile);
    pierced.grid.samples[..512].fill(0.0);
    pierced.holes = vec![false; 512 * 512];
    pierced.holes[..512].fill(true);
    assert_eq!(histogram(&pierced)[0], 0);
}

#[test]
fn the_threshold_separates_simple_from_complex_unless_the_class_is_given() {
    let simple = luma(tile);
    assert_eq!(classify(&simple, THRESHOLD, None).class, Class::Simple);
    assert_eq!(classify(&simple, THRESHOLD, Some(Class::Complex)).class, Class::Complex);
    let ramp = luma(|x, _| x as f64 / 2.0);
    assert_eq!(classify(&ramp, THRESHOLD, None).class, Class::Complex);
    let svg = classify(&ramp, THRESHOLD, None).plot().unwrap();
    assert!(svg.contains("(complex; simple below 0.5)") && svg.matches("<rect").count() > 200, "{svg}");
}

#[test]
fn lightness_is_counted_over_its_own_range() {
    let mut image = luma(|_, _| 100.0);
    image.kind = LumaKind::Lstar;
    assert_eq!(histogram(&image)[255], 512 * 512);
}

#[test]
fn stretched_bandwidths_do_not_depend_on_contrast() {
    let stretched = |luma: &Luma| f64::from(classify(luma, THRESHOLD, None).bandwidth);
    let near = |luma: &Luma, expected: f64| {
        let b = stretched(luma);
        assert!((b / expected - 1.0).abs() < 0.03, "{b} against {expected}");
    };
    let mut rng = Rng::new(2);
    near(&luma(|_, _| (256.0 * rng.uniform()).floor()), 0.99);
    for sd in [4.0, 8.0, 16.0, 32.0] {
        near(&luma(|_, _| 128.0 + sd * normal(&mut rng)), 0.82);
    }
    near(&luma(|x, y| tile(x, y) + 4.0 * normal(&mut rng)), 0.129);
    near(&luma(|_, _| 77.0), 1.0 / 256.0);
    // Two tones are two tones, however near.
    for contrast in [1.0, 0.1, 1.0 / 140.0] {
        near(&luma(|x, y| 100.0 + contrast * (tile(x, y) - 100.0)), 0.0049);
    }
}

/// Images with their class: those of the project, and those of the data beside the repository.
const IMAGES: [(&str, Class); 12] = [
    ("../graphs/assets/images/sk_gravel.png", Class::Complex),
    ("../graphs/assets/images/grass.png", Class::Complex),
    ("../graphs/assets/images/sk_brick.png", Class::Simple),
    ("../graphs/assets/images/tiles.png", Class::Simple),
    ("../../shared/data/images/ad_city_tile.png", Class::Complex),
    ("../../shared/data/images/ad_cloth_awning.png", Class::Complex),
    ("../../shared/data/images/ad_wood_logs.png", Class::Complex),
    ("../../shared/data/images/re_stone01-c.png", Class::Complex),
    ("../../shared/data/images/re_brick01.png", Class::Simple),
    ("../../shared/data/images/re_floor01.png", Class::Simple),
    ("../../shared/data/images/re_tile09_treadplate.png", Class::Simple),
    ("../../shared/data/images/re_stone01-c_z.png", Class::Simple),
];

#[test]
fn an_image_has_one_class_and_one_bandwidth_at_any_contrast() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    for (file, class) in IMAGES {
        let Ok(bytes) = std::fs::read(folder.join(file)) else {
            assert!(!file.starts_with("../graphs"), "{file}");
            continue;
        };
        let picture = crate::texture::decode::decode(&bytes).unwrap();
        let image = Luma::new(&picture, LumaKind::Lstar, false, Surface::default()).unwrap();
        let found = classify(&image, THRESHOLD, None);
        assert_eq!(found.class, class, "{file}: {}", found.bandwidth);
        for contrast in [0.5, 0.25, 0.125] {
            // In luminance, and in codes of 8 bits.
            let mut low = image.clone();
            low.grid.samples.iter_mut().for_each(|x| *x = 50.0 + contrast * (*x - 50.0));
            let mut coded = low.clone();
            coded.grid.samples.iter_mut().for_each(|x| *x = (*x * 2.55).round() / 2.55);
            // The fewer codes, the rougher: those of gravel are many, those of bricks a dozen at an eighth.
            let coded_most = if file.ends_with("gravel.png") { 0.05 } else { 0.12 };
            let coded = (coded, coded_most);
            for (low, most) in
                std::iter::once((low, 0.05)).chain(file.starts_with("../graphs").then_some(coded))
            {
                let low = classify(&low, THRESHOLD, None);
                let ratio = low.bandwidth / found.bandwidth;
                assert_eq!(
                    low.class, class,
                    "{file} at {contrast}: {} of {}",
                    low.bandwidth, found.bandwidth
                );
                // The few tones of tiles differ by half a bin.
                let bins = (low.bandwidth - found.bandwidth).abs() * BINS as f32;
                assert!((ratio - 1.0).abs() < most || bins < 1.0, "{file} at {contrast}: {ratio}");
            }
        }
    }
}
