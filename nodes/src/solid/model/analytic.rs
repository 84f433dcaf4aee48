//! Objects whose frequencies are known from theory.

use super::super::fem::assembly::Discretisation;
use super::super::fem::eigen::{EigenError, Request, eigenmodes};
use super::super::fem::elements::{Isotropic, Order};
use super::super::mesh::shapes::{ball, block};
use super::super::mesh::tet_mesh::TetMesh;
use std::f64::consts::TAU;

/// The material of the objects: that of a steel.
pub const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.3, density: 7850.0 };
/// Size of the bar, m.
pub const BAR: [f64; 3] = [0.2, 0.02, 0.02];
/// Edge and thickness of the square plate, m.
pub const PLATE: [f64; 2] = [0.2, 0.002];
/// Radius of the ball, m.
pub const RADIUS: f64 = 0.05;

/// Bending frequencies 1 to 3 of the bar by Timoshenko's theory, Hz.
pub const BENDING: [f64; 3] = [2506.25, 6523.37, 11_907.8];
/// First longitudinal frequency of the bar, Hz; lateral inertia lowers it by 0.07 %.
pub const LONGITUDINAL: f64 = 12_618.9 * (1.0 - 7e-4);
/// First torsional frequency of the bar, Hz.
pub const TORSION: f64 = 7187.9;
/// Frequencies of a free square plate, `omega a^2 sqrt(rho h / D)`, at a Poisson's ratio of 0.3.
pub const SQUARE: [f64; 5] = [13.468, 19.596, 24.270, 34.80, 34.80];
/// Frequencies of a ball, `omega R / c_s`, and how many modes have each, at a Poisson's ratio of 0.3.
pub const SPHERE: [(f64, usize, &str); 5] = [
    (2.50113, 5, "toroidal 2"),
    (2.64622, 5, "spheroidal 2"),
    (3.52999, 3, "spheroidal 1"),
    (3.86470, 7, "toroidal 3"),
    (3.93740, 7, "spheroidal 3"),
];
/// Highest frequency of the ball that is computed, `omega R / c_s`.
const SPHERE_HIGHEST: f64 = 4.2;

/// Frequencies of one kind of mode.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalyticMode {
    /// The object.
    pub object: &'static str,
    /// Kind of mode.
    pub kind: String,
    /// Number of modes of the frequency.
    pub count: usize,
    /// Frequency by theory, Hz.
    pub theory_hz: f64,
    /// Lowest and highest of the computed modes, Hz.
    pub computed_hz: [f64; 2],
    /// Largest relative difference that is accepted at full size.
    pub bound: f64,
}

impl AnalyticMode {
    /// Largest relative difference from theory.
    #[must_use]
    pub fn difference(&self) -> f64 {
        let off = |f: f64| f / self.theory_hz - 1.0;
        let [low, high] = self.computed_hz.map(off);
        if low.abs() > high.abs() { low } else { high }
    }
}

/// Frequencies below `highest` Hz of a mesh in [`STEEL`], of elements of order 2, Hz.
///
/// # Errors
/// As [`eigenmodes`].
pub fn frequencies(mesh: &TetMesh, highest: f64) -> Result<Vec<f64>, EigenError> {
    let space = Discretisation::new(mesh, Order::Quadratic);
    let request = Request { highest, ..Request::default() };
    let modes = eigenmodes(mesh, &space, &space.assemble(&STEEL), &request, &|_| false)?;
    Ok(modes.lambda.iter().map(|lambda| lambda.max(0.0).sqrt() / TAU).collect())
}

/// Frequency of the plate for `omega a^2 sqrt(rho h / D) = 1`, Hz.
#[must_use]
pub fn plate_unit() -> f64 {
    let [a, h] = PLATE;
    let rigidity = STEEL.young * h * h * h / (12.0 * (1.0 - STEEL.poisson * STEEL.poisson));
    (rigidity / (STEEL.density * h)).sqrt() / (a * a) / TAU
}

/// Frequency of the ball for `omega R / c_s = 1`, Hz.
#[must_use]
pub fn sphere_unit() -> f64 {
    (STEEL.lame()[1] / STEEL.density).sqrt() / RADIUS / TAU
}

/// Modes in order of frequency, as groups of one theoretical frequency each; not a number where there are too few.
fn grouped(
    object: &'static str,
    found: &[f64],
    theory: impl IntoIterator<Item = (f64, usize, String, f64)>,
) -> Vec<AnalyticMode> {
    let mut at = 0;
    let mut group = |(theory_hz, count, kind, bound): (f64, usize, String, f64)| {
        let own = found.get(at..at + count).unwrap_or_default();
        at += count;
        let computed_hz = [own.first(), own.last()].map(|f| f.copied().unwrap_or(f64::NAN));
        AnalyticMode { object, kind, count, theory_hz, computed_hz, bound }
    };
    theory.into_iter().map(&mut group).collect()
}

/// The bar with `cells` cells across its thickness: bending, torsional and longitudinal modes.
///
/// # Errors
/// As [`eigenmodes`].
///
/// # Source
/// Timoshenko, "On the correction for shear of the differential equation for transverse vibrations of prismatic bars" (Phil. Mag. 41,
/// 1921), with the shear coefficient of Cowper (J. Appl. Mech. 33, 1966) and J = 0.1406 b^4 for torsion.
pub fn bar(cells: usize) -> Result<Vec<AnalyticMode>, EigenError> {
    let found = frequencies(&block(BAR, [10 * cells, cells, cells]), 13e3)?;
    let bending = |k: usize| (BENDING[k], 2, format!("bending {}", k + 1), 0.01);
    let theory = [
        bending(0),
        bending(1),
        (TORSION, 1, "torsion 1".to_owned(), 0.01),
        bending(2),
        (LONGITUDINAL, 1, "longitudinal 1".to_owned(), 0.01),
    ];
    Ok(grouped("bar", &found, theory))
}

/// The plate with `cells` cells along its edges and one through it.
///
/// # Errors
/// As [`eigenmodes`].
///
/// # Source
/// Leissa, "The free vibration of rectangular plates" (J. Sound Vib. 31, 1973).
pub fn plate(cells: usize) -> Result<Vec<AnalyticMode>, EigenError> {
    let [a, h] = PLATE;
    let found = frequencies(&block([a, a, h], [cells, cells, 1]), 900.0)?;
    let theory = SQUARE.iter().enumerate();
    let theory = theory.map(|(k, omega)| (omega * plate_unit(), 1, format!("plate {}", k + 1), 0.01));
    Ok(grouped("plate", &found, theory))
}

/// The ball with `cells` cells across.
///
/// # Errors
/// As [`eigenmodes`].
///
/// # Source
/// Lamb, "On the vibrations of an elastic sphere" (Proc. London Math. Soc. 13, 1881).
pub fn sphere(cells: usize) -> Result<Vec<AnalyticMode>, EigenError> {
    let found = frequencies(&ball(RADIUS, cells), SPHERE_HIGHEST * sphere_unit())?;
    let theory = SPHERE.iter();
    let theory =
        theory.map(|(omega, count, kind)| (omega * sphere_unit(), *count, (*kind).to_owned(), 0.012));
    Ok(grouped("sphere", &found, theory))
}
