use super::*;
use crate::crumple::BuckleDetector;
use crate::curvature::scenes::{Scene, crumpled, grid, moved, paraboloid};
use crate::curvature::{Curvature, MeanCurvature, Method};
use proptest::prelude::*;

fn events_of(
    scene: &Scene,
    frames: &[Vec<[f64; 3]>],
    materials: &[u16],
    params: CrumpleParams,
) -> Vec<(i64, Crumple)> {
    events_above(scene, frames, materials, params, 0.0)
}

fn events_above(
    scene: &Scene,
    frames: &[Vec<[f64; 3]>],
    materials: &[u16],
    params: CrumpleParams,
    h_eps: f64,
) -> Vec<(i64, Crumple)> {
    let n = scene.points.len();
    let mut measure = MeanCurvature::new(&scene.topology(), Method::Cotan).unwrap();
    let mut detector = BuckleDetector::new(n, 60.0, h_eps);
    let mut events = CrumpleEvents::new(&scene.topology(), materials, params).unwrap();
    let (mut bent, mut labels) = (vec![Curvature::default(); n], vec![Buckle::default(); n]);
    for (frame, points) in (0..).zip(frames) {
        measure.measure(points, &mut bent).unwrap();
        detector.detect(&bent, &mut labels);
        events.add_frame(frame, &labels);
    }
    events.finish();
    std::iter::from_fn(|| events.next_before(i64::MAX)).collect()
}

const PAPER: CrumpleParams = CrumpleParams { weight: Weight::None, merge_frames: 0, e_min: 0.0, only: None };
const AREA: CrumpleParams = CrumpleParams { weight: Weight::Area, ..PAPER };

#[test]
fn an_inverted_bowl_is_one_event_of_known_energy() {
    let (bowl, dome) = (paraboloid(1.3), paraboloid(-1.3));
    let frames = [bowl.points.clone(), dome.points];
    let found = events_of(&bowl, &frames, &[], PAPER);
    assert_eq!(found.len(), 1);
    let (frame, event) = found[0];
    assert_eq!((frame, event.vertices, event.sign, event.id), (1, 1521, -1, 42));
    assert!((event.energy / 1.026_419e7 - 1.0).abs() < 1e-6, "{}", event.energy);
    let found = events_of(&bowl, &frames, &[], AREA);
    assert!((found[0].1.energy - 4.961_31).abs() < 1e-5, "{}", found[0].1.energy);
    // Its position is the middle, its normal points up.
    let event = found[0].1;
    assert!(event.position[0].abs() < 1e-6 && event.position[1].abs() < 1e-6 && event.position[2] > 0.0);
    assert!((event.normal[2] - 1.0).abs() < 1e-6);
}

#[test]
fn area_weights_make_energies_independent_of_the_resolution_of_the_mesh() {
    let bowl = |n: usize, q: f64| {
        grid(n, n, true, |u, v| [u - 0.5, v - 0.5, -0.5 * q * ((u - 0.5).powi(2) + (v - 0.5).powi(2))])
    };
    let energy = |n, params| {
        let scene = bowl(n, 1.3);
        events_of(&scene, &[scene.points.clone(), bowl(n, -1.3).points], &[], params)[0].1.energy
    };
    let (coarse, fine) = (energy(41, PAPER), energy(81, PAPER));
    assert!((16.0..17.5).contains(&(fine / coarse)), "{}", fine / coarse);
    let (coarse, fine) = (energy(41, AREA), energy(81, AREA));
    assert!((coarse - 4.961).abs() < 1e-3 && (fine - 5.200).abs() < 1e-3, "{coarse} {fine}");
    // The excluded hem shrinks like the edges: the limit is the square of twice the integral of H over the bowl,
    // H dA = q (2 + g^2) / (2 (1 + g^2)) dx dy with g = q r.
    let coordinate = |k: usize| (k as f64 + 0.5) / 400.0 - 0.5;
    let bent = |k: usize| {
        let square = 1.69 * (coordinate(k % 400).powi(2) + coordinate(k / 400).powi(2));
        1.3 * (2.0 + square) / (2.0 * (1.0 + square)) / 160_000.0
    };
    let limit = (2.0 * (0..160_000).map(bent).sum::<f64>()).powi(2);
    let found = (2.0 * fine.sqrt() - coarse.sqrt()).powi(2);
    assert!((limit - 5.445).abs() < 1e-3 && (found - limit).abs() < 2e-3, "{found} for {limit}");
}

