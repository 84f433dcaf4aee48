use super::*;
use std::collections::HashMap;

fn field(width: usize, samples: &[f32]) -> Field<'_> {
    Field { width, samples, torus: false }
}

fn one(field: &Field<'_>, level: f32, saddle: Saddle) -> Lines {
    contours(field, &[level], saddle).remove(0)
}

fn span(lines: &Lines, line: Line) -> &[[f64; 2]] {
    &lines.points[line.from..line.to]
}

fn length(points: &[[f64; 2]]) -> f64 {
    points.windows(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).sum()
}

fn area(points: &[[f64; 2]]) -> f64 {
    points.windows(2).map(|p| p[0][0] * p[1][1] - p[1][0] * p[0][1]).sum::<f64>() / 2.0
}

/// The images of `tests/oracles/contours.py`.
fn image(seed: i64, w: usize, h: usize) -> Vec<f32> {
    let mut state = seed;
    let n = if seed % 2 == 1 { 4 } else { 2 };
    let (cw, ch) = (w / n + 2, h / n + 2);
    let coarse: Vec<i64> = (0..cw * ch)
        .map(|_| {
            state = (state * 1_103_515_245 + 12_345) % (1 << 31);
            state >> 21
        })
        .collect();
    let at = |x: usize, y: usize| {
        let (i, j, u, v) = (x / n, y / n, (x % n) as i64, (y % n) as i64);
        let (c, m) = (|i, j| coarse[j * cw + i], n as i64);
        let row = |j| c(i, j) * (m - u) + c(i + 1, j) * u;
        row(j) * (m - v) + row(j + 1) * v
    };
    let mut a: Vec<i64> = (0..w * h).map(|k| at(k % w, k / w)).collect();
    for (dx, dy) in [(0, 1), (1, 0)] {
        let last = a.clone();
        let get = |x: usize, y: usize| last[y.min(h - 1) * w + x.min(w - 1)];
        for (k, a) in a.iter_mut().enumerate() {
            let (x, y) = (k % w, k / w);
            let before = get(x.saturating_sub(dx), y.saturating_sub(dy));
            *a = before + 2 * get(x, y) + get(x + dx, y + dy);
        }
    }
    a.iter().map(|a| *a as f32 / (1024 * 16 * n * n) as f32).collect()
}

const LEVEL: f32 = 0.500_001_9;

#[test]
fn contours_of_twenty_images_are_those_of_scikit_image() {
    let csv = include_str!("../../../../tests/data/contours.csv");
    let mut differ = 0;
    let mut before = String::new();
    for row in csv.lines().skip(1) {
        let columns: Vec<&str> = row.split(',').collect();
        let wanted: Vec<f64> = columns[2..].iter().map(|x| x.parse().unwrap()).collect();
        let seed = columns[0].parse().unwrap();
        let saddle = if columns[1] == "low" { Saddle::Low } else { Saddle::High };
        let found = one(&field(37, &image(seed, 37, 29)), LEVEL, saddle);
        let closed: Vec<_> = found.lines.iter().filter(|line| line.closed).collect();
        let spans = || found.lines.iter().map(|line| span(&found, *line));
        let once = |line: &Line| &span(&found, *line)[usize::from(line.closed)..];
        let moments = || found.lines.iter().flat_map(once).map(|p| p[0] * p[1]);
        let numbers = [
            found.lines.len() as f64,
            closed.len() as f64,
            found.points.len() as f64,
            spans().map(length).sum(),
            moments().sum(),
            closed.iter().map(|line| area(span(&found, **line)).abs()).sum(),
        ];
        for (found, wanted) in numbers.iter().zip(&wanted) {
            assert!((found - wanted).abs() <= 1e-6 + 1e-10 * wanted.abs(), "{row}: {numbers:?}");
        }
        let rest = columns[2..].join(",");
        differ += usize::from(columns[1] == "high" && rest != before);
        before = rest;
    }
    assert!(differ >= 5, "the two rules differ in only {differ} images");
}

