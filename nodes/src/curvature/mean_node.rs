//! The node around [`MeanCurvature`](super::MeanCurvature).

use super::Curvatures;
use super::mean::{self, Method};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Shape};
use crate::mesh::Mesh;
use crate::{choices, params, ports};

choices! { @param Method {
    /// The cotangent Laplacian over mixed areas, projected on the normal.
    Cotan,
    /// The angle between the triangles at each edge.
    Dihedral,
} }

params! {
    /// How strongly a surface bends at each vertex, and to which side.
    ///
    /// Signed mean curvature in 1/m, above 0 where the surface bulges outwards: a sphere of radius 0.5 m has 2. Hems, vertices
    /// that three sheets share and lone ones have none and are marked. With it come the area that each vertex stands for, its
    /// normal and its position. Winding is made consistent first.
    ///
    /// # Source
    /// Meyer, Desbrun, Schröder and Barr, "Discrete Differential-Geometry Operators for Triangulated 2-Manifolds" (2003); An, James and
    /// Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3.
    pub struct MeanCurvatureParams {
        /// How it is measured.
        method: Method = Method::Cotan;
    }
}
ports! {
    pub struct MeanCurvaturePorts / MeanCurvatureIo {
        in {
            /// The surface.
            mesh: Stream<Mesh>,
        }
        out {
            /// Curvature, area, normal and position of each vertex.
            curvature: Stream<Curvatures>,
        }
    }
}

/// The node `MeanCurvature`.
pub struct MeanCurvatureNode {
    measure: mean::MeanCurvature,
    strongest: f64,
}

impl Node for MeanCurvatureNode {
    type Params = MeanCurvatureParams;
    type Ports = MeanCurvaturePorts;
    const NAME: &'static str = "MeanCurvature";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 120.0;

    fn shape(_: &MeanCurvatureParams, s: &mut Shape<'_, '_, MeanCurvaturePorts>) -> Result<(), Reject> {
        let mesh = s.input(MeanCurvaturePorts::mesh);
        s.output(MeanCurvaturePorts::curvature, mesh.rate, mesh.format);
        Ok(())
    }

    fn build(p: &MeanCurvatureParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let topology = cx.input(MeanCurvaturePorts::mesh).format.topology;
        let measure = mean::MeanCurvature::new(&topology, p.method)
            .map_err(|e| Fault::new("F105", e.to_string()).at("mesh"))?;
        Ok(Self { measure, strongest: 0.0 })
    }

    fn run(&mut self, mut io: MeanCurvatureIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.curvature.first(), io.curvature.rate(), io.curvature.width().max(1));
        for (k, out) in (0..).zip(io.curvature.items().chunks_exact_mut(width)) {
            self.measure.measure(io.mesh.item(k as isize), out).map_err(|vertex| {
                let message =
                    format!("vertex {vertex} of frame {} has a position that is no number", first + k);
                Fault::new("F105", message).at("mesh").when(rate.tick(first + k))
            })?;
            self.strongest = out.iter().fold(self.strongest, |most, c| most.max(c.h.abs()));
        }
        Ok(())
    }

    fn finish(&mut self, _: MeanCurvatureIo<'_>) -> Result<Summary, Fault> {
        let (valid, all) = (self.measure.valid().iter().filter(|v| **v).count(), self.measure.valid().len());
        let mut told: Summary =
            vec![("valid_vertices", valid.into()), ("strongest_per_m", self.strongest.into())];
        if 2 * valid < all {
            let text = format!(
                "{valid} of {all} vertices lie inside of a surface, and only there it bends: where the mesh is cut into \
                 faces of their own, merge vertices by distance before the export"
            );
            told.push(("warning", text.into()));
        }
        Ok(told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::solo::Solo;
    use crate::core::time::{Rate, ticks};
    use crate::curvature::scenes::{grid, icosphere};
    use crate::mesh::{MeshFormat, Topology};

    fn solo(topology: Topology, frames: Vec<[f32; 3]>) -> Solo {
        Solo::new::<MeanCurvatureNode>(MeanCurvatureParams { method: Method::Cotan }).input(
            MeanCurvaturePorts::mesh,
            Rate::hz(60),
            MeshFormat::moving(topology),
            frames,
        )
    }

    #[test]
    fn a_sphere_that_grows_bends_less_and_less() {
        let topology = icosphere(2).topology();
        let grown = |r: f32| topology.rest.iter().map(|p| p.map(|x| x * r)).collect::<Vec<_>>();
        let frames = [grown(1.0), grown(2.0), grown(4.0)].concat();
        let run = solo(topology.clone(), frames).window(ticks(0.02)).run().unwrap();
        let found = run.stream(MeanCurvaturePorts::curvature);
        let n = topology.rest.len();
        for (k, h) in [1.0, 0.5, 0.25].into_iter().enumerate() {
            assert!(found[k * n..(k + 1) * n].iter().all(|c| (c.h - h).abs() < 0.02 * h));
        }
    }

    #[test]
    fn faces_that_hang_apart_do_not_bend_and_that_is_told() {
        let mesh = grid(6, 6, true, |u, v| [u, v, 0.0]).topology();
        let warned = |mesh: Topology| {
            let rest = mesh.rest.clone();
            let run = solo(mesh, rest).run().unwrap();
            run.summary.iter().any(|(k, _)| *k == "warning")
        };
        let rest: Vec<_> = mesh.triangles.iter().flatten().map(|v| mesh.rest[*v as usize]).collect();
        let triangles = (0..rest.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        assert!(warned(Topology { rest, triangles }));
        let mesh = grid(12, 12, true, |u, v| [u, v, 0.0]).topology();
        assert!(!warned(mesh));
    }

    #[test]
    fn what_cannot_be_measured_is_named() {
        let mut topology = grid(4, 4, true, |u, v| [u, v, 0.0]).topology();
        let mut frames = topology.rest.repeat(3);
        frames[16 + 9][1] = f32::NAN;
        let fault = solo(topology.clone(), frames).run().err().unwrap();
        assert!(fault.code == "F105" && fault.message.contains("vertex 9 of frame 1"), "{fault}");
        // A Moebius strip.
        topology.rest = (0..10).map(|k| [k as f32, (k * k % 7) as f32, (k % 3) as f32]).collect();
        topology.triangles = (0..5)
            .flat_map(|k: u32| {
                let (a, b) = (2 * k, 2 * k + 1);
                let [c, d] = if k == 4 { [1, 0] } else { [a + 2, a + 3] };
                [[a, c, b], [b, c, d]]
            })
            .collect();
        let fault = solo(topology, vec![[0.0; 3]; 10]).run().err().unwrap();
        assert!(fault.code == "F105" && fault.message.contains("component 0"), "{fault}");
    }
}