#[test]
fn an_inverted_sine_sheet_buckles_twice_outwards_and_three_times_inwards() {
    let sheet = |sign: f64| {
        grid(81, 41, true, |u, v| [u, v, sign * 0.01 * (4.0 * std::f64::consts::PI * u + 0.3).sin()])
    };
    let found = events_of(&sheet(1.0), &[sheet(1.0).points, sheet(-1.0).points], &[], AREA);
    let count = |sign| found.iter().filter(|(_, e)| e.sign == sign).count();
    assert_eq!((count(1), count(-1)), (2, 3), "{found:?}");
}

#[test]
fn components_stay_within_their_material_and_weak_events_are_dropped() {
    let (bowl, dome) = (paraboloid(1.3), paraboloid(-1.3));
    let frames = [bowl.points.clone(), dome.points];
    let materials: Vec<u16> = (0..41 * 41).map(|v| if v % 41 < 20 { 3 } else { 5 }).collect();
    let found = events_of(&bowl, &frames, &materials, PAPER);
    let of: Vec<_> = found.iter().map(|(_, e)| (e.material, e.vertices)).collect();
    assert_eq!(of, [(3, 19 * 39), (5, 20 * 39)]);
    assert!(events_of(&bowl, &frames, &[], CrumpleParams { e_min: 1.1e7, ..PAPER }).is_empty());
    assert_eq!(events_of(&bowl, &frames, &[], CrumpleParams { e_min: 1.0e7, ..PAPER }).len(), 1);
}

/// Labels on a strip of `n` squares, two rows of vertices; one list of columns per frame.
fn strip(frames: &[&[(usize, i8)]], merge_frames: usize) -> Vec<(i64, Crumple)> {
    let n = 12;
    let scene = grid(n, 2, false, |u, v| [u, v, 0.0]);
    let params = CrumpleParams { merge_frames, ..PAPER };
    let mut events = CrumpleEvents::new(&scene.topology(), &[], params).unwrap();
    for (frame, columns) in (0..).zip(frames) {
        let mut labels = vec![Buckle { area: 1.0, ..Buckle::default() }; 2 * n];
        for &(column, size) in *columns {
            let (label, delta) = (size.signum(), f64::from(size));
            labels[column] = Buckle { label, delta, area: 1.0, ..Buckle::default() };
        }
        events.add_frame(frame, &labels);
    }
    events.finish();
    std::iter::from_fn(|| events.next_before(i64::MAX)).collect()
}

fn facts(found: &[(i64, Crumple)]) -> Vec<(i64, u32, f64, u32)> {
    found.iter().map(|(frame, e)| (*frame, e.id, e.energy, e.vertices)).collect()
}

#[test]
fn buckling_over_several_frames_is_one_event() {
    let frames: [&[(usize, i8)]; 6] = [&[(2, 1)], &[(3, 2), (8, 1)], &[(4, 1)], &[], &[(5, 1)], &[(6, -1)]];
    // The paper: every frame on its own.
    assert_eq!(facts(&strip(&frames, 0)).len(), 6);
    // Frames 0 to 2 are one event at its strongest frame; the gap in frame 3 ends it; signs do not mix.
    let want = [(1, 2, 16.0, 3), (1, 8, 1.0, 1), (4, 5, 1.0, 1), (5, 6, 1.0, 1)];
    assert_eq!(facts(&strip(&frames, 5)), want);
    // A window of one more frame ends the first event after frame 1.
    let want = [(1, 2, 9.0, 2), (1, 8, 1.0, 1), (2, 4, 1.0, 1), (4, 5, 1.0, 1), (5, 6, 1.0, 1)];
    assert_eq!(facts(&strip(&frames, 1)), want);
}

