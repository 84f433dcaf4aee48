//! A tetrahedral mesh from a closed surface, as a node.

use super::closed_surface::ClosedSurface;
use super::tet_mesh::TetMesh;
use super::voxels::{Voxels, voxels};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// Fills a closed surface with tetrahedra: cubes of a grid, of six tetrahedra each.
    ///
    /// The surface is OBJ, STL or PLY, and has to be closed. A cube is filled if its centre lies inside, and the result is scaled to
    /// the volume of the surface. This serves thick objects; a wall needs `min_cells_wall` cells, so bowls and cups need a
    /// mesh by a mesher, by `TetMeshFile`. Coordinates times `scale` are metres.
    pub struct SurfaceToTetsParams {
        /// The surface.
        path: AssetPath;
        /// Metres per unit of the file.
        scale: f64 = 1.0, unit "m", range 0.000001..=1000.0;
        /// Cells along the longest edge of the bounding box.
        cells: usize = 24, unit "", range 1..=200;
        /// Minimum number of cells through a wall.
        min_cells_wall: usize = 2, unit "", range 1..=20;
    }
}
ports! {
    pub struct SurfaceToTetsPorts / SurfaceToTetsIo {
        in {}
        out {
            /// The mesh.
            mesh: Value<TetMesh>,
        }
    }
}

/// The node over [`voxels`].
#[derive(Debug)]
pub struct SurfaceToTets;

fn surface(p: &SurfaceToTetsParams, bytes: &[u8]) -> Result<ClosedSurface, Reject> {
    ClosedSurface::read(bytes, p.scale)
        .map_err(|e| Reject::new("F070", format!("{:?}: {e}", p.path.0)).at("path"))
}

impl Func for SurfaceToTets {
    type Params = SurfaceToTetsParams;
    type Ports = SurfaceToTetsPorts;
    const NAME: &'static str = "SurfaceToTets";

    fn check(p: &SurfaceToTetsParams, s: &mut Shape<'_, '_, SurfaceToTetsPorts>) -> Result<(), Reject> {
        surface(p, &s.bytes("path", &p.path.0)?).map(drop)
    }

    fn eval(p: &SurfaceToTetsParams, cx: &Build<'_>, mut io: SurfaceToTetsIo<'_>) -> Result<Summary, Fault> {
        let surface = surface(p, &cx.bytes("path", &p.path.0)?)?;
        let Voxels { mesh, cell, cells, dropped, scale, thickness } =
            voxels(&surface, p.cells, p.min_cells_wall)
                .map_err(|e| Fault::new("F070", format!("{:?}: {e}", p.path.0)).at("path"))?;
        let mut summary = mesh.summary();
        summary.extend([
            ("cells", cells.into()),
            ("cell_m", cell.into()),
            ("dropped_cells", dropped.into()),
            ("scaled_by", scale.into()),
            ("wall_m", thickness.into()),
        ] as [(&'static str, serde_json::Value); 5]);
        io.mesh.set(mesh);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (SurfaceToTetsParams, MemoryFiles) {
        let size = [0.0; 3].map(|_| rng.between(0.05, 0.1));
        let mesh = super::shapes::block(size, [1, 1, 1]);
        let mut text = String::new();
        for [x, y, z] in &mesh.nodes {
            text += &format!("v {x} {y} {z}\n");
        }
        for face in mesh.surface().unwrap_or_default() {
            let [a, b, c] = face.map(|c| c + 1);
            text += &format!("f {a} {b} {c}\n");
        }
        let mut files = MemoryFiles::default();
        files.insert("trial.obj", text);
        let params = SurfaceToTetsParams {
            path: AssetPath("trial.obj".into()),
            cells: 4 + rng.below(4),
            min_cells_wall: 1,
            scale: rng.between(0.5, 2.0),
        };
        (params, files)
    }
}
