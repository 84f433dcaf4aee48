//! Results that SciPy, scikit-image, librosa, libigl and trimesh return for curvature, events, energies, the head, the
//! high-pass, features and the warp: made by `tests/oracles/cloth.py`.

use foley_nodes::core::time::Rate;
use foley_nodes::crumple::matching::{EnergyMap, Mapping};
use foley_nodes::crumple::{Buckle, CrumpleEvents, CrumpleParams, Weight};
use foley_nodes::curvature::{Curvature, MeanCurvature, Method};
use foley_nodes::dsp::{Band, Butterworth, Cascade};
use foley_nodes::feature::{BandShape, FeatureConventions, MelCepstrum, TemporalFilter};
use foley_nodes::mesh::Topology;
use foley_nodes::spatial::Head;
use foley_nodes::warp::{Pair, Stiffness, Warper, fit};
use std::f64::consts::{PI, TAU};

/// Numbers that are the same everywhere, about zero.
fn noise(count: usize, a: usize) -> Vec<f64> {
    (0..count).map(|i| (((i * i * a + 3 * i) % 31) as f64 - 15.0) / 16.0).collect()
}

fn single(x: &[f64]) -> Vec<f32> {
    x.iter().map(|x| *x as f32).collect()
}

fn near(found: impl IntoIterator<Item = f64>, wanted: &[f64], tolerance: f64, what: &str) {
    let found: Vec<f64> = found.into_iter().collect();
    assert_eq!(found.len(), wanted.len(), "{what}");
    let far = found.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(far < tolerance, "{what}: {far} away: {found:?}, not {wanted:?}");
}

/// A grid of `n` by `rows` vertices whose diagonals all have one direction.
fn triangles(n: usize, rows: usize) -> Vec<[u32; 3]> {
    let step = n as u32;
    let cells = || (0..(n - 1) * (rows - 1)).map(|k| (k % (n - 1) + k / (n - 1) * n) as u32);
    cells().map(|a| [a, a + 1, a + step + 1]).chain(cells().map(|a| [a, a + step + 1, a + step])).collect()
}

#[test]
fn curvature_is_that_of_libigl() {
    let n = 5_usize;
    let at = |k: usize| {
        let (x, y) = (k % n, k / n);
        [x as f32, y as f32, ((x * x * 7 + 3 * y * y + x * y) % 11) as f32 / 16.0]
    };
    let rest: Vec<[f32; 3]> = (0..n * n).map(at).collect();
    let mesh = Topology { rest: rest.clone(), triangles: triangles(n, n) };
    let mut found = vec![Curvature::default(); n * n];
    MeanCurvature::new(&mesh, Method::Cotan).unwrap().measure(&rest, &mut found).unwrap();
    let inside = |k: &usize| (1..n - 1).contains(&(k % n)) && (1..n - 1).contains(&(k / n));
    let inner: Vec<Curvature> = (0..n * n).filter(inside).map(|k| found[k]).collect();
    assert!(inner.iter().all(|c| c.valid));
    near(inner.iter().map(|c| c.h), CURVATURE, 1e-9, "curvature");
    near(inner.iter().map(|c| c.area), AREAS, 1e-9, "areas");
}

/// A closed lumpy sphere: rows of `n` vertices from pole to pole, and the poles.
fn lumpy(n: usize, rows: usize, a: usize, tall: f64) -> (Topology, Vec<[f64; 3]>) {
    let at = |(k, x): (usize, f64)| {
        let (radius, lon) = (1.0 + x / 8.0, TAU * (k % n) as f64 / n as f64);
        let lat = PI * (k / n + 1) as f64 / (rows + 1) as f64;
        [radius * lat.sin() * lon.cos(), radius * lat.sin() * lon.sin(), radius * tall * lat.cos()]
    };
    let mut points: Vec<[f64; 3]> = noise(n * rows, a).into_iter().enumerate().map(at).collect();
    points.extend([[0.0, 0.0, tall], [0.0, 0.0, -tall]]);
    let mut triangles = Vec::new();
    for c in 0..n {
        let (d, last) = ((c + 1) % n, n * (rows - 1));
        for r in (0..last).step_by(n) {
            triangles.extend([[r + c, r + n + c, r + n + d], [r + c, r + n + d, r + d]]);
        }
        triangles.extend([[n * rows, c, d], [n * rows + 1, last + d, last + c]]);
    }
    (topology(&points, triangles), points)
}

fn topology(points: &[[f64; 3]], triangles: Vec<[usize; 3]>) -> Topology {
    let rest = points.iter().map(|p| p.map(|x| x as f32)).collect();
    Topology { rest, triangles: triangles.into_iter().map(|t| t.map(|v| v as u32)).collect() }
}