/// Lines of points in pixels, as `tests/oracles/contours.py` stores them.
fn stored(numbers: &mut impl Iterator<Item = u16>) -> Vec<Vec<[f64; 2]>> {
    let count = numbers.next().unwrap();
    let line = |numbers: &mut dyn Iterator<Item = u16>| {
        let len = numbers.next().unwrap();
        let mut coordinate = || f64::from(numbers.next().unwrap()) / 1024.0;
        (0..len).map(|_| [coordinate(), coordinate()]).collect()
    };
    (0..count).map(|_| line(numbers)).collect()
}

/// Returns true if two lines have the same points in the same direction, false if in the opposite one, and `None` if they differ.
/// Loops may start at any point.
fn same_line(ours: &[[f64; 2]], theirs: &[[f64; 2]]) -> Option<bool> {
    let near = |a: [f64; 2], b: [f64; 2]| (0..2).all(|k| (a[k] - b[k]).abs() < 0.501 / 1024.0);
    let closed = ours.first() == ours.last();
    let n = ours.len() - usize::from(closed);
    if ours.len() != theirs.len() {
        return None;
    }
    let starts = if closed { 0..n } else { 0..1 };
    let forth = |from: usize| (0..n).all(|k| near(ours[(from + k) % n], theirs[k]));
    let back = |from: usize| (0..n).all(|k| near(ours[(from + n - 1 - k) % n], theirs[k]));
    if starts.clone().any(forth) { Some(true) } else { starts.clone().any(back).then_some(false) }
}

#[test]
fn every_vertex_of_twenty_images_is_that_of_scikit_image() {
    let bytes = include_bytes!("../../../../tests/data/contours.bin").as_chunks().0;
    let mut numbers = bytes.iter().map(|pair| u16::from_le_bytes(*pair));
    let mut count = 0;
    for seed in 1..=20 {
        let samples = image(seed, 37, 29);
        for saddle in [Saddle::Low, Saddle::High] {
            let theirs = stored(&mut numbers);
            let found = one(&field(37, &samples), LEVEL, saddle);
            let mut ours: Vec<_> = found.lines.iter().map(|line| span(&found, *line)).collect();
            assert_eq!(ours.len(), theirs.len());
            for line in &theirs {
                let found = ours.iter().position(|own| same_line(own, line).is_some());
                let own = ours.swap_remove(found.unwrap_or_else(|| panic!("{seed} {saddle:?}: {line:?}")));
                // Theirs have the low side on the left.
                assert_eq!(same_line(own, line), Some(false), "{seed} {saddle:?}");
                count += line.len();
            }
        }
    }
    assert!(numbers.next().is_none() && count > 10_000, "{count} vertices");
}

#[test]
fn opposite_corners_are_connected_by_the_saddle_rule() {
    let samples = [1.0, 0.0, 0.0, 1.0];
    let around_high = one(&field(2, &samples), 0.5, Saddle::Low);
    assert_eq!(around_high.points, [[0.0, 0.5], [0.5, 0.0], [1.0, 0.5], [0.5, 1.0]]);
    let around_low = one(&field(2, &samples), 0.5, Saddle::High);
    let starts: Vec<_> = around_low.lines.iter().map(|line| span(&around_low, *line)).collect();
    assert_eq!(starts, [[[0.0, 0.5], [0.5, 1.0]], [[1.0, 0.5], [0.5, 0.0]]]);
    // The saddle point has the height 0.474, below the level.
    let samples = [1.0, 0.0, 0.0, 0.9];
    assert!((saddle_height(&samples) - 0.473_68).abs() < 1e-5);
    let decided = one(&field(2, &samples), 0.5, Saddle::Decider);
    assert_eq!(decided, one(&field(2, &samples), 0.5, Saddle::Low));
    let lower = one(&field(2, &samples), 0.45, Saddle::Decider);
    assert_eq!(lower, one(&field(2, &samples), 0.45, Saddle::High));
}

fn saddle_height(corners: &[f32; 4]) -> f32 {
    let [a, b, d, c] = corners;
    (a * c - b * d) / (a + c - b - d)
}

