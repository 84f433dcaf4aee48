//! Gmsh `.msh`: version 2.2 as ASCII, version 4.1 as ASCII or binary.

use super::super::error::TetMeshError;
use super::raw::{MiddleOrder, Raw};
use super::source::{Endian, Source, shown};

/// An element type: number, nodes, name.
type Kind = (i64, usize, &'static str);

/// Tetrahedra of order 2 have the edges between the corners 2, 3 and 1, 3 last.
const MIDDLES: MiddleOrder = [0, 1, 2, 3, 5, 4];
/// Element types of up to two dimensions, which are skipped, and tetrahedra.
const READ: [Kind; 24] = [
    (1, 2, "line"),
    (2, 3, "triangle"),
    (3, 4, "quadrangle"),
    (4, 4, "tetrahedron"),
    (8, 3, "line of order 2"),
    (9, 6, "triangle of order 2"),
    (10, 9, "quadrangle of order 2"),
    (11, 10, "tetrahedron of order 2"),
    (15, 1, "point"),
    (16, 8, "quadrangle of order 2"),
    (20, 9, "triangle of order 3"),
    (21, 10, "triangle of order 3"),
    (22, 12, "triangle of order 4"),
    (23, 15, "triangle of order 4"),
    (24, 15, "triangle of order 5"),
    (25, 21, "triangle of order 5"),
    (26, 4, "line of order 3"),
    (27, 5, "line of order 4"),
    (28, 6, "line of order 5"),
    (36, 16, "quadrangle of order 3"),
    (37, 25, "quadrangle of order 4"),
    (38, 36, "quadrangle of order 5"),
    (39, 12, "quadrangle of order 3"),
    (40, 16, "quadrangle of order 4"),
];
/// Solid elements that are not read.
const REFUSED: [Kind; 16] = [
    (5, 8, "hexahedra"),
    (6, 6, "prisms"),
    (7, 5, "pyramids"),
    (12, 27, "hexahedra of order 2"),
    (13, 18, "prisms of order 2"),
    (14, 14, "pyramids of order 2"),
    (17, 20, "hexahedra of order 2"),
    (18, 15, "prisms of order 2"),
    (19, 13, "pyramids of order 2"),
    (29, 20, "tetrahedra of order 3"),
    (30, 35, "tetrahedra of order 4"),
    (31, 56, "tetrahedra of order 5"),
    (90, 40, "prisms of order 3"),
    (92, 64, "hexahedra of order 3"),
    (93, 125, "hexahedra of order 4"),
    (118, 30, "pyramids of order 3"),
];

/// Reads nodes and tetrahedra; other sections are skipped.
pub(super) fn read(bytes: &[u8]) -> Result<Raw, TetMeshError> {
    let mut source = Source::new(bytes, b"");
    let mut raw = Raw::default();
    let mut header: Option<(bool, Option<Endian>)> = None;
    while let Some(word) = source.word() {
        let Some(name) = word.strip_prefix(b"$") else {
            return Err(
                source.error(format!("found {} where a section such as $Nodes is needed", shown(word)))
            );
        };
        let end = [b"$End", name].concat();
        match (name, header) {
            (b"MeshFormat", _) => header = Some(format(&mut source)?),
            (b"Nodes" | b"Elements", None) => {
                return Err(source.error("$MeshFormat is missing before this section"));
            }
            (b"Nodes", Some((old, binary))) => {
                section(&mut source, binary, |source| {
                    if old { old_nodes(source, &mut raw) } else { nodes(source, &mut raw) }
                })?;
            }
            (b"Elements", Some((old, binary))) => {
                section(&mut source, binary, |source| {
                    if old { old_elements(source, &mut raw) } else { elements(source, &mut raw) }
                })?;
            }
            _ => {}
        }
        let read = matches!(name, b"MeshFormat" | b"Nodes" | b"Elements");
        if read {
            let found = source.word().unwrap_or_default();
            if found != end {
                return Err(source.error(format!("found {} where {} is needed", shown(found), shown(&end))));
            }
        } else if !source.pass(&end) {
            return Err(source.error(format!("{} is missing", shown(&end))));
        }
    }
    Ok(raw)
}

/// Reads a section whose numbers are binary or text.
fn section(
    source: &mut Source<'_>,
    binary: Option<Endian>,
    read: impl FnOnce(&mut Source<'_>) -> Result<(), TetMeshError>,
) -> Result<(), TetMeshError> {
    if binary.is_some() {
        source.end_line();
    }
    source.binary = binary;
    let result = read(source);
    source.binary = None;
    result
}

/// Reads the format: true for version 2.2, and the order of bytes if it is binary.
fn format(source: &mut Source<'_>) -> Result<(bool, Option<Endian>), TetMeshError> {
    let version = source.word().unwrap_or_default();
    let old = match version {
        b"2" | b"2.1" | b"2.2" => true,
        b"4.1" => false,
        _ => {
            return Err(source
                .error(format!("the version of the format is {}; 2.2 or 4.1 is needed", shown(version))));
        }
    };
    let binary = source.int("the type of the file, 0 or 1,")?;
    let size = source.int("the size of numbers")?;
    if size != 8 {
        return Err(source.error(format!("the size of numbers is {size}; 8 is needed")));
    }
    if binary == 0 {
        return Ok((old, None));
    }
    if old {
        return Err(source.error("a binary file of version 2.2; save it as ASCII, or as version 4.1"));
    }
    source.end_line();
    source.binary = Some(Endian::Little);
    let one = source.int("the number 1")?;
    source.binary = None;
    match one {
        1 => Ok((old, Some(Endian::Little))),
        0x0100_0000 => Ok((old, Some(Endian::Big))),
        _ => Err(source.error(format!("the number 1 of a binary file is {one}"))),
    }
}

fn add(source: &Source<'_>, raw: &mut Raw, tag: u64, position: [f64; 3]) -> Result<(), TetMeshError> {
    if raw.node(tag, position) { Ok(()) } else { Err(source.error(format!("node {tag} is there twice"))) }
}

fn nodes(source: &mut Source<'_>, raw: &mut Raw) -> Result<(), TetMeshError> {
    let blocks = source.size("the number of blocks of nodes")?;
    for what in ["the number of nodes", "the lowest number of a node", "the highest number of a node"] {
        source.size(what)?;
    }
    let mut tags = Vec::new();
    for _ in 0..blocks {
        let dimension = source.int("the dimension of the entity")?;
        source.int("the number of the entity")?;
        let parametric = source.int("0 or 1 for parametric coordinates")?;
        let count = source.size("the number of nodes of the block")?;
        tags.clear();
        for _ in 0..count {
            tags.push(source.size("the number of a node")?);
        }
        for tag in &tags {
            let position = source.position()?;
            for _ in 0..if parametric == 0 { 0 } else { dimension.clamp(0, 3) } {
                source.real("a parametric coordinate")?;
            }
            add(source, raw, *tag, position)?;
        }
    }
    Ok(())
}

/// Number of nodes of an element type that may be in a file, and if it is a tetrahedron.
fn kind(source: &Source<'_>, number: i64) -> Result<(usize, bool), TetMeshError> {
    if let Some((_, nodes, _)) = READ.iter().find(|(n, ..)| *n == number) {
        return Ok((*nodes, number == 4 || number == 11));
    }
    let name = REFUSED.iter().find(|(n, ..)| *n == number).map(|(.., name)| *name);
    let name = name.map_or_else(|| format!("elements of type {number}"), str::to_owned);
    Err(source.error(format!("there are {name}; tetrahedra of order 1 or 2 are needed")))
}

fn elements(source: &mut Source<'_>, raw: &mut Raw) -> Result<(), TetMeshError> {
    let blocks = source.size("the number of blocks of elements")?;
    for what in
        ["the number of elements", "the lowest number of an element", "the highest number of an element"]
    {
        source.size(what)?;
    }
    for _ in 0..blocks {
        source.int("the dimension of the entity")?;
        source.int("the number of the entity")?;
        let number = source.int("the type of the elements")?;
        let (nodes, solid) = kind(source, number)?;
        for _ in 0..source.size("the number of elements of the block")? {
            source.size("the number of an element")?;
            element(source, raw, nodes, solid)?;
        }
    }
    Ok(())
}

fn element(source: &mut Source<'_>, raw: &mut Raw, nodes: usize, solid: bool) -> Result<(), TetMeshError> {
    let mut tags = [0; 40];
    let tags = &mut tags[..nodes];
    for tag in tags.iter_mut() {
        *tag = source.size("the number of a node")?;
    }
    if solid { raw.element(tags, Some(MIDDLES)).map_err(|e| source.error(e)) } else { Ok(()) }
}

fn old_nodes(source: &mut Source<'_>, raw: &mut Raw) -> Result<(), TetMeshError> {
    for _ in 0..source.size("the number of nodes")? {
        let tag = source.size("the number of a node")?;
        let position = source.position()?;
        add(source, raw, tag, position)?;
    }
    Ok(())
}

fn old_elements(source: &mut Source<'_>, raw: &mut Raw) -> Result<(), TetMeshError> {
    for _ in 0..source.size("the number of elements")? {
        source.size("the number of an element")?;
        let number = source.int("the type of the element")?;
        let (nodes, solid) = kind(source, number)?;
        for _ in 0..source.size("the number of tags")? {
            source.int("a tag")?;
        }
        element(source, raw, nodes, solid)?;
    }
    Ok(())
}