#[test]
fn events_that_touch_are_merged() {
    let frames: [&[(usize, i8)]; 3] = [&[(2, 1), (6, 1)], &[(3, 1), (5, 1)], &[(4, 3)]];
    assert_eq!(facts(&strip(&frames, 4)), [(2, 2, 49.0, 5)]);
    let apart: [&[(usize, i8)]; 2] = [&[(2, 1), (8, 1)], &[(3, 1)]];
    assert_eq!(facts(&strip(&apart, 4)), [(0, 2, 4.0, 2), (0, 8, 1.0, 1)]);
}

/// Frames of a sheet with moving folds, so that many vertices buckle.
fn wandering(seed: u64, n: usize, frames: usize) -> (Scene, Vec<Vec<[f64; 3]>>) {
    let (a, b) = (crumpled(n, seed), crumpled(n, seed + 1));
    let blend = |k: usize| {
        let w = k as f64 / (frames - 1) as f64;
        let at = |(p, q): (&[f64; 3], &[f64; 3])| [p[0], p[1], (1.0 - w) * p[2] + w * q[2]];
        a.points.iter().zip(&b.points).map(at).collect()
    };
    let frames = (0..frames).map(blend).collect();
    (a, frames)
}

#[test]
fn components_equal_those_of_a_depth_first_search() {
    let (scene, frames) = wandering(3, 30, 3);
    let n = scene.points.len();
    let mut measure = MeanCurvature::new(&scene.topology(), Method::Cotan).unwrap();
    let (mut detector, mut bent) = (BuckleDetector::new(n, 60.0, 0.0), vec![Curvature::default(); n]);
    let mut labels = vec![Buckle::default(); n];
    let mut events = CrumpleEvents::new(&scene.topology(), &[], PAPER).unwrap();
    let neighbours = OneRings::new(&scene.topology()).unwrap();
    for (frame, points) in (0..).zip(&frames) {
        measure.measure(points, &mut bent).unwrap();
        detector.detect(&bent, &mut labels);
        events.add_frame(frame, &labels);
        let mut visited = vec![false; n];
        let mut plain = Vec::new();
        for start in 0..n as u32 {
            if labels[start as usize].label == 0 || std::mem::replace(&mut visited[start as usize], true) {
                continue;
            }
            let (mut stack, mut sum, mut count) = (vec![start], 0.0, 0);
            while let Some(v) = stack.pop() {
                sum += labels[v as usize].delta;
                count += 1;
                for &w in neighbours.of(v) {
                    let same = labels[w as usize].label == labels[start as usize].label;
                    if same && !std::mem::replace(&mut visited[w as usize], true) {
                        stack.push(w);
                    }
                }
            }
            plain.push((start, count, sum * sum));
        }
        let found: Vec<_> = std::iter::from_fn(|| events.next_before(i64::MAX)).map(|e| e.1).collect();
        assert_eq!(found.len(), plain.len());
        for (a, (id, count, energy)) in found.iter().zip(plain) {
            assert!((a.id, a.vertices) == (id, count) && (a.energy - energy).abs() <= 1e-9 * energy);
        }
    }
}