#[test]
fn a_circle_is_round_and_a_plane_is_straight() {
    let n = 129;
    let centre = 64.0_f64;
    let distance: Vec<f32> =
        (0..n * n).map(|k| ((k % n) as f64 - centre).hypot((k / n) as f64 - centre) as f32).collect();
    for (radius, error, vertices, long) in [(20.0, 0.0046, 149, 0.999_85), (40.5, 0.0027, 325, 0.999_96)] {
        let ring = one(&field(n, &distance), radius, Saddle::Decider);
        assert_eq!((ring.lines.len(), ring.lines[0].closed), (1, true));
        let errors =
            ring.points.iter().map(|p| ((p[0] - centre).hypot(p[1] - centre) - f64::from(radius)).abs());
        assert!(errors.fold(0.0, f64::max) < error);
        assert_eq!(ring.points.len(), vertices);
        let round = length(&ring.points) / (std::f64::consts::TAU * f64::from(radius));
        assert!((round - long).abs() < 5e-6, "{round}");
    }
    let plane: Vec<f32> = (0..400).map(|k| (k % 20) as f32 * 0.5 + (k / 20) as f32 * 0.25).collect();
    let line = one(&field(20, &plane), 3.1, Saddle::Decider);
    assert_eq!((line.lines.len(), line.lines[0].closed), (1, false));
    let level = f64::from(3.1_f32);
    assert!(line.points.iter().all(|p| (0.5 * p[0] + 0.25 * p[1] - level).abs() < 1e-9));
}

#[test]
fn the_high_side_is_on_the_left() {
    // The rings of a peak have the peak on the left, with y pointing down.
    let peak: Vec<f32> = (0..25).map(|k| -((k % 5) as f32 - 2.0).hypot((k / 5) as f32 - 2.0)).collect();
    let ring = one(&field(5, &peak), -1.2, Saddle::Decider);
    // The shoelace sum is positive for rotations from x to y, which are to the right if y points down.
    assert!(ring.lines.len() == 1 && area(&ring.points) < 0.0);
    for saddle in [Saddle::Decider, Saddle::Low, Saddle::High] {
        let samples = image(3, 37, 29);
        let lines = one(&field(37, &samples), LEVEL, saddle);
        for line in &lines.lines {
            for p in span(&lines, *line).windows(2) {
                let step = [p[1][0] - p[0][0], p[1][1] - p[0][1]];
                let middle = [0.5 * (p[0][0] + p[1][0]), 0.5 * (p[0][1] + p[1][1])];
                let far = 0.01 / step[0].hypot(step[1]);
                let side = |s: f64| {
                    let (x, y) = (middle[0] + s * step[1] * far, middle[1] - s * step[0] * far);
                    bilinear(&samples, 37, x, y)
                };
                assert!(side(1.0) > side(-1.0), "{p:?}");
            }
        }
    }
}

fn bilinear(samples: &[f32], w: usize, x: f64, y: f64) -> f64 {
    let (i, j) = (x.max(0.0) as usize, y.max(0.0) as usize);
    let (u, v) = (x - i as f64, y - j as f64);
    let at = |x: usize, y: usize| f64::from(*samples.get(y * w + x.min(w - 1)).unwrap_or(&0.0));
    let row = |y| at(i, y) * (1.0 - u) + at(i + 1, y) * u;
    row(j) * (1.0 - v) + row(j + 1) * v
}

/// A key of a position on a torus.
fn key(p: [f64; 2], period: [f64; 2]) -> [i64; 2] {
    [0, 1].map(|k| (p[k].rem_euclid(period[k]) * 1e9).round() as i64 % (period[k] * 1e9) as i64)
}

#[test]
fn lines_end_at_borders_share_no_vertex_and_cross_rows_where_the_level_is_passed() {
    let (w, h) = (37, 29);
    for seed in [2, 5, 6, 11] {
        let samples = image(seed, w, h);
        for torus in [false, true] {
            for level in [0.3, 0.45, LEVEL, 0.6] {
                let whole = Field { width: w, samples: &samples, torus };
                let lines = one(&whole, level, Saddle::Decider);
                let period = [w as f64, h as f64];
                let mut vertices_by_key = HashMap::new();
                for (k, line) in lines.lines.iter().enumerate() {
                    let points = span(&lines, *line);
                    let (first, last) = (points[0], points[points.len() - 1]);
                    if line.closed {
                        assert!(torus || first == last);
                        assert_eq!(key(first, period), key(last, period));
                    } else {
                        assert!(!torus);
                        let border = |p: [f64; 2]| (0..2).any(|k| p[k] == 0.0 || p[k] == period[k] - 1.0);
                        assert!(border(first) && border(last), "{first:?} {last:?}");
                    }
                    for p in &points[usize::from(line.closed)..] {
                        assert_eq!(vertices_by_key.insert(key(*p, period), k), None, "{p:?} appears twice");
                    }
                    let long = points.windows(2).map(length).fold(0.0, f64::max);
                    assert!(long < 1.42, "a segment crosses at most one cell: {long}");
                }
                for y in 0..h {
                    let row = whole.row(y);
                    let pairs = row.windows(2).map(|p| (p[0], p[1]));
                    let seam = torus.then(|| (row[w - 1], row[0]));
                    let wanted = pairs.chain(seam).filter(|(a, b)| (*a > level) != (*b > level)).count();
                    let found = vertices_by_key.keys().filter(|k| k[1] == y as i64 * 1_000_000_000).count();
                    assert_eq!(found, wanted, "row {y}");
                }
            }
        }
    }
}

