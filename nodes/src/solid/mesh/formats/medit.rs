//! Medit `.mesh`, ASCII.

use super::super::error::TetMeshError;
use super::raw::{MiddleOrder, Raw};
use super::source::{Source, shown};

/// Order of the edges of a tetrahedron of order 2.
const MIDDLES: MiddleOrder = [0, 1, 2, 3, 4, 5];
/// Solid elements that are not tetrahedra.
const OTHERS: [&[u8]; 4] = [b"hexahedra", b"prisms", b"pyramids", b"hexaedra"];

/// Reads vertices and tetrahedra; other sections are skipped.
pub(super) fn read(bytes: &[u8]) -> Result<Raw, TetMeshError> {
    let mut source = Source::new(bytes, b"#");
    let mut raw = Raw::default();
    while let Some(word) = source.word() {
        let keyword = word.to_ascii_lowercase();
        match &keyword[..] {
            b"dimension" => {
                let found = source.int("the dimension")?;
                if found != 3 {
                    return Err(source.error(format!("the dimension is {found}; 3 is needed")));
                }
            }
            b"vertices" => {
                for k in 0..source.size("the number of vertices")? {
                    let position = source.position()?;
                    source.real("the reference of the vertex")?;
                    if !raw.node(k + 1, position) {
                        return Err(source.error("there are two sections of vertices"));
                    }
                }
            }
            b"tetrahedra" => elements::<4>(&mut source, &mut raw)?,
            b"tetrahedrap2" => elements::<10>(&mut source, &mut raw)?,
            b"end" => break,
            other if OTHERS.contains(&other) => {
                let count = source.size("the number of elements")?;
                if count > 0 {
                    let name = String::from_utf8_lossy(word).into_owned();
                    return Err(source.error(format!("there are {count} {name}; tetrahedra are needed")));
                }
            }
            other if other[0].is_ascii_alphabetic() => {
                // Numbers up to the next keyword.
                while source.peek().is_some_and(|w| !w[0].is_ascii_alphabetic()) {
                    source.word();
                }
            }
            _ => return Err(source.error(format!("found {} where a keyword is needed", shown(word)))),
        }
    }
    Ok(raw)
}

fn elements<const N: usize>(source: &mut Source<'_>, raw: &mut Raw) -> Result<(), TetMeshError> {
    for _ in 0..source.size("the number of tetrahedra")? {
        let mut tags = [0; N];
        for tag in &mut tags {
            *tag = source.size("the number of a vertex")?;
        }
        source.real("the reference of the tetrahedron")?;
        raw.element(&tags, Some(MIDDLES)).map_err(|e| source.error(e))?;
    }
    Ok(())
}