fn integrated(mesh: &Topology, points: &[[f64; 3]], method: Method) -> Vec<f64> {
    let mut found = vec![Curvature::default(); points.len()];
    MeanCurvature::new(mesh, method).unwrap().measure(points, &mut found).unwrap();
    assert!(found.iter().all(|c| c.valid));
    found.iter().map(|c| c.h * c.area).collect()
}

#[test]
fn integrals_of_curvature_are_the_measures_of_trimesh() {
    for ((n, rows, a, tall), wanted) in
        [(12, 7, 9, 1.0), (9, 11, 4, 2.0), (16, 5, 11, 0.5)].into_iter().zip(MEASURES)
    {
        let (mesh, points) = lumpy(n, rows, a, tall);
        let sum = |method| integrated(&mesh, &points, method).iter().sum::<f64>();
        near([sum(Method::Dihedral)], &[*wanted], 1e-10, "sum over all edges");
        // Cotangents are another discretisation, which differs on meshes as coarse as this.
        let cotan = sum(Method::Cotan);
        assert!((cotan / wanted - 1.0).abs() < 0.1, "{cotan} for {wanted}");
    }
    // A bipyramid of edges of length 1: of each a ball of radius 1/2 holds half, as the vertex has.
    let far = 0.5 / (PI / 5.0).sin();
    let around =
        (0..5).map(|k| [far * (TAU * f64::from(k) / 5.0).cos(), far * (TAU * f64::from(k) / 5.0).sin(), 0.0]);
    let high = (1.0 - far * far).sqrt();
    let points: Vec<[f64; 3]> = around.chain([[0.0, 0.0, high], [0.0, 0.0, -high]]).collect();
    let mesh = topology(&points, (0..5).flat_map(|c| [[5, c, (c + 1) % 5], [6, (c + 1) % 5, c]]).collect());
    let found = integrated(&mesh, &points, Method::Dihedral);
    near([found[0], found[5]], MEASURES_AT_VERTICES, 1e-10, "at vertices");
}

#[test]
fn components_are_those_of_scipy() {
    let (n, rows) = (12_usize, 9_usize);
    let rest = (0..n * rows).map(|k| [(k % n) as f32, (k / n) as f32, 0.0]).collect();
    let mesh = Topology { rest, triangles: triangles(n, rows) };
    let label = |delta: &f64| match delta {
        d if d.abs() < 0.45 => Buckle::default(),
        d => Buckle { label: d.signum() as i8, delta: *d, area: 1.0, ..Buckle::default() },
    };
    let labels: Vec<Buckle> = noise(n * rows, 13).iter().map(label).collect();
    let params = CrumpleParams { weight: Weight::None, ..CrumpleParams::default() };
    let mut events = CrumpleEvents::new(&mesh, &[], params).unwrap();
    events.add_frame(0, &labels);
    events.finish();
    let found: Vec<_> = std::iter::from_fn(|| events.next_before(1)).map(|(_, e)| e).collect();
    assert_eq!(found.iter().map(|e| (e.id, e.vertices)).collect::<Vec<_>>(), COMPONENTS.map(|c| (c.0, c.1)));
    for (event, (_, _, sum)) in found.iter().zip(COMPONENTS) {
        // Sixteenths add up exactly.
        assert_eq!((event.energy, f64::from(event.sign)), (sum * sum, sum.signum()));
    }
}

#[test]
fn energies_are_matched_as_scikit_image_matches_them() {
    let sorted = |mut x: Vec<f64>| {
        x.sort_unstable_by(f64::total_cmp);
        x
    };
    let energies: Vec<f64> = (1..=25).map(|k| f64::from(k).powi(3) / 16.0).collect();
    // As many of both, none twice: both rules assign to each the one of its place.
    let other: Vec<f64> = (0..25).map(|k| (f64::from(k * 7 % 25) / 5.0).exp()).collect();
    let map = EnergyMap::new(&sorted(other.clone()), &energies, Mapping::Ecdf);
    near(other.iter().step_by(3).map(|e| map.wanted(map.rank(*e))), MATCHED_AS_MANY, 1e-9, "as many");
    // Otherwise scikit-image goes by upper shares: equal energies count whole instead of half, and so does the bank's sample.
    let events: Vec<f64> = noise(40, 7).iter().map(|x| x + 1.0).collect();
    let map = EnergyMap::new(&sorted(events.clone()), &energies, Mapping::Ecdf);
    let upper = |e: &f64| {
        let equal = events.iter().filter(|other| *other == e).count() as f64;
        map.wanted(map.rank(*e) + 0.5 * equal / 40.0 - 0.5 / 25.0)
    };
    near(events.iter().step_by(3).map(upper), MATCHED, 1e-9, "other numbers, some of them equal");
}

