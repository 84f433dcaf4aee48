//! TetGen: nodes in a `.node` file, elements in an `.ele` file.

use super::super::error::TetMeshError;
use super::raw::Raw;
use super::source::{Source, shown};

/// Reads an `.ele` file over the nodes of a `.node` file, counted from 0 or 1 as there.
pub(super) fn read(elements: &[u8], nodes: Option<&[u8]>) -> Result<Raw, TetMeshError> {
    let mut source = Source::new(elements, b"#");
    let (count, corners) = (source.size("the number of elements")?, source.size("nodes per element")?);
    if corners == 3 {
        return Err(TetMeshError::Format(
            "a TetGen .node file: `path` is that of the .ele, `nodes` that of the .node".into(),
        ));
    }
    if corners != 4 && corners != 10 {
        return Err(source.error(format!("elements have {corners} nodes; 4 or 10 are needed")));
    }
    source.rest_of_line();
    let nodes = nodes.ok_or_else(|| {
        TetMeshError::Format("a TetGen .ele file without its .node file: set `nodes`".into())
    })?;
    let mut raw = read_nodes(nodes).map_err(|e| match e {
        TetMeshError::Text { position, what } => {
            TetMeshError::Text { position: format!("{position} of the .node file"), what }
        }
        other => other,
    })?;
    for _ in 0..count {
        source.size("the number of the element")?;
        let mut tags = [0; 10];
        let tags = &mut tags[..corners as usize];
        for tag in tags.iter_mut() {
            *tag = source.size("the number of a node")?;
        }
        raw.element(tags, None).map_err(|e| source.error(e))?;
        source.rest_of_line();
    }
    end(&mut source, "elements", count)?;
    Ok(raw)
}

fn read_nodes(bytes: &[u8]) -> Result<Raw, TetMeshError> {
    let mut source = Source::new(crate::core::files::strip_bom(bytes), b"#");
    let (count, dimension) = (source.size("the number of nodes")?, source.size("the dimension")?);
    if dimension != 3 {
        return Err(source.error(format!("the dimension is {dimension}; 3 is needed")));
    }
    source.rest_of_line();
    let mut raw = Raw::default();
    for k in 0..count {
        let tag = source.size("the number of the node")?;
        if k == 0 && tag > 1 {
            return Err(source.error(format!("the first node has number {tag}; 0 or 1 is needed")));
        }
        let position = source.position()?;
        if !raw.node(tag, position) {
            return Err(source.error(format!("node {tag} is there twice")));
        }
        source.rest_of_line();
    }
    end(&mut source, "nodes", count)?;
    Ok(raw)
}

fn end(source: &mut Source<'_>, what: &str, count: u64) -> Result<(), TetMeshError> {
    match source.word() {
        Some(word) => {
            Err(source.error(format!("found {} after the {count} {what} of the header", shown(word))))
        }
        None => Ok(()),
    }
}