#[test]
fn the_energy_is_the_square_of_the_sum_of_magnitudes_to_the_last_bit() {
    // All changes of one event have one sign, and a sum of negative numbers is rounded as that of their magnitudes is.
    let (mut events, mut several, mut both) = (0, 0, 0);
    for (seed, merge_frames) in [(3, 0), (11, 0), (29, 0), (3, 3)] {
        let (scene, frames) = wandering(seed, 40, 8);
        let n = scene.points.len();
        let mut measure = MeanCurvature::new(&scene.topology(), Method::Cotan).unwrap();
        let (mut detector, mut bent) = (BuckleDetector::new(n, 60.0, 0.0), vec![Curvature::default(); n]);
        let mut labels = vec![Buckle::default(); n];
        let mut paper =
            CrumpleEvents::new(&scene.topology(), &[], CrumpleParams { merge_frames, ..PAPER }).unwrap();
        let mut area =
            CrumpleEvents::new(&scene.topology(), &[], CrumpleParams { merge_frames, ..AREA }).unwrap();
        // Of each component, in the order of its vertices: magnitudes alone, and times area.
        let mut magnitudes = Vec::new();
        for (frame, points) in (0..).zip(&frames) {
            measure.measure(points, &mut bent).unwrap();
            detector.detect(&bent, &mut labels);
            paper.add_frame(frame, &labels);
            area.add_frame(frame, &labels);
            let mut sums = vec![(0, 0.0, 0.0); paper.components.found.len()];
            for &v in &paper.components.labelled {
                let (sum, b) = (&mut sums[paper.components.of(v)], &labels[v as usize]);
                *sum = (sum.0 + 1_u32, sum.1 + b.delta.abs(), sum.2 + b.area * b.delta.abs());
            }
            for (part, sum) in paper.components.found.iter().zip(&sums) {
                assert_eq!(part.sums.magnitude, part.sums.change.abs());
                assert_eq!((part.sums.magnitude, part.sums.weighted.abs()), (sum.1, sum.2));
            }
            magnitudes.extend(sums);
            // Over both signs it is not so: the paper's second form holds for one event only.
            let all = |f: &dyn Fn(f64) -> f64| labels.iter().map(|b| f(b.delta)).sum::<f64>();
            both += usize::from(all(&|x| x).abs() < 0.9 * all(&f64::abs));
        }
        let all = |events: &mut CrumpleEvents| -> Vec<Crumple> {
            events.finish();
            std::iter::from_fn(|| events.next_before(i64::MAX)).map(|e| e.1).collect()
        };
        let (paper, area) = (all(&mut paper), all(&mut area));
        if merge_frames == 0 {
            assert_eq!((paper.len(), area.len()), (magnitudes.len(), magnitudes.len()));
            for ((paper, area), (count, plain, weighted)) in paper.iter().zip(&area).zip(magnitudes) {
                assert_eq!(
                    (paper.vertices, paper.energy, area.energy),
                    (count, plain * plain, weighted * weighted)
                );
                several += usize::from(count > 1);
            }
        }
        events += paper.len();
    }
    assert!(events > 100 && several > 50 && both > 10, "{events} {several} {both}");
}

/// A bowl of curvature 0.24 1/m with edges of 25 mm and up to 0.1 mm of noise per vertex and frame.
fn trembling(frames: u64) -> (Scene, Vec<Vec<[f64; 3]>>) {
    let bowl = grid(33, 33, true, |u, v| {
        let (x, y) = (0.8 * (u - 0.5), 0.8 * (v - 0.5));
        [x, y, -0.12 * (x * x + y * y)]
    });
    let random = crate::core::random::Random::new(11, "tremble");
    let offset = |t: u64, v: u32, k: u32| 1e-4 * (2.0 * random.uniform(v, t, k) - 1.0);
    let frame = |t| {
        (0..).zip(&bowl.points).map(|(v, p)| [0, 1, 2].map(|k| p[k as usize] + offset(t, v, k))).collect()
    };
    let frames = (0..frames).map(frame).collect();
    (bowl, frames)
}

