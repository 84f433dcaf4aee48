use super::*;
use crate::core::random::Rng;
use crate::texture::{LumaKind, Surface, decode_isophotes, encode_isophotes};

fn luma(width: usize, height: usize, wrap: Wrap, f: impl FnMut(usize, usize) -> f32) -> Luma {
    let surface = Surface { wrap, ..Surface::default() };
    Luma { grid: Grid::from_fn(width, height, f), holes: Vec::new(), kind: LumaKind::Lstar, surface }
}

fn noise(width: usize, height: usize, wrap: Wrap) -> Luma {
    let mut rng = Rng::new(5);
    luma(width, height, wrap, |_, _| rng.between(0.0, 100.0) as f32)
}

fn exact(levels: Vec<f32>) -> Drawing {
    Drawing { levels: Levels::These(levels), pre_blur: 0.0, simplify: 0.0, ..Drawing::default() }
}

#[test]
fn a_ramp_has_straight_curves_and_its_slope() {
    let ramp = luma(30, 20, Wrap::Clamp, |x, y| 2.0 * x as f32 + 0.5 * y as f32);
    let found = isophotes(&ramp, &exact(vec![20.3, 31.7])).unwrap();
    assert_eq!(found.curves.len(), 2);
    for (curve, points, gradients) in found.iter() {
        for (p, g) in points.iter().zip(gradients) {
            let inside = p[0] > 1.0 && p[0] < 28.0 && p[1] > 1.0 && p[1] < 18.0;
            if inside {
                let level = found.levels[usize::from(curve.level)];
                assert!((2.0 * p[0] + 0.5 * p[1] - level).abs() < 1e-4);
                assert!((g[0] - 2.0).abs() < 1e-5 && (g[1] - 0.5).abs() < 1e-5);
            }
        }
        // The border continues for one pixel: from row -1 to row 20.
        let ends = [points[0][1], points[points.len() - 1][1]];
        assert!(ends.contains(&-1.0) && ends.contains(&20.0), "{ends:?}");
    }
    let short = isophotes(&ramp, &Drawing { simplify: 0.25, ..exact(vec![20.3]) }).unwrap();
    assert!(short.points.len() <= 6, "{:?}", short.points);
}

#[test]
fn quantiles_divide_the_pixels_evenly() {
    let image = noise(128, 96, Wrap::Repeat);
    let found = isophotes(&image, &Drawing { pre_blur: 0.0, ..Drawing::default() }).unwrap();
    for (k, level) in found.levels.iter().enumerate() {
        let below = image.grid.samples.iter().filter(|x| *x <= level).count();
        let wanted = (k as f64 + 0.5) / 8.0 * (128.0 * 96.0);
        assert!((below as f64 - wanted).abs() < 3.0, "{k}: {below} for {wanted}");
    }
    let drawing = Drawing { levels: Levels::Uniform(5), pre_blur: 0.0, ..Drawing::default() };
    let even = isophotes(&image, &drawing).unwrap().levels;
    for (k, level) in even.iter().enumerate() {
        assert!((level - (2.0 + 24.0 * k as f32)).abs() < 0.8, "{even:?}");
    }
}

#[test]
fn a_repeated_image_has_no_seam() {
    let wave = |x: usize, y: usize| {
        let turn = std::f32::consts::TAU / 32.0;
        (turn * x as f32).sin() + (turn * 2.0 * y as f32).cos()
    };
    let tile = isophotes(&luma(32, 32, Wrap::Repeat, wave), &Drawing::default()).unwrap();
    assert!(tile.is_torus() && tile.curves.iter().all(|curve| curve.closed));
    // The same periodic surface with another origin has the same curves.
    let shifted =
        isophotes(&luma(32, 32, Wrap::Repeat, |x, y| wave(x + 13, y + 7)), &Drawing::default()).unwrap();
    let length = |all: &Isophotes| {
        let step = |p: &[[f32; 2]]| f64::from((p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1]));
        all.iter().flat_map(|(_, points, _)| points.windows(2)).map(step).sum::<f64>()
    };
    assert!((length(&tile) / length(&shifted) - 1.0).abs() < 0.005);
}

