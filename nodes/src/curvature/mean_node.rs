//! The node around [`MeanCurvature`](super::MeanCurvature).

use super::Curvatures;
use super::fans::Fan;
use super::mean::{self, Method};
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
        let valid = self.measure.valid().iter().filter(|v| **v).count();
        let mut told: Summary =
            vec![("valid_vertices", valid.into()), ("strongest_per_m", self.strongest.into())];
        told.extend(flaws(self.measure.fans()).map(|text| ("warning", text.into())));
        Ok(told)
    }

    archive_state!(strongest);
}

/// What of a mesh keeps it from bending, from how many vertices on, and what would mend it.
const FLAWS: [(Fan, f64, &str); 4] = [
    (
        Fan::Shared,
        0.0,
        "lie on edges that more than two triangles share, where there is no one surface to bend: remove faces that are there \
         twice, or that stand inside",
    ),
    (
        Fan::Hem,
        0.5,
        "lie on a hem, and only inside of a surface it bends: where the mesh is cut into faces of their own, merge vertices by \
         distance before the export",
    ),
    (
        Fan::Pinched,
        0.5,
        "hold parts together that touch in this point alone, and do not bend: split the parts",
    ),
    (Fan::Lone, 0.5, "belong to no triangle, and do not bend: leave them out of the export"),
];

/// Warnings of all flaws that a mesh has in more than their share of vertices.
fn flaws(fans: &[Fan]) -> impl Iterator<Item = String> {
    FLAWS.iter().filter_map(|(flaw, share, text)| {
        let found = fans.iter().filter(|fan| *fan == flaw).count();
        let first = fans.iter().position(|fan| fan == flaw)?;
        (found as f64 > share * fans.len() as f64)
            .then(|| format!("{found} of {} vertices, {first} first, {text}", fans.len()))
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
    fn a_sphere_that_grows_bends_less_and_less() {
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
    fn what_keeps_a_mesh_from_bending_is_told_by_its_own_cause() {
        let mesh = grid(6, 6, true, |u, v| [u, v, 0.0]).topology();
        let warned = |mesh: Topology| {
            let rest = mesh.rest.clone();
            let run = standalone(mesh, rest).run().unwrap();
            let texts = run.summary.iter().filter(|(k, _)| *k == "warning").map(|(_, text)| text.to_string());
            texts.collect::<Vec<_>>()
        };
        let rest: Vec<_> = mesh.triangles.iter().flatten().map(|v| mesh.rest[*v as usize]).collect();
        let triangles = (0..rest.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let told = warned(Topology { rest, triangles });
        assert!(told.len() == 1 && told[0].contains("merge vertices by distance"), "{told:?}");
        let mut mesh = grid(12, 12, true, |u, v| [u, v, 0.0]).topology();
        assert_eq!(warned(mesh.clone()), Vec::<String>::new());
        // A fin stands on one edge of the sheet: that is the cause which is named, however few vertices it spoils.
        let [a, b, _] = mesh.triangles[60];
        mesh.rest.push([0.5, 0.5, 1.0]);
        mesh.triangles.push([a, b, 144]);
        let told = warned(mesh);
        let wanted =
            format!("2 of 145 vertices, {} first, lie on edges that more than two triangles share", a.min(b));
        assert!(told.len() == 1 && told[0].contains(&wanted), "{told:?}");
    }

    #[test]
    fn what_cannot_be_measured_is_named() {
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
