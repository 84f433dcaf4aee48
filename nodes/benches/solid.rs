//! The 100 lowest modes of a marimba bar by second-order elements, and the same by SciPy where it is installed.
//!
//! ```text
//! cargo bench -p foley-nodes --bench solid
//! ```

use foley_nodes::solid::fem::assembly::Discretisation;
use foley_nodes::solid::fem::eigen::eigenmodes;
use foley_nodes::solid::{Isotropic, Order, Request, read_tets};
use std::process::Command;
use std::time::Instant;

fn main() {
    let folder = env!("CARGO_MANIFEST_DIR");
    let path = format!("{folder}/../graphs/assets/meshes/marimba_bar.msh");
    let bytes = std::fs::read(&path).expect("the mesh ships with the examples");
    let mesh = read_tets(&bytes, None).expect("the mesh is valid");
    let steel = Isotropic { young: 200e9, poisson: 0.3, density: 7850.0 };
    let space = Discretisation::new(&mesh, Order::Quadratic);
    let request = Request { highest: 70_000.0, max_modes: 100, ..Request::default() };
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| {
            let start = Instant::now();
            let matrix = space.assemble(&steel);
            let assembled = start.elapsed().as_secs_f64();
            let modes = eigenmodes(&mesh, &space, &matrix, &request, &|| false).expect("the modes are found");
            println!(
                "{threads} threads: {} tetrahedra, {} unknowns, {} modes: {assembled:.3} s to assemble, {:.2} s in all, counts included; residual {:.1e}",
                mesh.tets.len(),
                matrix.size(),
                modes.lambda.len(),
                start.elapsed().as_secs_f64(),
                modes.residual,
            );
        });
    }
    let script = format!("{folder}/tests/oracles/tet10_modes.py");
    let scipy = Command::new("python3")
        .args([&script, &path, "100"])
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        .output();
    match scipy {
        Ok(out) if out.status.success() => print!("SciPy eigsh: {}", String::from_utf8_lossy(&out.stderr)),
        _ => println!("SciPy is not installed: no comparison"),
    }
}
