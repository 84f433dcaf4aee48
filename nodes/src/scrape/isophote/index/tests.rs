use super::*;
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::texture::{Drawing, Grid, Levels, Luma, LumaKind, Surface, isophotes};

fn curves(width: usize, height: usize, wrap: Wrap) -> Isophotes {
    let mut rng = Rng::new(4);
    let grid = Grid::from_fn(width, height, |_, _| rng.between(0.0, 100.0) as f32);
    let surface = Surface { wrap, ..Surface::default() };
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    isophotes(
        &luma,
        &Drawing { levels: Levels::Quantiles(3), simplify: 1.0, gradient_error: 0.6, ..Drawing::default() },
    )
    .unwrap()
}

/// Length of all pieces in a box that contains them, each once.
fn length_within(index: &IsophoteIndex, low: [f64; 2], high: [f64; 2]) -> f64 {
    let mut seen = std::collections::HashSet::new();
    let mut length = 0.0;
    index.near(low, high, |piece| {
        let [a, b] = piece.ends;
        let middle = [0, 1].map(|k| 0.5 * (a[k] + b[k]));
        let inside = (0..2).all(|k| (low[k]..high[k]).contains(&middle[k]));
        if inside && seen.insert((piece.number, middle.map(|x| (x * 1e3).round() as i64))) {
            length += (b[0] - a[0]).hypot(b[1] - a[1]);
        }
    });
    length
}

#[test]
fn a_box_of_the_size_of_the_image_holds_all_curves_wherever_it_lies() {
    for (width, height) in [(64, 48), (37, 5), (3, 3), (17, 130)] {
        let all = curves(width, height, Wrap::Repeat);
        let pieces = all.iter().flat_map(|(_, points, _)| points.windows(2));
        let long: f64 = pieces.map(|p| f64::from((p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1]))).sum();
        let index = IsophoteIndex::new(&all);
        for corner in [[0.0, 0.0], [-7.3, 11.1], [400.25, -900.5]] {
            let far = [corner[0] + width as f64, corner[1] + height as f64];
            let found = length_within(&index, corner, far);
            assert!((found / long - 1.0).abs() < 1e-4, "{width} x {height}, {corner:?}: {found} for {long}");
        }
    }
}

#[test]
fn a_question_looks_at_a_few_pieces_whatever_the_size_of_the_image() {
    // The mean over many boxes of a pixel.
    let looked_at = |side: usize| {
        let index = IsophoteIndex::new(&curves(side, side, Wrap::Repeat));
        let mut rng = Rng::new(9);
        let mut pieces = 0;
        for _ in 0..2000 {
            let low = [0; 2].map(|_| rng.between(0.0, side as f64));
            index.near(low, low.map(|x| x + 1.0), |_| pieces += 1);
        }
        f64::from(pieces) / 2000.0
    };
    let [small, large] = [48, 384].map(looked_at);
    println!("{small} and {large} pieces");
    // Noise, whose curves are as dense as curves can be.
    assert!((large / small - 1.0).abs() < 0.15 && large < 60.0, "{small} {large}");
}

#[test]
fn pieces_are_short_and_store_their_gradients() {
    let all = curves(64, 48, Wrap::Repeat);
    let index = IsophoteIndex::new(&all);
    let mut count = 0;
    index.near([0.0; 2], [63.9, 47.9], |piece| {
        let [a, b] = piece.ends;
        assert!((b[0] - a[0]).hypot(b[1] - a[1]) <= CELL + 1e-3);
        let k = piece.point as usize;
        let [from, to] = [all.gradients[k], all.gradients[k + 1]];
        if piece.part[0] == 0 {
            let g = index.gradient(&piece, 0.0);
            assert!((0..2).all(|i| (g[i] - f64::from(from[i])).abs() < 1e-6));
        }
        if piece.part[0] + 1 == piece.part[1] {
            let g = index.gradient(&piece, 1.0);
            assert!((0..2).all(|i| (g[i] - f64::from(to[i])).abs() < 1e-6));
        }
        count += usize::from(piece.part[1] > 1);
    });
    assert!(count > 0, "a long segment comes in parts");
}

#[test]
fn places_are_found_on_the_image() {
    let index = |wrap| IsophoteIndex::new(&curves(10, 8, wrap));
    let at = |index: &IsophoteIndex, position| index.on_image(&index.tile(position), position);
    let (position, steps) = at(&index(Wrap::Repeat), [-1.0, 17.5]);
    assert_eq!((position, steps), ([9.0, 1.5], [1.0, 1.0]));
    let mirror = index(Wrap::Mirror);
    assert_eq!(at(&mirror, [3.0, 2.0]), ([3.0, 2.0], [1.0, 1.0]));
    // Pixel -1 is pixel 0 again, and pixel 10 is pixel 9.
    assert_eq!(at(&mirror, [-1.0, 8.0]), ([0.0, 7.0], [-1.0, -1.0]));
    assert_eq!(at(&mirror, [10.25, 16.0]), ([8.75, 0.0], [-1.0, 1.0]));
    assert_eq!(at(&index(Wrap::Clamp), [40.0, 2.0]), ([9.5, 2.0], [0.0, 1.0]));
}

#[test]
fn empty_and_small_isophotes_have_an_index() {
    IsophoteIndex::new(&Isophotes::default()).near([-9.0; 2], [9.0; 2], |piece| panic!("{piece:?}"));
    let mut rng = Rng::new(1);
    for _ in 0..50 {
        let index = IsophoteIndex::new(&Isophotes::trial(&mut rng));
        let corner = [rng.between(-99.0, 99.0), rng.between(-99.0, 99.0)];
        index.near(corner, corner.map(|x| x + 5.0), |piece| {
            assert!(piece.ends.iter().flatten().all(|x| x.is_finite()));
        });
    }
}
