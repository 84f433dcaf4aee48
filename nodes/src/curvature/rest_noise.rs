//! Noise of the curvature of a cloth at rest, from which the dead band of buckling follows.

use serde::{Deserialize, Serialize};

use super::{Curvature, Curvatures};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Data;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Fold, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::ticks;
use crate::{archive_state, impl_state, params, ports};

/// Noise of the curvature of a cloth at rest, and the dead band.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RestNoise {
    /// Standard deviation over time, averaged over the vertices, 1/m.
    pub deviation: f64,
    /// Dead band, a multiple of the deviation, 1/m.
    pub h_eps: f64,
    /// Number of frames.
    pub frames: u64,
}

impl Data for RestNoise {
    const NAME: &'static str = "rest noise";

    fn trial(rng: &mut Rng) -> Self {
        let deviation = rng.between(0.0, 0.5);
        Self { deviation, h_eps: 3.0 * deviation, frames: 30 }
    }
}

/// Mean and deviation of the curvature of every vertex, frame by frame (Welford).
#[derive(Clone, Debug, Default)]
pub struct RestMeter {
    /// Count, mean and sum of squared deviations.
    vertices: Vec<(f64, f64, f64)>,
    frames: u64,
}
impl_state!(RestMeter { vertices, frames });

impl RestMeter {
    /// A meter for this many vertices.
    #[must_use]
    pub fn new(vertices: usize) -> Self {
        Self { vertices: vec![(0.0, 0.0, 0.0); vertices], frames: 0 }
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: &[Curvature]) {
        self.frames += 1;
        for ((n, mean, squares), c) in self.vertices.iter_mut().zip(frame).filter(|(_, c)| c.valid) {
            *n += 1.0;
            let deviation = c.h - *mean;
            *mean += deviation / *n;
            *squares += deviation * (c.h - *mean);
        }
    }

    /// Returns the noise so far, with a dead band of `factor` deviations; 0 after fewer than two frames.
    #[must_use]
    pub fn noise(&self, factor: f64) -> RestNoise {
        let usable = self.vertices.iter().filter(|v| v.0 > 1.0);
        let (sum, freedom) = usable.fold((0.0, 0.0), |(sum, n), v| (sum + v.2, n + v.0 - 1.0));
        let deviation = if freedom > 0.0 { f64::sqrt(sum / freedom) } else { 0.0 };
        RestNoise { deviation, h_eps: factor * deviation, frames: self.frames }
    }
}

params! {
    /// Measures the noise of the curvature of a cloth at rest, for the dead band of `BuckleDetector`.
    ///
    /// Link its output to `h_eps` there. The cloth must not move in the interval: motion counts as noise. One tenth of a millimetre
    /// of jitter on edges of 25 mm has a deviation of 0.2 1/m, and causes hundreds of false buckles in each frame. At least two
    /// frames are needed; with fewer the dead band is 0.
    ///
    /// # Source
    /// An addition: An, James and Marschner (SIGGRAPH 2012), section 3, test the signs only.
    pub struct RestParams {
        /// Start of the interval at rest.
        from: f64 = 0.0, unit "s", range 0.0..=86_400.0;
        /// End of the interval at rest.
        to: f64 = 0.25, unit "s", range 0.0..=86_400.0;
        /// Dead band in deviations.
        factor: f64 = 3.0, unit "", range 0.0..=100.0;
    }
}
ports! {
    pub struct RestPorts / RestIo {
        in {
            /// Curvature of the cloth.
            curvature: Stream<Curvatures>,
        }
        out {
            /// Noise of the curvature.
            noise: Fold<RestNoise>,
        }
    }
}

/// The node `RestNoise`.
pub struct RestNoiseNode {
    meter: RestMeter,
    frames: std::ops::Range<i64>,
    factor: f64,
}

impl Node for RestNoiseNode {
    type Params = RestParams;
    type Ports = RestPorts;
    const NAME: &'static str = "RestNoise";
    const CLASS: Class = Class::Offline;

    fn shape(p: &RestParams, s: &mut Shape<'_, '_, RestPorts>) -> Result<(), Reject> {
        if p.to < p.from {
            let message = format!("`to` is {} s, `from` {} s", p.to, p.from);
            s.wrong(Reject::new("F105", message).at("to").help("it must not be less"));
        }
        if s.input(RestPorts::curvature).end.is_none() {
            let found = match s.input(RestPorts::curvature).format.is_static {
                true => "is of a mesh of one frame, which is static and never ends",
                false => "does not end",
            };
            let message = format!("`curvature` {found}; an animation of at least two frames is needed");
            let help = "export the motion of the cloth, not a pose of it, or give `duration` to MeshSequence";
            s.wrong(Reject::new("F075", message).at("curvature").help(help));
        }
        Ok(())
    }