#[test]
fn a_tenth_of_a_millimetre_of_noise_gives_two_hundred_events_a_frame_and_a_dead_band_removes_them() {
    let (scene, frames) = trembling(9);
    let h_eps = 3.0 * 0.207;
    let count = |h_eps| {
        let found = events_above(&scene, &frames, &[], PAPER, h_eps);
        (found.len() as f64 / 8.0, found.iter().map(|(_, e)| e.energy).fold(0.0, f64::max))
    };
    let (false_ones, strongest) = count(0.0);
    assert!(
        (150.0..250.0).contains(&false_ones) && (2.0..160.0).contains(&strongest),
        "{false_ones} {strongest}"
    );
    assert!(count(h_eps).0 < 1.0);
}

#[test]
fn events_do_not_depend_on_the_numbering_of_vertices_and_triangles() {
    let mut events = 0;
    for (seed, params) in [(5, PAPER), (8, AREA), (13, CrumpleParams { merge_frames: 2, ..PAPER })] {
        let (scene, frames) = wandering(seed, 40, 6);
        let n = scene.points.len();
        // 1601 is prime: multiplied by 100 modulo it, 1 to 1600 are permuted.
        let new_index = |old: usize| (old + 1) * 100 % 1601 - 1;
        let permute = |points: &Vec<[f64; 3]>| {
            let mut out = vec![[0.0; 3]; n];
            points.iter().enumerate().for_each(|(old, p)| out[new_index(old)] = *p);
            out
        };
        let turned = |t: &[u32; 3]| [t[1], t[2], t[0]].map(|v| new_index(v as usize) as u32);
        let other = Scene {
            points: permute(&scene.points),
            triangles: scene.triangles.iter().rev().map(turned).collect(),
        };
        let sorted = |scene: &Scene, frames: &[Vec<[f64; 3]>]| {
            let mut found = events_of(scene, frames, &[], params);
            found.sort_by(|(f, a), (g, b)| {
                (f, a.sign, a.vertices).cmp(&(g, b.sign, b.vertices)).then(a.energy.total_cmp(&b.energy))
            });
            found
        };
        let (a, b) =
            (sorted(&scene, &frames), sorted(&other, &frames.iter().map(permute).collect::<Vec<_>>()));
        assert_eq!(a.len(), b.len());
        events += a.len();
        // Single vertices of equal energy could be swapped in the list, but there are none.
        for ((f, a), (g, b)) in a.iter().zip(&b) {
            assert_eq!((f, a.sign, a.vertices), (g, b.sign, b.vertices));
            assert!((a.energy - b.energy).abs() <= 1e-9 * a.energy, "{a:?} {b:?}");
            assert!((a.area / b.area - 1.0).abs() < 1e-6);
            let apart = |k: usize| (a.position[k] - b.position[k]).abs();
            assert!((0..3).all(|k| apart(k) < 1e-6), "{a:?} {b:?}");
        }
    }
    assert!(events >= 10, "{events}");
}

