//! The 100 lowest modes of three solids by second-order elements, and the same by SciPy where it is installed.
//!
//! A marimba bar, and square bars of steel of 1,944 and 30,720 tetrahedra. Each row states mesh, order, tolerance, threads and residuals.
//! SciPy has the same mesh, order and number of modes, on one thread, to a tolerance of 1e-10; the largest mesh is left out, as its factor
//! takes minutes.
//!
//! ```text
//! cargo bench -p foley-nodes -- solid
//! ```

use foley_nodes::solid::fem::assembly::Discretisation;
use foley_nodes::solid::fem::eigen::eigenmodes;
use foley_nodes::solid::mesh::shapes::block;
use foley_nodes::solid::{Isotropic, Order, Request, TetMesh, read_tets};
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const MODES: usize = 100;

/// Modes of a mesh on one and on two threads.
fn modes(name: &str, mesh: &TetMesh, highest: f64) {
    let steel = Isotropic { young: 200e9, poisson: 0.3, density: 7850.0 };
    let space = Discretisation::new(mesh, Order::Quadratic);
    let request = Request { highest, max_modes: MODES, memory: 16 << 30, ..Request::default() };
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| {
            let start = Instant::now();
            let matrix = space.assemble(&steel);
            let assembled = start.elapsed().as_secs_f64();
            match eigenmodes(mesh, &space, &matrix, &request, &|_| false) {
                Ok(modes) => println!(
                    "| {name} | {} | {} | {} of {} below {highest} Hz | {threads} | {assembled:.3} | {:.2} | {:.1e} | {} |",
                    mesh.tets.len(),
                    matrix.size(),
                    modes.lambda.len(),
                    modes.counted,
                    start.elapsed().as_secs_f64(),
                    modes.residual,
                    modes.memory >> 20,
                ),
                Err(e) => println!("| {name} | {} | {} | {e} |", mesh.tets.len(), matrix.size()),
            }
        });
    }
}

/// The modes by SciPy of the mesh of a file.
fn scipy(name: &str, path: &Path) {
    let script = format!("{}/tests/oracles/tet10_modes.py", env!("CARGO_MANIFEST_DIR"));
    let scipy = Command::new("python3")
        .arg(&script)
        .arg(path)
        .arg(MODES.to_string())
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        .output();
    match scipy {
        Ok(out) if out.status.success() => {
            print!("SciPy eigsh, {name}: {}", String::from_utf8_lossy(&out.stderr));
        }
        _ => println!("SciPy is not installed: no comparison for {name}"),
    }
}

/// A mesh as Gmsh 4.1 text, which the script reads.
fn gmsh(mesh: &TetMesh) -> String {
    let (n, m) = (mesh.nodes.len(), mesh.tets.len());
    let mut text = format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {n} 1 {n}\n3 1 0 {n}\n");
    // Writing to a string cannot fail.
    for k in 1..=n {
        let _ = writeln!(text, "{k}");
    }
    for [x, y, z] in &mesh.nodes {
        let _ = writeln!(text, "{x} {y} {z}");
    }
    let _ = write!(text, "$EndNodes\n$Elements\n1 {m} 1 {m}\n3 1 4 {m}\n");
    for (k, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = tet.map(|i| i + 1);
        let _ = writeln!(text, "{} {a} {b} {c} {d}", k + 1);
    }
    text + "$EndElements\n"
}

pub fn bench() {
    let path = format!("{}/../graphs/assets/meshes/marimba_bar.msh", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).expect("the mesh ships with the examples");
    let marimba = read_tets(&bytes, None).expect("the mesh is valid");
    println!("order 2, tolerance 1e-8; s to assemble, and in all with the counts");
    println!("| mesh | tetrahedra | unknowns | modes | threads | assemble, s | all, s | residual | MiB |");
    println!("|---|---|---|---|---|---|---|---|---|");
    modes("marimba bar", &marimba, 70_000.0);
    let small = block([0.2, 0.02, 0.02], [36, 3, 3]);
    modes("square bar", &small, 200_000.0);
    modes("square bar", &block([0.2, 0.02, 0.02], [80, 8, 8]), 200_000.0);
    scipy("marimba bar", Path::new(&path));
    let file = std::env::temp_dir().join("foley_bench_bar.msh");
    if std::fs::write(&file, gmsh(&small)).is_ok() {
        scipy("square bar of 1,944 tetrahedra", &file);
    }
}