#[test]
fn the_shadow_of_the_head_is_the_bilinear_transform_of_scipy() {
    for (fs, wanted) in SHADOWS {
        for (theta, wanted) in [0.0_f64, 60.0, 90.0, 150.0, 180.0].into_iter().zip(wanted) {
            near(Head::default().shadow(theta.to_radians(), fs), &wanted, 1e-11, &format!("{fs} {theta}"));
        }
    }
}

#[test]
fn the_high_pass_is_that_of_scipy() {
    for (rate, wanted) in HIGH_PASS {
        let design = Butterworth::design(Band::HighPass, 5, 100.0, rate).unwrap();
        let mut x = single(&noise(400, 7));
        Cascade::new(&design, 1).process(&mut x);
        near(x.iter().step_by(57).map(|x| f64::from(*x)), wanted, 1e-6, "high-pass");
    }
}

#[test]
fn the_cepstrum_of_a_unit_is_that_of_numpy() {
    let conventions = FeatureConventions::cloth(Rate::hz(48_000), 200);
    let mut found = [0.0; 3];
    MelCepstrum::new(&conventions, 1e-10).process(&single(&noise(400, 5)), &mut found);
    near(found.map(f64::from), CEPSTRUM, 1e-6, "cepstrum");
}

#[test]
fn the_cepstrum_of_triangles_is_that_of_librosa() {
    let cloth = FeatureConventions::cloth(Rate::hz(48_000), 200);
    let conventions = FeatureConventions { shape: BandShape::Triangular, ..cloth };
    let mut found = [0.0; 3];
    MelCepstrum::new(&conventions, 1e-10).process(&single(&noise(400, 5)), &mut found);
    near(found.map(f64::from), TRIANGLES, 1e-6, "triangles");
}

#[test]
fn the_gaussian_over_time_is_that_of_scipy() {
    for (width, wanted) in GAUSSIAN {
        let found = TemporalFilter::new(&[width], false).process_segment(&single(&noise(40, 11)));
        near(found.iter().step_by(9).map(|x| f64::from(*x)), wanted, 6e-8, "Gaussian");
    }
}

#[test]
fn the_warp_is_that_of_scipy() {
    for (d, lambda, wanted) in WARP {
        let n = if d == 3 { 9 } else { 14 };
        let (from, off) = (noise(n * d, 13), noise(n * d, 17));
        let pair = |(from, off): (&[f64], &[f64])| Pair {
            from: from.iter().map(|x| 3.0 * x).collect(),
            to: from.iter().zip(off).map(|(x, off)| 3.0 * x + off).collect(),
            weight: 1.0,
        };
        let pairs: Vec<Pair> = from.chunks(d).zip(off.chunks(d)).map(pair).collect();
        let (warp, _) = fit(&pairs, d, Stiffness::Lambda(lambda)).unwrap();
        let mut warper = Warper::new(&warp);
        let queries: Vec<f64> = noise(2 * d, 19).iter().map(|x| 2.0 * x).collect();
        let mut found = Vec::new();
        for x in queries.chunks(d) {
            found.extend(warper.displacement(x.iter().copied()).iter().zip(x).map(|(moved, x)| x + moved));
        }
        // The values have twelve digits.
        near(found, wanted, 1e-11, &format!("warp {d} {lambda}"));
    }
}