/// Compares events: energies to a billionth plus the effect of rounded positions of each vertex.
fn same(
    a: &[(i64, Crumple)],
    b: &[(i64, Crumple)],
    scale: f64,
    sign: i8,
    rounding: f64,
) -> Result<(), String> {
    if a.len() != b.len() {
        return Err(format!("{} events against {}", a.len(), b.len()));
    }
    for ((f, a), (g, b)) in a.iter().zip(b) {
        // Half a billionth of the root is a billionth of the energy.
        let (one, other) = (a.energy.sqrt(), (scale * b.energy).sqrt());
        let near = (one - other).abs() <= 5e-10 * one + rounding * f64::from(a.vertices);
        if (f, a.id, a.vertices, a.sign) != (g, b.id, b.vertices, sign * b.sign) || !near {
            return Err(format!("{a:?} against {b:?}"));
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn rigid_motion_preserves_events_winding_flips_their_sign_and_scale_changes_their_energy(
        seed in 0_u64..500, turn in -3.0..3.0, shift in prop::array::uniform3(-2.0..2.0), k in 0.2..5.0,
    ) {
        let (scene, frames) = wandering(seed, 16, 6);
        // A rigid motion of its own in every frame: buckling depends on shape alone.
        let rigid: Vec<Vec<[f64; 3]>> = (0..).zip(&frames)
            .map(|(t, f): (i32, _)| f.iter().map(|p| moved(*p, turn * f64::from(t), shift)).collect()).collect();
        let large: Vec<Vec<[f64; 3]>> = frames.iter().map(|f| f.iter().map(|p| p.map(|x| k * x)).collect()).collect();
        // Positions up to 5 m away are rounded to 2^-50 m in each coordinate, and edges are of 1/15 m. Moved by d, a
        // vertex changes its own curvature and those of its neighbours by a few d / edge^2, here 2e-13 1/m; twice that
        // for two frames, and cotangents of sharp corners make it ten times as much at worst. It is what makes an event
        // of 1e-3 1/m differ by more than a billionth.
        let bend = 10.0 * 2.0 * 0.5_f64.powi(50) * 225.0;
        for params in [PAPER, CrumpleParams { merge_frames: 2, ..PAPER }, AREA] {
            let base = events_of(&scene, &frames, &[], params);
            prop_assert!(!base.is_empty());
            let rounding = if params.weight == Weight::None { bend } else { bend / 225.0 };
            let same = |other: &[(i64, Crumple)], scale, sign| same(&base, other, scale, sign, rounding);
            prop_assert_eq!(same(&events_of(&scene, &rigid, &[], params), 1.0, 1), Ok(()));
            prop_assert_eq!(same(&events_of(&scene.flipped(), &frames, &[], params), 1.0, -1), Ok(()));
            // E / k^2 for sums over vertices, E k^2 for sums over area.
            let scale = if params.weight == Weight::None { k * k } else { 1.0 / (k * k) };
            prop_assert_eq!(same(&events_of(&scene, &large, &[], params), scale, 1), Ok(()));
        }
    }

    #[test]
    fn merging_preserves_all_changes(seed in 0_u64..500, merge_frames in 1_usize..5) {
        let (scene, frames) = wandering(seed, 12, 10);
        let total = |params| -> (f64, u32) {
            let found = events_of(&scene, &frames, &[], params);
            (found.iter().map(|(_, e)| f64::from(e.sign) * e.energy.sqrt()).sum(), found.iter().map(|(_, e)| e.vertices).sum())
        };
        let (single, merged) = (total(PAPER), total(CrumpleParams { merge_frames, ..PAPER }));
        prop_assert!((single.0 - merged.0).abs() < 1e-6 * (1.0 + single.0.abs()));
        prop_assert_eq!(single.1, merged.1);
    }

    #[test]
    fn events_come_in_order_and_in_time(seed in 0_u64..500, merge_frames in 0_usize..5) {
        let (scene, frames) = wandering(seed, 12, 10);
        let params = CrumpleParams { merge_frames, ..PAPER };
        let late = events_of(&scene, &frames, &[], params);
        prop_assert!(late.windows(2).all(|w| (w[0].0, w[0].1.id) <= (w[1].0, w[1].1.id)));
        // Events are equal if they are read as soon as they are finished.
        let n = scene.points.len();
        let mut measure = MeanCurvature::new(&scene.topology(), Method::Cotan).unwrap();
        let mut detector = BuckleDetector::new(n, 60.0, 0.0);
        let mut events = CrumpleEvents::new(&scene.topology(), &[], params).unwrap();
        let (mut bent, mut labels) = (vec![Curvature::default(); n], vec![Buckle::default(); n]);
        let mut early = Vec::new();
        for (frame, points) in (0..).zip(&frames) {
            measure.measure(points, &mut bent).unwrap();
            detector.detect(&bent, &mut labels);
            events.add_frame(frame, &labels);
            early.extend(std::iter::from_fn(|| events.next_before(frame - merge_frames as i64 + 1)));
        }
        events.finish();
        early.extend(std::iter::from_fn(|| events.next_before(i64::MAX)));
        prop_assert_eq!(early, late);
    }
}
