//! A tetrahedral mesh from a file, as a node.

use super::formats::read_tets;
use super::quality::WARN_ANGLE;
use super::tet_mesh::TetMesh;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// A tetrahedral mesh of an object from a file.
    ///
    /// Formats are Gmsh `.msh` 2.2 (ASCII) and 4.1 (ASCII and binary), Medit `.mesh`, TetGen `.ele` with its `.node`, and VTK `.vtu` with
    /// arrays as ASCII or inline base64. The content decides, not the name. Elements are tetrahedra of order 1 or 2; other solid elements
    /// are an error, and those of lower dimension are skipped. A node of an element of order 2 that is off the middle of its edge by 1e-6
    /// of the length makes the edge curved: `ModalAnalysis` follows the curve, while the surface joins the corners by flat triangles.
    /// Elements are oriented, and unused nodes are removed. Coordinates times `scale` are metres: 0.001 for a mesh in
    /// millimetres.
    pub struct TetMeshFileParams {
        /// The file.
        path: AssetPath;
        /// The `.node` file of a TetGen `.ele`.
        nodes: Option<AssetPath> = None;
        /// Metres per unit of the file.
        scale: f64 = 1.0, unit "m", range 0.000001..=1000.0;
    }
}
ports! {
    pub struct TetMeshFilePorts / TetMeshFileIo {
        in {}
        out {
            /// The mesh.
            mesh: Value<TetMesh>,
        }
    }
}

/// The node over [`read_tets`].
#[derive(Debug)]
pub struct TetMeshFile;

/// Largest extent in m above which the unit of an object is doubted.
const LARGE: f64 = 20.0;

fn read(p: &TetMeshFileParams, bytes: &[u8], nodes: Option<&[u8]>) -> Result<TetMesh, Reject> {
    let mesh = read_tets(bytes, nodes)
        .map_err(|e| Reject::new("F070", format!("{:?}: {e}", p.path.0)).at("path"))?;
    Ok(mesh.scaled(p.scale))
}

fn notes(mesh: &TetMesh) -> Vec<String> {
    let mut notes = Vec::new();
    let size = mesh.size();
    let largest = size.iter().copied().fold(0.0, f64::max);
    if largest > LARGE {
        notes.push(format!(
            "the object is {largest:.4} m long: if its file is in millimetres, set `scale: 0.001`"
        ));
    }
    let quality = mesh.quality();
    if quality.worst.angle < WARN_ANGLE {
        let (tet, angle) = (quality.worst.tet, quality.worst.angle);
        notes.push(format!(
            "tetrahedron {tet} has a dihedral angle of {angle:.2} degrees: flat elements make modes inaccurate"
        ));
    }
    if quality.components > 1 {
        notes.push(format!("the mesh consists of {} separate parts", quality.components));
    }
    notes
}

impl Func for TetMeshFile {
    type Params = TetMeshFileParams;
    type Ports = TetMeshFilePorts;
    const NAME: &'static str = "TetMeshFile";

    fn check(p: &TetMeshFileParams, s: &mut Shape<'_, '_, TetMeshFilePorts>) -> Result<(), Reject> {
        let bytes = s.bytes("path", &p.path.0)?;
        let nodes = p.nodes.as_ref().map(|path| s.bytes("nodes", &path.0)).transpose()?;
        let mesh = read(p, &bytes, nodes.as_deref())?;
        notes(&mesh).into_iter().for_each(|note| s.note(note));
        Ok(())
    }

    fn eval(p: &TetMeshFileParams, cx: &Build<'_>, mut io: TetMeshFileIo<'_>) -> Result<Summary, Fault> {
        let bytes = cx.bytes("path", &p.path.0)?;
        let nodes = p.nodes.as_ref().map(|path| cx.bytes("nodes", &path.0)).transpose()?;
        let mesh = read(p, &bytes, nodes.as_deref())?;
        let summary = mesh.summary();
        io.mesh.set(mesh);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (TetMeshFileParams, MemoryFiles) {
        let mut params = TetMeshFileParams { path: AssetPath("trial.mesh".into()), nodes: None, scale: 1.0 };
        params.scale = rng.between(0.5, 2.0);
        let mut files = MemoryFiles::default();
        files.insert(
            "trial.mesh",
            super::formats::write_medit(&<TetMesh as crate::core::item::Data>::trial(rng)),
        );
        (params, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    #[test]
    fn millimetres_are_noticed_and_scaled() {
        let block = super::super::shapes::block([70.0, 20.0, 10.0], [2, 1, 1]);
        let text = super::super::formats::write_medit(&block);
        assert_eq!(notes(&block).len(), 1);
        let path = AssetPath("a.mesh".into());
        let mut run = Standalone::func::<TetMeshFile>(TetMeshFileParams { path, nodes: None, scale: 0.001 });
        run.files.insert("a.mesh", text);
        let run = run.run().unwrap();
        let value = run.value(0).unwrap();
        let mesh = value.get::<TetMesh>().unwrap();
        assert!((mesh.volume() - 14e-6).abs() < 1e-15);
        assert!(notes(mesh).is_empty());
    }
}
