//! Formats of tetrahedral meshes, recognised by their content.

mod gmsh;
mod medit;
mod raw;
mod source;
mod tetgen;
mod vtu;

use super::element::edges;
use super::error::TetMeshError;
use super::tet_mesh::TetMesh;
use source::Source;
use std::collections::HashMap;

#[cfg(test)]
mod tests;

/// Reads a tetrahedral mesh; the `nodes` are the `.node` file of a TetGen `.ele`.
///
/// # Errors
/// Position in the file, the value found, and what is needed; and the errors of [`TetMesh::new`].
///
/// # Complexity
/// O(n) in bytes on average: memory is bounded by the file, not by the counts in it.
///
/// # Example
/// ```
/// use foley_nodes::solid::mesh::formats::read_tets;
/// let text = b"MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\nTetrahedra\n1\n1 2 3 4 0\nEnd\n";
/// let mesh = read_tets(text, None)?;
/// assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
/// # Ok::<(), foley_nodes::solid::TetMeshError>(())
/// ```
pub fn read_tets(bytes: &[u8], nodes: Option<&[u8]>) -> Result<TetMesh, TetMeshError> {
    let bytes = crate::core::files::strip_bom(bytes);
    let text = bytes.trim_ascii_start();
    let raw = if text.starts_with(b"$") {
        gmsh::read(bytes)?
    } else if text.starts_with(b"<") {
        vtu::read(bytes)?
    } else if text.starts_with(b"# vtk DataFile") {
        return Err(TetMeshError::Format("a legacy .vtk file; save it as .vtu".into()));
    } else {
        let mut source = Source::new(bytes, b"#");
        match source.word() {
            Some(word) if word.eq_ignore_ascii_case(b"MeshVersionFormatted") => medit::read(bytes)?,
            Some(word) if word.iter().all(u8::is_ascii_digit) => tetgen::read(bytes, nodes)?,
            Some(word) => {
                return Err(TetMeshError::Format(format!("a file that begins with {}", source::shown(word))));
            }
            None => return Err(TetMeshError::Format("an empty file".into())),
        }
    };
    raw.mesh()
}

/// Writes a mesh as Medit `.mesh`, with elements of order 2 if edges are curved.
#[must_use]
pub fn write_medit(mesh: &TetMesh) -> String {
    use std::fmt::Write as _;
    let mut nodes = mesh.nodes.clone();
    let mut middles = HashMap::new();
    let mut elements = String::new();
    for tet in &mesh.tets {
        for corner in tet {
            let _ = write!(elements, "{} ", corner + 1);
        }
        for ends in if mesh.curves.is_empty() { Vec::new() } else { edges(tet).to_vec() } {
            let node = middles.entry(ends).or_insert_with(|| {
                nodes.push(mesh.middle(ends));
                nodes.len()
            });
            let _ = write!(elements, "{node} ");
        }
        elements += "0\n";
    }
    let mut text = format!("MeshVersionFormatted 2\nDimension 3\nVertices\n{}\n", nodes.len());
    for [x, y, z] in &nodes {
        let _ = writeln!(text, "{x:?} {y:?} {z:?} 0");
    }
    let name = if mesh.curves.is_empty() { "Tetrahedra" } else { "TetrahedraP2" };
    let _ = writeln!(text, "{name}\n{}", mesh.tets.len());
    text + &elements + "End\n"
}