    fn build(p: &RestParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let curvature = cx.input(RestPorts::curvature);
        // Nothing is measured after the end of the stream.
        let last = curvature.items().unwrap_or(i64::MAX);
        let at = |seconds: f64| curvature.rate.first_at(ticks(seconds)).min(last);
        let meter = RestMeter::new(curvature.format.topology.vertex_count());
        Ok(Self { meter, frames: at(p.from)..at(p.to), factor: p.factor })
    }

    fn run(&mut self, io: RestIo<'_>) -> Result<(), Fault> {
        let frames = io.curvature.items().chunks_exact(io.curvature.width().max(1));
        for (_, frame) in (io.curvature.first()..).zip(frames).filter(|(k, _)| self.frames.contains(k)) {
            self.meter.add(frame);
        }
        Ok(())
    }

    fn finish(&mut self, mut io: RestIo<'_>) -> Result<Summary, Fault> {
        let noise = self.meter.noise(self.factor);
        let mut summary: Summary = vec![
            ("frames", noise.frames.into()),
            ("deviation_per_m", noise.deviation.into()),
            ("h_eps_per_m", noise.h_eps.into()),
        ];
        if noise.frames < 2 {
            summary.push((
                "warning",
                "the interval at rest has fewer than two frames: the dead band is 0".into(),
            ));
        }
        io.noise.set(noise);
        Ok(summary)
    }

    archive_state!(meter);

    fn trial(rng: &mut Rng) -> (RestParams, MemoryFiles) {
        let from = rng.between(0.0, 0.1);
        let params = RestParams { from, to: from + rng.between(0.0, 0.5), ..RestParams::trial(rng) };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::curvature::scenes::{crumpled, grid};
    use crate::curvature::{MeanCurvature, Method};
    use crate::mesh::MeshFormat;

    #[test]
    fn jitter_of_a_tenth_of_a_millimetre_gives_the_known_noise() {
        let (n, frames) = (21, 40);
        let flat = grid(n, n, true, |u, v| [0.5 * u, 0.5 * v, 0.0]);
        let random = crate::core::random::Random::new(5, "jitter");
        let normal = |k: u64| (0..12).map(|lane| random.uniform(1, k, lane)).sum::<f64>() - 6.0;
        let mut measure = MeanCurvature::new(&flat.topology(), Method::Cotan).unwrap();
        let mut meter = RestMeter::new(n * n);
        let mut out = vec![Curvature::default(); n * n];
        for frame in 0..frames {
            let mut k = frame * 10_000;
            let jitter = |x: f64| {
                k += 1;
                x + 1e-4 * normal(k)
            };
            let jitter = std::cell::RefCell::new(jitter);
            let points = flat.map(|p| p.map(|x| (jitter.borrow_mut())(x)));
            measure.measure(&points, &mut out).unwrap();
            meter.add(&out);
        }
        let noise = meter.noise(3.0);
        assert!((0.1..0.5).contains(&noise.deviation), "{noise:?}");
        assert!((noise.h_eps - 3.0 * noise.deviation).abs() < 1e-12);
    }

    #[test]
    fn only_the_interval_counts_and_a_cloth_at_rest_has_no_noise() {
        let sheet = crumpled(5, 1);
        let n = sheet.points.len();
        let frame: Vec<Curvature> =
            (0..n).map(|v| Curvature { h: v as f64, valid: true, ..Curvature::default() }).collect();
        let mut frames: Vec<Curvature> = frame.repeat(20);
        frames[15 * n..].iter_mut().enumerate().for_each(|(k, c)| c.h = (k % 3) as f64);
        let standalone = |to| {
            Standalone::new::<RestNoiseNode>(RestParams { from: 0.0, to, factor: 2.0 })
                .input(
                    RestPorts::curvature,
                    Rate::hz(60),
                    MeshFormat::moving(sheet.topology()),
                    frames.clone(),
                )
                .run()
                .unwrap()
        };
        let run = standalone(0.25);
        assert_eq!(
            run.value(0).unwrap().get::<RestNoise>(),
            Some(&RestNoise { deviation: 0.0, h_eps: 0.0, frames: 15 })
        );
        assert!(standalone(0.4).value(0).unwrap().get::<RestNoise>().unwrap().deviation > 0.5);
        assert!(standalone(0.01).summary.iter().any(|(k, _)| *k == "warning"));
    }
}
