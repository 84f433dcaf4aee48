//! A mesh of a shell of revolution, as a node.

use super::revolution::{Revolution, RevolutionError};
use super::tet_mesh::TetMesh;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// A mesh of a plate, bowl, cup, bell or tube: a profile that turns about the z axis.
    ///
    /// The profile is the middle of the wall, from the axis or from the inner rim outwards; points are joined by straight lines. A point at
    /// radius 0 closes the shell at the axis. A solid rod is a plate as thick as the rod is long.
    pub struct RevolvedMeshParams {
        /// Points of the profile: radius and height.
        profile: Vec<[f64; 2]>, unit "m", range -1000.0..=1000.0;
        /// Thickness of the wall at each point, or everywhere.
        thickness: Vec<f64>, unit "m", range 0.000001..=1000.0;
        /// Cells around the axis.
        around: usize = 24, unit "cells", range 3..=720;
        /// Cells between two points of the profile.
        along: usize = 2, unit "cells", range 1..=200;
        /// Cells through the wall.
        layers: usize = 1, unit "cells", range 1..=200;
    }
}
ports! {
    pub struct RevolvedMeshPorts / RevolvedMeshIo {
        in {}
        out {
            /// The mesh.
            mesh: Value<TetMesh>,
        }
    }
}

/// The node over [`Revolution`].
#[derive(Debug)]
pub struct RevolvedMesh;

fn mesh(p: &RevolvedMeshParams) -> Result<TetMesh, Reject> {
    let shell = Revolution {
        profile: p.profile.clone(),
        thickness: p.thickness.clone(),
        around: p.around,
        along: p.along,
        layers: p.layers,
    };
    shell.mesh().map_err(|e| {
        let field = if matches!(e, RevolutionError::Thicknesses { .. }) { "thickness" } else { "profile" };
        Reject::new("F070", e.to_string()).at(field)
    })
}

impl Func for RevolvedMesh {
    type Params = RevolvedMeshParams;
    type Ports = RevolvedMeshPorts;
    const NAME: &'static str = "RevolvedMesh";

    fn check(p: &RevolvedMeshParams, _: &mut Shape<'_, '_, RevolvedMeshPorts>) -> Result<(), Reject> {
        mesh(p).map(drop)
    }

    fn eval(p: &RevolvedMeshParams, _: &Build<'_>, mut io: RevolvedMeshIo<'_>) -> Result<Summary, Fault> {
        let mesh = mesh(p)?;
        let summary = mesh.summary();
        io.mesh.set(mesh);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (RevolvedMeshParams, MemoryFiles) {
        let radius = rng.between(0.02, 0.1);
        let params = RevolvedMeshParams {
            profile: vec![[[0.0, radius][rng.below(2)], 0.0], [2.0 * radius, rng.between(0.0, 0.02)]],
            thickness: vec![rng.between(0.001, 0.004)],
            around: 3 + rng.below(6),
            along: 1 + rng.below(2),
            layers: 1 + rng.below(2),
        };
        (params, MemoryFiles::default())
    }
}
