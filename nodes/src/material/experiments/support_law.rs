//! Distribution of the dampings that random supports add, as a node.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::{Many, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::modal::surface::contact::random_contacts;
use crate::modal::surface::damping_of_contacts::ContactLaw;
use crate::modal::surface::mode_shapes::ModeShapes;
use crate::plot::{Chart, Line};
use crate::statistics::quantile;
use crate::statistics::ranks::distance_to_uniform;
use crate::table::{Cell, ResultTable};
use crate::{params, ports};

/// Share of an exponential distribution below a tenth of its mean.
const EXPONENTIAL_BELOW: f64 = 0.095_162_581_964_040_43;

params! {
    /// Distribution of the dampings that a contact adds to the modes of objects, over random points of their surfaces.
    ///
    /// Estimators of damping assume that it is exponential. The table has, for each friction `mu` and object, and for all objects, the shape of
    /// the gamma distribution with the same mean and variance (1 is exponential), the share below a tenth of the mean, which is 0.095 for an
    /// exponential distribution, and Kolmogorov and Smirnov's distance to it. Dampings are relative to their mean over each object.
    ///
    /// # Randomness
    /// Points are uniform over the surface, a function of the seed.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 4.3 and equation 21.
    pub struct SupportLawParams {
        /// Tangential damping relative to the normal one.
        mu: Vec<f64> = vec![0.0, 0.5, 1.0], unit "", range 0.0..=100.0;
        /// Number of points on each object.
        points: usize = 60, unit "", range 1..=100_000;
        /// Number of modes of each object, from the lowest on.
        modes: usize = 60, unit "", range 1..=10_000;
        /// Names of the objects; empty for numbers.
        names: Vec<Text> = vec![];
    }
}
ports! {
    pub struct SupportLawPorts / SupportLawIo {
        in {
            /// The shapes of the modes of each object.
            shapes: Many<Value<ModeShapes>>,
        }
        out {
            /// A row for each `mu` and object, and for each `mu` one of all objects.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`relative_dampings`].
#[derive(Debug)]
pub struct SupportLaw;

/// Dampings of the first modes of an object by a contact at random points, relative to their mean.
///
/// # Complexity
/// O(points modes), and O(triangles).
#[must_use]
pub fn relative_dampings(
    shapes: &ModeShapes,
    mu: f64,
    points: usize,
    modes: usize,
    rng: &mut Rng,
) -> Vec<f64> {
    let law = ContactLaw { coefficient: 1.0, mu };
    let mut scratch = vec![0.0; 2 * shapes.len()];
    let mut all = Vec::new();
    for contact in random_contacts(shapes.surface(), points, rng) {
        let mut rates = vec![0.0; shapes.len()];
        law.add(shapes.surface(), &contact, &mut scratch, &mut rates);
        all.extend(rates.into_iter().take(modes));
    }
    let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
    if mean > 0.0 {
        all.iter_mut().for_each(|x| *x /= mean);
    }
    all
}

/// A row of the table.
fn row(mu: f64, object: &str, all: &[f64]) -> [Cell; 6] {
    let n = all.len().max(1) as f64;
    let mean = all.iter().sum::<f64>() / n;
    let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    let below = all.iter().filter(|x| **x < 0.1 * mean).count() as f64 / n;
    let shares: Vec<f64> = all.iter().map(|x| -libm::expm1(-x / mean)).collect();
    [
        mu.into(),
        object.into(),
        all.len().into(),
        Some(mean * mean / variance).filter(|x| x.is_finite()).into(),
        below.into(),
        Some(distance_to_uniform(&shares)).filter(|x| x.is_finite()).into(),
    ]
}

impl Func for SupportLaw {
    type Params = SupportLawParams;
    type Ports = SupportLawPorts;
    const NAME: &'static str = "SupportLaw";

    fn check(p: &SupportLawParams, s: &mut Shape<'_, '_, SupportLawPorts>) -> Result<(), Reject> {
        if p.mu.is_empty() {
            s.wrong(Reject::new("F136", "there is nothing to run").at("mu").help("a list such as [0, 0.5]"));
        }
        Ok(())
    }

    fn eval(p: &SupportLawParams, cx: &Build<'_>, mut io: SupportLawIo<'_>) -> Result<Summary, Fault> {
        let objects = cx.many_values(SupportLawPorts::shapes);
        let seed = u64::from(cx.random.words(0, 0, 0)[0]);
        let name = |k: usize| p.names.get(k).map_or_else(|| (k + 1).to_string(), |name| name.0.clone());
        let names =
            ["mu", "object", "dampings", "gamma_shape", "share_below_tenth", "distance_to_exponential"];
        let mut table = ResultTable::new(&names);
        let (mut lines, mut dampings) = (Vec::new(), 0);
        for mu in &p.mu {
            // The same points for each `mu`.
            let mut rng = Rng::new(seed);
            let mut all = Vec::new();
            for (k, object) in objects.iter().enumerate() {
                let own = relative_dampings(object, *mu, p.points, p.modes, &mut rng);
                table.push(row(*mu, &name(k), &own));
                all.extend(own);
            }
            table.push(row(*mu, "all", &all));
            all.sort_by(f64::total_cmp);
            dampings = all.len();
            let at = |k: usize| [quantile(&all, k as f64 / 100.0), k as f64 / 100.0];
            lines.push(Line::new(format!("mu {mu}"), (1..100).map(at).collect()));
        }
        let exponential = |k: usize| [-libm::log1p(-(k as f64) / 100.0), k as f64 / 100.0];
        lines.push(Line::new("exponential", (1..100).map(exponential).collect()));
        let (x, y) = (("damping relative to the mean", false), ("share below", false));
        table.charts = vec![Chart::of("Dampings by random supports", x, y, lines)];
        io.table.set(table);
        Ok(vec![
            ("objects", objects.len().into()),
            ("dampings", dampings.into()),
            ("exponential_share_below_tenth", EXPONENTIAL_BELOW.into()),
        ])
    }

    fn trial(rng: &mut Rng) -> (SupportLawParams, MemoryFiles) {
        let p = SupportLawParams { points: 1 + rng.below(20), ..SupportLawParams::trial(rng) };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square whose modes move each vertex at random, as shapes of high modes do.
    fn sheet(normal_only: bool) -> ModeShapes {
        let (n, modes) = (12_u32, 40);
        let mut rng = Rng::new(3);
        let at = |k: u32| [f64::from(k % n) * 0.01, f64::from(k / n) * 0.01, 0.0];
        let vertices: Vec<[f64; 3]> = (0..n * n).map(at).collect();
        let cells = (0..n - 1).flat_map(|y| (0..n - 1).map(move |x| y * n + x));
        let triangles = cells.flat_map(|v| [[v, v + 1, v + n], [v + 1, v + n + 1, v + n]]).collect();
        let shapes = (0..vertices.len() * 3 * modes).map(|k| {
            let axis = (k / modes) % 3;
            let x = crate::statistics::normal::standard_normal(&mut rng) as f32;
            if normal_only && axis < 2 { 0.0 } else { x }
        });
        let shapes = shapes.collect();
        let normals = vec![[0.0, 0.0, 1.0]; vertices.len()];
        ModeShapes { vertices, triangles, normals, shapes, gains: vec![1.0; modes] }
    }

    #[test]
    fn a_contact_without_friction_adds_squares_of_normal_variables() {
        let shape = |mu, normal_only| {
            let all = relative_dampings(&sheet(normal_only), mu, 2000, 40, &mut Rng::new(1));
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            assert!((mean - 1.0).abs() < 1e-9);
            1.0 / (all.iter().map(|x| (x - 1.0).powi(2)).sum::<f64>() / all.len() as f64)
        };
        // Interpolation between vertices varies the variance, which lowers the shape of chi-square with one and three degrees of freedom.
        let (one, three) = (shape(0.0, true), shape(1.0, false));
        assert!((0.35..0.52).contains(&one) && (1.0..1.55).contains(&three), "{one} {three}");
        assert!((shape(1.0, true) - one).abs() < 1e-9, "without tangential motion friction does not matter");
    }
}
