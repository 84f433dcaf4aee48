//! The node `MeshSubdivide`.

use std::sync::Arc;

use super::subdivide::{Scheme, Subdivision};
use super::{Mesh, MeshFormat, MeshLimits};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Shape};
use crate::{choices, params, ports};

choices! { @param Scheme {
    /// Loop's smooth surface: folds become round, and vertices move towards their neighbours. Boundaries become smooth
    /// curves that depend on the boundary only.
    Loop,
    /// The same surface with smaller triangles: coarse vertices do not move, new ones are midpoints of the edges.
    Linear,
} }

params! {
    /// Splits each triangle of a moving mesh into four, with the same weights in all frames.
    ///
    /// A coarse simulation then has enough vertices for the detection of contacts and crumples. Subdivision adds no motion.
    /// The indices of the coarse vertices do not change. One vertex per edge follows, in the order of the lower and
    /// then of the higher vertex of the edge. An edge of one triangle, or of more than two, is a boundary. Vertices are
    /// never merged: a mesh whose faces share no vertices falls apart, so merge its vertices first.
    ///
    /// # Source
    /// Loop, "Smooth subdivision surfaces based on triangles" (1987); Hoppe et al., "Piecewise smooth surface
    /// reconstruction" (SIGGRAPH 1994) for boundaries.
    pub struct MeshSubdivideParams {
        /// Number of subdivisions.
        levels: u32 = 1, unit "times", range 0..=5;
        /// Positions of the vertices of the fine mesh.
        scheme: Scheme = Scheme::Loop;
    }
}

ports! {
    pub struct MeshSubdividePorts / MeshSubdivideIo {
        in {
            /// The mesh, static or moving.
            mesh: Stream<Mesh>,
        }
        out {
            /// The same motion with four times as many triangles per level.
            fine: Stream<Mesh>,
        }
    }
}

/// The node `MeshSubdivide`.
pub struct MeshSubdivide {
    subdivision: Arc<Subdivision>,
}

/// Rejects meshes with more faces than the limit of the readers.
fn check_size(p: &MeshSubdivideParams, coarse: &MeshFormat) -> Result<(), Reject> {
    let limit = MeshLimits::default().max_faces;
    let found = coarse.topology.triangles.len().saturating_mul(4_usize.saturating_pow(p.levels));
    if found <= limit {
        return Ok(());
    }
    let message = format!("{} levels make {found} triangles; at most {limit} are allowed", p.levels);
    Err(Reject::new("F051", message).at("levels").help("use fewer levels"))
}

fn subdivision(p: &MeshSubdivideParams, coarse: &MeshFormat) -> Result<Subdivision, Reject> {
    Subdivision::new(&coarse.topology, p.levels, p.scheme)
        .map_err(|e| Reject::new("F070", e.to_string()).at("mesh"))
}

impl Node for MeshSubdivide {
    type Params = MeshSubdivideParams;
    type Ports = MeshSubdividePorts;
    const NAME: &'static str = "MeshSubdivide";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 10.0;

    fn shape(p: &MeshSubdivideParams, s: &mut Shape<'_, '_, MeshSubdividePorts>) -> Result<(), Reject> {
        let mesh = s.input(MeshSubdividePorts::mesh);
        check_size(p, &mesh.format)?;
        let subdivision = subdivision(p, &mesh.format)?;
        let format = MeshFormat {
            topology: Arc::new(subdivision.topology().clone()),
            is_static: mesh.format.is_static,
            materials: Arc::new(subdivision.materials(&mesh.format.topology, &mesh.format.materials)),
        };
        s.prepare(subdivision);
        s.output(MeshSubdividePorts::fine, mesh.rate, format);
        Ok(())
    }

    fn build(p: &MeshSubdivideParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let subdivision = match cx.prepared::<Subdivision>() {
            Some(cached) => cached,
            None => Arc::new(subdivision(p, &cx.input(MeshSubdividePorts::mesh).format)?),
        };
        Ok(Self { subdivision })
    }

    fn run(&mut self, mut io: MeshSubdivideIo<'_>) -> Result<(), Fault> {
        let (coarse_width, fine_width) = (io.mesh.width().max(1), io.fine.width().max(1));
        let frames =
            io.mesh.items().chunks_exact(coarse_width).zip(io.fine.items().chunks_exact_mut(fine_width));
        frames.for_each(|(coarse, fine)| self.subdivision.refine(coarse, fine));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, ticks};
    use crate::mesh::Topology;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    fn standalone(levels: u32, vertices: [usize; 2]) -> Standalone {
        let sheet = FlatSheet { vertices, size: [0.2, 0.2], velocity: [0.3, 0.0, 0.1] };
        let topology = sheet.topology();
        let mut frames = vec![[0.0; 3]; 30 * topology.vertex_count()];
        for (k, frame) in frames.chunks_exact_mut(topology.vertex_count()).enumerate() {
            sheet.positions(k as f64 / 60.0, frame);
        }
        let p = MeshSubdivideParams { levels, ..MeshSubdivideParams::read(&|_| None).unwrap() };
        Standalone::new::<MeshSubdivide>(p).input(
            MeshSubdividePorts::mesh,
            Rate::hz(60),
            MeshFormat::moving(topology),
            frames,
        )
    }

    #[test]
    fn a_subdivided_sheet_has_the_motion_of_the_coarse_one() {
        let run = standalone(2, [5, 5]).run().unwrap().stream(MeshSubdividePorts::fine);
        assert_eq!(run.len(), 30 * 17 * 17);
        let (first, last) = (&run[..17 * 17], &run[29 * 17 * 17..]);
        for (a, b) in first.iter().zip(last) {
            let wanted = [0.3 * 29.0 / 60.0, 0.0, 0.1 * 29.0 / 60.0];
            assert!((0..3).all(|k| (b[k] - a[k] - wanted[k]).abs() < 1e-5));
        }
        for window in [ticks(0.0123), ticks(0.3)] {
            assert_eq!(
                standalone(2, [5, 5]).window(window).run().unwrap().stream(MeshSubdividePorts::fine),
                run
            );
        }
    }

    #[test]
    fn zero_levels_change_nothing_and_too_many_are_rejected() {
        let plain = standalone(0, [3, 3]).run().unwrap().stream(MeshSubdividePorts::fine);
        assert_eq!(
            plain[..9],
            FlatSheet { vertices: [3, 3], size: [0.2, 0.2], velocity: [0.0; 3] }.topology().rest
        );
        let reject = standalone(5, [80, 80]).shape().unwrap_err();
        assert_eq!((reject.code, reject.field.as_deref()), ("F051", Some("levels")));
        let empty = Standalone::new::<MeshSubdivide>(MeshSubdivideParams::read(&|_| None).unwrap()).input(
            MeshSubdividePorts::mesh,
            Rate::hz(60),
            MeshFormat::moving(Topology::default()),
            vec![],
        );
        assert!(empty.shape().is_ok());
    }
}
