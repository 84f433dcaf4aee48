//! Item 14: The 100 lowest modes of a free steel block of 0.2 by 0.1 by 0.05 m with linear tetrahedra, from the assembled matrices.
//!
//! `PEERS_MESHES` names a folder with `2k.msh` and `30k.msh`, the meshes of the other programs; without it the block is a grid with about as
//! many tetrahedra. The others iterate to rounding error. foley stops at a relative residual of 1e-8, and proves by the signs of the pivots of
//! another factor that no mode is missing.

use super::measure::Item;
use foley_nodes::core::computation::unmonitored;
use foley_nodes::solid::fem::assembly::Discretisation;
use foley_nodes::solid::fem::eigen::eigenmodes;
use foley_nodes::solid::mesh::shapes::block;
use foley_nodes::solid::{Isotropic, Order, Request, TetMesh, read_tets};
use std::f64::consts::TAU;
use std::path::Path;

const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.3, density: 7850.0 };

fn mesh(name: &str, cells: [usize; 3]) -> TetMesh {
    let Some(folder) = std::env::var_os("PEERS_MESHES") else { return block([0.2, 0.1, 0.05], cells) };
    let bytes =
        std::fs::read(Path::new(&folder).join(format!("{name}.msh"))).expect("a mesh in PEERS_MESHES");
    read_tets(&bytes, None).expect("a sound mesh")
}

pub fn bench(item: Item) {
    for (name, cells) in [("2k", [13, 6, 4]), ("30k", [33, 17, 9])] {
        let mesh = mesh(name, cells);
        let space = Discretisation::new(&mesh, Order::Linear);
        let matrix = space.assemble(&STEEL);
        item.print(&format!("tets.{name}"), mesh.tets.len() as f64, "tetrahedra");
        item.print(&format!("dofs.{name}"), matrix.size() as f64, "dofs");
        item.time(&format!("assembly.{name}"), 1.0, "s", || space.assemble(&STEEL));
        let request =
            Request { highest: 1e6, max_modes: 100, shift: 200.0, memory: 16 << 30, ..Request::default() };
        let solve =
            || eigenmodes(&mesh, &space, &matrix, &request, &unmonitored).expect("the modes converge");
        let found = solve();
        let frequency = |k: usize| found.lambda[k].sqrt() / TAU;
        item.print(&format!("first-mode.{name}"), frequency(0), "Hz");
        item.print(&format!("mode100.{name}"), frequency(99), "Hz");
        item.print(&format!("residual.{name}"), found.residual, "relative");
        item.time(&format!("eigsh100.{name}"), 1.0, "s", solve);
    }
}