#[test]
fn a_straight_line_around_a_periodic_image_is_a_curve() {
    let joints = luma(40, 24, Wrap::Repeat, |x, _| if x % 20 < 3 { 20.0 } else { 70.0 });
    let drawing = Drawing { levels: Levels::These(vec![45.0]), ..Drawing::default() };
    let found = isophotes(&joints, &drawing).unwrap();
    assert_eq!((found.curves.len(), found.points.len()), (4, 8), "{:?}", found.curves);
    for (curve, points, _) in found.iter() {
        assert!(curve.closed && points[0][0] == points[1][0] && (points[1][1] - points[0][1]).abs() == 24.0);
    }
    assert_eq!(decode_isophotes(&encode_isophotes(&found)).unwrap().points, found.points);
}

#[test]
fn holes_have_no_curves_and_do_not_change_their_surroundings() {
    let mut image = luma(32, 32, Wrap::Clamp, |x, _| 50.0 + x as f32);
    image.holes =
        (0..32 * 32).map(|k| (12..20).contains(&(k % 32)) && (12..20).contains(&(k / 32))).collect();
    for (x, hole) in image.grid.samples.iter_mut().zip(&image.holes) {
        *x = if *hole { 0.0 } else { *x };
    }
    let drawing = Drawing { levels: Levels::These(vec![65.5, 58.5]), simplify: 0.0, ..Drawing::default() };
    let found = isophotes(&image, &drawing).unwrap();
    for (_, points, gradients) in found.iter() {
        for (p, g) in points.iter().zip(gradients) {
            assert!(!(p[0] > 12.0 && p[0] < 19.0 && p[1] > 12.0 && p[1] < 19.0), "in the hole: {p:?}");
            if p[0] > 4.0 && p[0] < 27.0 {
                assert!(g[0] > 0.2 && g[0] < 1.3 && g[1].abs() < 0.4, "{p:?} {g:?}");
            }
        }
    }
    assert_eq!(found.curves.len(), 3, "one level crosses the hole, the other does not");
    // NaN pixels are holes as well.
    image.holes.clear();
    image.grid.samples[5 * 32 + 5] = f32::NAN;
    assert!(isophotes(&image, &drawing).unwrap().gradients.iter().flatten().all(|g| g.is_finite()));
}

#[test]
fn simplified_curves_are_within_the_tolerance() {
    let image = noise(160, 120, Wrap::Repeat);
    let all = isophotes(&image, &Drawing { simplify: 0.0, ..Drawing::default() }).unwrap();
    let short = isophotes(&image, &Drawing::default()).unwrap();
    let blurred = smooth_masked(&image.grid, &[], &Kernel::gaussian(1.0, 4.0), Wrap::Repeat);
    let floor = MIN_GRADIENT * rms_gradient(&blurred, Wrap::Repeat);
    let mut left = short.iter().peekable();
    let (mut dropped, mut max) = (0, [0.0_f64; 2]);
    for (curve, points, _) in all.iter() {
        // Points half-way between two steps have too few digits for a unique rounding.
        let clear =
            |p: &&[f32; 2]| p.iter().all(|x| ((f64::from(*x) * STEPS).fract().abs() - 0.5).abs() > 1e-3);
        let round = |p: &[f32; 2]| p.map(|x| (f64::from(x) * STEPS).round() / STEPS);
        let whole: Vec<[f64; 2]> = points.iter().filter(clear).map(round).collect();
        // Every other point of the simplified curve is one of this curve.
        let matched =
            left.peek().filter(|(other, ..)| other.level == curve.level).and_then(|(_, simplified, _)| {
                let mut at = 0;
                let mut find = |p: &[f32; 2]| {
                    at += whole[at..].iter().position(|q| *q == p.map(f64::from))?;
                    Some(at)
                };
                let found: Vec<Option<usize>> = simplified.iter().map(&mut find).collect();
                let missing = found.iter().filter(|k| k.is_none()).count();
                (2 * missing < simplified.len()).then_some(found)
            });
        let Some(indices) = matched else {
            let size = |i: usize| {
                let along = || whole.iter().map(|p| p[i]);
                along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min)
            };
            assert!(
                curve.closed && size(0).min(size(1)) < 0.6,
                "a curve of {} x {} px is gone: {curve:?} {whole:?} {:?}",
                size(0),
                size(1),
                left.peek()
            );
            dropped += 1;
            continue;
        };
        let (_, simplified, slopes) = left.next().unwrap();
        let ends = indices.windows(2).zip(simplified.windows(2)).zip(slopes.windows(2));
        for ((span, ends), slopes) in ends {
            let &[Some(from), Some(to)] = span else { continue };
            let ends = [0, 1].map(|k| ends[k].map(f64::from));
            let step = [0, 1].map(|i| ends[1][i] - ends[0][i]);
            for p in &whole[from..=to] {
                let off = [0, 1].map(|i| p[i] - ends[0][i]);
                let t = (off[0] * step[0] + off[1] * step[1]) / (step[0] * step[0] + step[1] * step[1]);
                let t = t.clamp(0.0, 1.0);
                let far = (off[0] - t * step[0]).hypot(off[1] - t * step[1]);
                let right = slope(&blurred, Wrap::Repeat, *p).map(f64::from);
                let miss = [0, 1].map(|i| {
                    let [a, b] = [0, 1].map(|k| f64::from(slopes[k][i]));
                    a + t * (b - a) - right[i]
                });
                let error = miss[0].hypot(miss[1]) / right[0].hypot(right[1]).max(floor);
                max = [max[0].max(far), max[1].max(error)];
            }
        }
    }
    assert!(left.next().is_none(), "every simplified curve has an exact one");
    println!(
        "{} of {} points, {dropped} small rings dropped, errors {max:?}",
        short.points.len(),
        all.points.len()
    );
    assert!(max[0] <= 0.25 + 1e-9 && max[1] <= 0.05 + 1e-5, "{max:?}");
    assert!(short.points.len() < all.points.len() && dropped * 20 < all.curves.len());
}