const MEASURES: &[f64] = &[13.3833126203, 18.6293997609, 10.9597679672];
const MEASURES_AT_VERTICES: &[f64] = &[1.28330201512, 0.912159570284];
const CURVATURE: &[f64] = &[
    -0.450201152309,
    -0.260629705519,
    -0.234895713487,
    0.785005255309,
    -0.466709951192,
    0.354788658051,
    -0.241989855657,
    0.336432939087,
    -0.496236173133,
];
const AREAS: &[f64] = &[
    1.17383039468,
    1.03102065495,
    1.09337468754,
    1.14561167202,
    1.1436054764,
    1.07811479825,
    1.06756058863,
    1.10016936904,
    1.12030328517,
];
const COMPONENTS: [(u32, u32, f64); 13] = [
    (0, 9, -6.625),
    (2, 5, 3.8125),
    (3, 2, -1.5625),
    (7, 9, -6.1875),
    (9, 7, 5.25),
    (22, 4, -3.125),
    (24, 3, 2.375),
    (40, 10, 7.625),
    (53, 4, -3.125),
    (71, 3, 2.375),
    (72, 4, 3.125),
    (84, 4, -3.125),
    (102, 3, 2.125),
];
const MATCHED: &[f64] = &[
    1.09375,
    122.65625,
    654.6640625,
    20.4453125,
    500.0,
    62.5,
    976.5625,
    412.640625,
    210.9375,
    42.171875,
    11.3671875,
    3.421875,
    11.3671875,
    42.171875,
];
const MATCHED_AS_MANY: &[f64] = &[0.0625, 665.5, 364.5, 171.5, 62.5, 13.5, 0.5, 760.4375, 428.6875];
const SHADOWS: [(f64, [[f64; 3]; 5]); 3] = [
    (
        44100.0,
        [
            [1.91836734694, -1.75510204082, -0.836734693878],
            [1.31551992877, -1.15225462264, -0.836734693878],
            [0.776316805928, -0.613051499806, -0.836734693878],
            [0.173469387755, -0.0102040816327, -0.836734693878],
            [0.340092316132, -0.17682701001, -0.836734693878],
        ],
    ),
    (
        48000.0,
        [
            [1.92449922958, -1.77349768875, -0.848998459168],
            [1.31762663605, -1.16662509521, -0.848998459168],
            [0.774823286913, -0.623821746081, -0.848998459168],
            [0.167950693374, -0.0169491525424, -0.848998459168],
            [0.33568615286, -0.184684612028, -0.848998459168],
        ],
    ),
    (
        96000.0,
        [
            [1.96076861489, -1.88230584468, -0.921537229784],
            [1.33008756893, -1.25162479871, -0.921537229784],
            [0.765989292564, -0.687526522348, -0.921537229784],
            [0.135308246597, -0.0568454763811, -0.921537229784],
            [0.30962420049, -0.231161430274, -0.921537229784],
        ],
    ),
];
const HIGH_PASS: [(f64, &[f64]); 3] = [
    (
        44100.0,
        &[
            -0.916134729859,
            -0.514376644922,
            0.360965137045,
            -0.106332613532,
            -0.0299261826853,
            0.623884782158,
            -0.196784265794,
            -0.400662243341,
        ],
    ),
    (
        48000.0,
        &[
            -0.917852365275,
            -0.511918659106,
            0.371570937908,
            -0.100643932053,
            -0.0336157384381,
            0.610990582386,
            -0.205087959893,
            -0.403001208334,
        ],
    ),
    (
        96000.0,
        &[
            -0.927624230534,
            -0.528380995189,
            0.39881657122,
            -0.0624908623652,
            -0.00116608559099,
            0.611708169856,
            -0.198105023261,
            -0.41055014333,
        ],
    ),
];
const CEPSTRUM: &[f64] = &[-4.64071038085, -1.23506762138, -0.880067802359];
const TRIANGLES: &[f64] = &[-4.62457924379, -0.674081599637, -0.239579141902];
const GAUSSIAN: [(f64, &[f64]); 4] = [
    (10.0, &[-0.56789222116, -0.26589344413, 0.240622963513, -0.0809866765672, -0.302252773687]),
    (20.0, &[-0.586745756776, -0.246983469203, 0.150286759626, 0.000540597462103, -0.225074802752]),
    (30.0, &[-0.594167908982, -0.22510242846, 0.0440361869631, -0.0105766022056, -0.157008792074]),
    (50.0, &[-0.546872840786, -0.278714045804, -0.0971113788521, -0.047534337044, -0.0713390659005]),
];
const WARP: [(usize, f64, &[f64]); 6] = [
    (3, 0.0, &[-3.18118308177, 1.6155083228, 0.640041180656, 1.27093150295, -0.900216468956, 1.21483487673]),
    (3, 1.0, &[-3.24752304083, 1.50467601049, 0.696368529989, 1.25218365539, -0.839296696963, 1.25420106357]),
    (
        3,
        1000.0,
        &[-2.94654099163, 0.575581534025, 0.0618873185502, 1.30377074246, -0.591877780942, 1.31189896032],
    ),
    (
        6,
        0.0,
        &[
            -2.87541959405,
            0.364993539568,
            0.911887027988,
            1.45628046875,
            -0.946631269091,
            0.801045766084,
            -0.0855625054725,
            0.174928460488,
            -2.30802098509,
            0.0799759468199,
            -0.729814165244,
            -1.52818245092,
        ],
    ),
    (
        6,
        1.0,
        &[
            -2.86108630282,
            0.352702991985,
            0.927157137502,
            1.45025315833,
            -0.941106981581,
            0.824877887098,
            -0.0732015934592,
            0.171222233306,
            -2.29485043711,
            0.0915001152291,
            -0.720214765391,
            -1.50401190731,
        ],
    ),
    (
        6,
        1000.0,
        &[
            -2.63893047507,
            0.221123938568,
            1.08990644889,
            1.47930231372,
            -1.03350010606,
            1.25842116926,
            0.171632883748,
            -0.00673960917948,
            -2.15102455322,
            0.35289100326,
            -0.953657709871,
            -0.98242959832,
        ],
    ),
];