#[test]
fn on_a_torus_lines_continue_across_the_seam() {
    // One wave along x, shifted from row to row: its lines go once around in both directions.
    let (w, h) = (16, 12);
    let wave = |k: usize| {
        let turns = (k % w) as f64 / w as f64 + (k / w) as f64 / h as f64;
        (std::f64::consts::TAU * turns).sin() as f32
    };
    let samples: Vec<f32> = (0..w * h).map(wave).collect();
    let lines = one(&Field { width: w, samples: &samples, torus: true }, 0.1, Saddle::Decider);
    assert_eq!(lines.lines.len(), 2);
    for line in &lines.lines {
        let points = span(&lines, *line);
        let (first, last) = (points[0], points[points.len() - 1]);
        let turns = [(last[0] - first[0]) / w as f64, (last[1] - first[1]) / h as f64];
        assert!(line.closed && turns.map(f64::abs) == [1.0, 1.0], "{turns:?}");
    }
}

#[test]
fn lines_of_different_levels_do_not_cross() {
    let samples = image(6, 37, 29);
    let levels: Vec<f32> = (0..12).map(|k| 0.2 + 0.05 * k as f32).collect();
    let all = contours(&field(37, &samples), &levels, Saddle::Decider);
    let pieces: Vec<(usize, [[f64; 2]; 2])> = all
        .iter()
        .enumerate()
        .flat_map(|(k, lines)| {
            let spans = lines.lines.iter().flat_map(|line| span(lines, *line).windows(2));
            spans.map(move |p| (k, [p[0], p[1]]))
        })
        .collect();
    let side =
        |a: [f64; 2], b: [f64; 2], p: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    for (i, (k, [a, b])) in pieces.iter().enumerate() {
        for (l, [c, d]) in &pieces[i + 1..] {
            let apart = (0..2).any(|x| a[x].max(b[x]) < c[x].min(d[x]) || c[x].max(d[x]) < a[x].min(b[x]));
            if k == l || apart {
                continue;
            }
            let over = side(*a, *b, *c) * side(*a, *b, *d) < 0.0 && side(*c, *d, *a) * side(*c, *d, *b) < 0.0;
            assert!(!over, "{a:?} {b:?} crosses {c:?} {d:?}");
        }
    }
}

#[test]
fn strips_of_any_height_give_the_same_bits() {
    for torus in [false, true] {
        let mut samples = image(4, 37, 29);
        // Two holes, one of them at the boundary of two strips.
        samples[8 * 37 + 20] = f32::NAN;
        samples[20 * 37] = f32::INFINITY;
        let whole = Field { width: 37, samples: &samples, torus };
        let levels = [0.3, 0.4, LEVEL, 0.7];
        let wanted = contours_by(&whole, &levels, Saddle::Decider, 1000);
        assert!(wanted.iter().all(|lines| lines.lines.len() > 2));
        for strip in [1, 2, 3, 8, 21] {
            assert_eq!(contours_by(&whole, &levels, Saddle::Decider, strip), wanted, "{strip} {torus}");
        }
        for (k, level) in levels.iter().enumerate() {
            assert_eq!(one(&whole, *level, Saddle::Decider), wanted[k], "a level alone");
        }
    }
}