#[test]
fn points_have_the_gradient_at_their_position() {
    // The Sobel operator with bilinear interpolation is exact for a quadratic function.
    let (a, b, c) = (0.05, 0.03, -0.02);
    let image = luma(60, 50, Wrap::Clamp, |x, y| {
        let (x, y) = (x as f32, y as f32);
        a * x * x + b * x * y + c * y * y + 0.7 * x - 0.4 * y
    });
    for simplify in [0.0, 0.25] {
        let found = isophotes(&image, &Drawing { simplify, ..exact(vec![10.0, 45.0, 90.0]) }).unwrap();
        let mut count = 0;
        for (_, points, gradients) in found.iter() {
            for ([x, y], g) in points.iter().zip(gradients) {
                if *x >= 1.0 && *x <= 58.0 && *y >= 1.0 && *y <= 48.0 {
                    let right = [2.0 * a * x + b * y + 0.7, b * x + 2.0 * c * y - 0.4];
                    assert!((0..2).all(|i| (g[i] - right[i]).abs() < 1e-4), "{x} {y}: {g:?} {right:?}");
                    count += 1;
                }
            }
        }
        assert!(count >= 10, "{count}");
    }
}

#[test]
fn invalid_images_are_refused_and_a_flat_one_has_no_curves() {
    let flat = luma(8, 8, Wrap::Repeat, |_, _| 40.0);
    assert_eq!(isophotes(&flat, &Drawing::default()).unwrap().curves, []);
    let outside = isophotes(&flat, &exact(vec![50.0]));
    assert_eq!(outside, Err(IsophotesError::Outside { count: 1, low: 40.0, high: 40.0 }));
    let thin = luma(8, 1, Wrap::Repeat, |x, _| x as f32);
    assert_eq!(isophotes(&thin, &Drawing::default()), Err(IsophotesError::TooSmall(8, 1)));
    let mut short = flat;
    short.grid.samples.pop();
    assert_eq!(isophotes(&short, &Drawing::default()), Err(IsophotesError::Damaged(8, 8, 63)));
    let two = luma(2, 2, Wrap::Repeat, |x, y| (x + y) as f32);
    assert!(!isophotes(&two, &exact(vec![0.5])).unwrap().curves.is_empty());
}

#[test]
fn the_number_of_threads_does_not_change_the_result() {
    let image = noise(150, 140, Wrap::Mirror);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| isophotes(&image, &Drawing::default()).unwrap())
    };
    assert!(with(1) == with(3));
}
