//! The node `MeanCurvature`.

use super::item::{Curvatures, Method};
use super::mean;
use super::one_ring::OneRing;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Shape};
use crate::mesh::Mesh;
use crate::{archive_state, choices, params, ports};

choices! { @param Method {
    /// The cotangent Laplacian over mixed areas, projected on the normal.
    Cotan,
    /// The angle between the triangles at each edge.
    Dihedral,
} }

params! {
    /// Computes the signed mean curvature of a surface at each vertex.
    ///
    /// The unit is 1/m, and the sign is positive where the surface is convex outwards: a sphere of radius 0.5 m has 2. Vertices at
    /// the boundary, non-manifold vertices and isolated ones have no curvature and are invalid. The output also has the area, normal
    /// and position of each vertex. The winding is made consistent first.
    ///
    /// # Source
    /// Meyer, Desbrun, Schröder and Barr, "Discrete Differential-Geometry Operators for Triangulated 2-Manifolds" (2003); An, James and
    /// Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3.
    pub struct MeanCurvatureParams {
        /// Discretisation of the curvature.
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
    max_curvature: f64,
}

impl Node for MeanCurvatureNode {
    type Params = MeanCurvatureParams;
    type Ports = MeanCurvaturePorts;
    const NAME: &'static str = "MeanCurvature";
    const VERSION: u32 = 2;
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
        Ok(Self { measure, max_curvature: 0.0 })
    }

    fn run(&mut self, mut io: MeanCurvatureIo<'_>) -> Result<(), Fault> {
        let (first, rate, width) = (io.curvature.first(), io.curvature.rate(), io.curvature.width().max(1));
        for (k, out) in (0..).zip(io.curvature.items().chunks_exact_mut(width)) {
            self.measure.measure(io.mesh.item(k as isize), out).map_err(|vertex| {
                let message =
                    format!("vertex {vertex} of frame {} has a position that is no number", first + k);
                Fault::new("F105", message).at("mesh").when(rate.tick(first + k))
            })?;
            self.max_curvature = out.iter().fold(self.max_curvature, |max, c| max.max(c.h.abs()));
        }
        Ok(())
    }

    fn finish(&mut self, _: MeanCurvatureIo<'_>) -> Result<Summary, Fault> {
        let valid = self.measure.valid().iter().filter(|v| **v).count();
        let mut summary: Summary =
            vec![("valid_vertices", valid.into()), ("strongest_per_m", self.max_curvature.into())];
        summary.extend(warnings(self.measure.one_rings()).map(|text| ("warning", text.into())));
        Ok(summary)
    }

    archive_state!(max_curvature);
}

/// One-rings without curvature: the fraction of vertices above which there is a warning, and its text.
const FLAWS: [(OneRing, f64, &str); 4] = [
    (
        OneRing::NonManifoldEdge,
        0.0,
        "lie on edges that more than two triangles share, where curvature is not defined: remove duplicate and inner faces",
    ),
    (
        OneRing::Boundary,
        0.5,
        "lie on the boundary, where curvature is not defined: if the mesh consists of separate faces, merge vertices by distance \
         before the export",
    ),
    (
        OneRing::NonManifoldVertex,
        0.5,
        "join parts that share no edge there, so that curvature is not defined: split the parts",
    ),
    (OneRing::Isolated, 0.5, "belong to no triangle and have no curvature: leave them out of the export"),
];

/// Warnings for the flaws of a mesh.
fn warnings(one_rings: &[OneRing]) -> impl Iterator<Item = String> {
    FLAWS.iter().filter_map(|(flaw, limit, text)| {
        let found = one_rings.iter().filter(|ring| *ring == flaw).count();
        let first = one_rings.iter().position(|ring| ring == flaw)?;
        (found as f64 > limit * one_rings.len() as f64)
            .then(|| format!("{found} of {} vertices, {first} first, {text}", one_rings.len()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, ticks};
    use crate::curvature::scenes::{grid, icosphere};
    use crate::mesh::{MeshFormat, Topology};

    fn standalone(topology: Topology, frames: Vec<[f32; 3]>) -> Standalone {
        Standalone::new::<MeanCurvatureNode>(MeanCurvatureParams { method: Method::Cotan }).input(
            MeanCurvaturePorts::mesh,
            Rate::hz(60),
            MeshFormat::moving(topology),
            frames,
        )
    }

    #[test]
    fn a_growing_sphere_has_a_falling_curvature() {
        let topology = icosphere(2).topology();
        let grown = |r: f32| topology.rest.iter().map(|p| p.map(|x| x * r)).collect::<Vec<_>>();
        let frames = [grown(1.0), grown(2.0), grown(4.0)].concat();
        let run = standalone(topology.clone(), frames).window(ticks(0.02)).run().unwrap();
        let found = run.stream(MeanCurvaturePorts::curvature);
        let n = topology.rest.len();
        for (k, h) in [1.0, 0.5, 0.25].into_iter().enumerate() {
            assert!(found[k * n..(k + 1) * n].iter().all(|c| (c.h - h).abs() < 0.02 * h));
        }
    }

    #[test]
    fn each_flaw_of_a_mesh_has_its_own_warning() {
        let mesh = grid(6, 6, true, |u, v| [u, v, 0.0]).topology();
        let warned = |mesh: Topology| {
            let rest = mesh.rest.clone();
            let run = standalone(mesh, rest).run().unwrap();
            let texts = run.summary.iter().filter(|(k, _)| *k == "warning").map(|(_, text)| text.to_string());
            texts.collect::<Vec<_>>()
        };
        let rest: Vec<_> = mesh.triangles.iter().flatten().map(|v| mesh.rest[*v as usize]).collect();
        let triangles = (0..rest.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let found_warnings = warned(Topology { rest, triangles });
        assert!(
            found_warnings.len() == 1 && found_warnings[0].contains("merge vertices by distance"),
            "{found_warnings:?}"
        );
        let mut mesh = grid(12, 12, true, |u, v| [u, v, 0.0]).topology();
        assert_eq!(warned(mesh.clone()), Vec::<String>::new());
        // A fin on one edge of the sheet causes a warning for only two vertices.
        let [a, b, _] = mesh.triangles[60];
        mesh.rest.push([0.5, 0.5, 1.0]);
        mesh.triangles.push([a, b, 144]);
        let found_warnings = warned(mesh);
        let expected =
            format!("2 of 145 vertices, {} first, lie on edges that more than two triangles share", a.min(b));
        assert!(found_warnings.len() == 1 && found_warnings[0].contains(&expected), "{found_warnings:?}");
    }

    #[test]
    fn faults_name_the_vertex_or_the_component() {
        let mut topology = grid(4, 4, true, |u, v| [u, v, 0.0]).topology();
        let mut frames = topology.rest.repeat(3);
        frames[16 + 9][1] = f32::NAN;
        let fault = standalone(topology.clone(), frames).run().err().unwrap();
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
        let fault = standalone(topology, vec![[0.0; 3]; 10]).run().err().unwrap();
        assert!(fault.code == "F105" && fault.message.contains("component 0"), "{fault}");
    }
}