/// Segments of a cell by its high corners, for saddles around the low ones.
fn plain_segments(case: u8) -> &'static [[u8; 2]] {
    match case {
        1 => &[[L, T]],
        2 => &[[T, R]],
        4 => &[[R, B]],
        8 => &[[B, L]],
        14 => &[[T, L]],
        13 => &[[R, T]],
        11 => &[[B, R]],
        7 => &[[L, B]],
        3 => &[[L, R]],
        12 => &[[R, L]],
        6 => &[[T, B]],
        9 => &[[B, T]],
        5 => &[[L, T], [R, B]],
        10 => &[[T, R], [B, L]],
        _ => &[],
    }
}

#[test]
fn segments_are_those_of_each_cell_alone() {
    for (width, height) in [(3, 7), (65, 33), (64, 70), (129, 20)] {
        let mut samples = image(5, width, height);
        for hole in [5, width * 2 + width / 2, width * height - 2] {
            samples[hole] = f32::NAN;
        }
        for torus in [false, true] {
            let field = Field { width, samples: &samples, torus };
            let found = one(&field, LEVEL, Saddle::Low);
            let period = [width as f64, height as f64];
            let pieces = found.lines.iter().flat_map(|line| span(&found, *line).windows(2));
            let mut pieces: Vec<_> = pieces.map(|p| [key(p[0], period), key(p[1], period)]).collect();
            let mut right = Vec::new();
            let [columns, rows] = field.cells();
            for (x, y) in (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))) {
                let at = |x: usize, y: usize| f64::from(samples[y % height * width + x % width]);
                let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
                if [a, b, c, d].iter().any(|x| !x.is_finite()) {
                    continue;
                }
                let level = f64::from(LEVEL);
                let case = (0..4).map(|k| u8::from([a, b, c, d][k] > level) << k).sum();
                let along = |a: f64, b: f64| (level - a) / (b - a);
                let (left, top) = (x as f64, y as f64);
                let on = |edge: u8| match edge {
                    T => [left + along(a, b), top],
                    R => [left + 1.0, top + along(b, c)],
                    B => [left + along(d, c), top + 1.0],
                    _ => [left, top + along(a, d)],
                };
                right
                    .extend(plain_segments(case).iter().map(|edges| edges.map(|edge| key(on(edge), period))));
            }
            pieces.sort_unstable();
            right.sort_unstable();
            assert!(pieces == right && pieces.len() > 2, "{width}x{height} {torus}");
        }
    }
}

#[test]
fn cells_with_a_hole_have_no_lines_and_a_sample_on_its_level_is_low() {
    let mut samples: Vec<f32> = (0..49).map(|k| (k % 7) as f32).collect();
    samples[3 * 7 + 3] = f32::NAN;
    let lines = one(&field(7, &samples), 2.5, Saddle::Decider);
    let ends: Vec<_> = lines.lines.iter().map(|line| span(&lines, *line)).collect();
    assert_eq!(ends.len(), 2);
    assert_eq!((ends[0][0], ends[0][ends[0].len() - 1]), ([2.5, 0.0], [2.5, 2.0]));
    assert_eq!((ends[1][0], ends[1][ends[1].len() - 1]), ([2.5, 4.0], [2.5, 6.0]));
    let flat = one(&field(3, &[1.0; 9]), 1.0, Saddle::Decider);
    assert_eq!(flat, Lines::default());
    // A low sample exactly on the level would have a ring of size 0.
    let mut dent = [2.0; 9];
    dent[4] = 1.0;
    assert_eq!(one(&field(3, &dent), 1.0, Saddle::Decider), Lines::default());
    // Steps at integers: segments of length 0 are left out.
    let steps: Vec<f32> = (0..25).map(|k| (k % 5) as f32).collect();
    let lines = one(&field(5, &steps), 2.0, Saddle::Decider);
    assert!(lines.points.iter().all(|p| p[0] == 2.0) && lines.points.len() == 5);
}

#[test]
fn grids_without_cells_have_no_lines() {
    for (width, count) in [(0, 0), (1, 5), (5, 5), (3, 2)] {
        let samples = vec![1.0; count];
        let none = contours(&Field { width, samples: &samples, torus: true }, &[0.5, 0.7], Saddle::Low);
        assert_eq!(none, [Lines::default(), Lines::default()]);
    }
    assert_eq!(one(&field(2, &[0.0, 1.0, 0.0, 1.0]), f32::NAN, Saddle::Low), Lines::default());
}
