//! VTK XML unstructured grid, `.vtu`, with arrays as ASCII or as inline base64.

use super::super::error::TetMeshError;
use super::raw::{MiddleOrder, Raw};
use super::source::shown;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// Order of the edges of a quadratic tetrahedron.
const MIDDLES: MiddleOrder = [0, 1, 2, 3, 4, 5];
/// Cells of up to two dimensions, which are skipped.
const FLAT: [u64; 17] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 21, 22, 23, 28, 30, 34, 68, 69];

/// An element of XML: its name, its attributes, and the text up to the next element.
struct Tag<'a> {
    name: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
    text: &'a str,
    line: usize,
}

impl<'a> Tag<'a> {
    fn get(&self, name: &str) -> Option<&'a str> {
        self.attributes.iter().find(|(n, _)| *n == name).map(|(_, value)| *value)
    }

    fn error(&self, what: impl Into<String>) -> TetMeshError {
        TetMeshError::Text { position: format!("line {}", self.line), what: what.into() }
    }
}

/// The elements of an XML document in their order; comments and declarations are skipped.
struct Tags<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Tags<'a> {
    /// Passes a text.
    fn pass(&mut self, bytes: usize) -> &'a str {
        let (text, rest) = self.rest.split_at(bytes);
        self.line += text.bytes().filter(|b| *b == b'\n').count();
        self.rest = rest;
        text
    }

    fn error(&self, what: &str) -> TetMeshError {
        TetMeshError::Text { position: format!("line {}", self.line), what: what.into() }
    }

    fn next(&mut self) -> Result<Option<Tag<'a>>, TetMeshError> {
        loop {
            let Some(start) = self.rest.find('<') else { return Ok(None) };
            self.pass(start);
            let (open, close) = if self.rest.starts_with("<!--") { (4, "-->") } else { (1, ">") };
            let line = self.line;
            self.pass(open);
            let Some(end) = self.rest.find(close) else {
                return Err(self.error("an element of XML does not end"));
            };
            let inner = self.pass(end);
            self.pass(close.len());
            if open == 4 || inner.starts_with(['?', '!']) {
                continue;
            }
            let inner = inner.trim_end_matches('/');
            let (name, attributes) = inner.split_at(inner.find(char::is_whitespace).unwrap_or(inner.len()));
            let text = &self.rest[..self.rest.find('<').unwrap_or(self.rest.len())];
            return Ok(Some(Tag { name, attributes: pairs(attributes), text, line }));
        }
    }
}

fn pairs(mut text: &str) -> Vec<(&str, &str)> {
    let mut all = Vec::new();
    while let Some((name, rest)) = text.split_once('=') {
        let rest = rest.trim_start();
        let Some(quote) = rest.chars().next().filter(|c| *c == '"' || *c == '\'') else { break };
        let Some((value, rest)) = rest[1..].split_once(quote) else { break };
        all.push((name.trim(), value));
        text = rest;
    }
    all
}

/// Encoding of the arrays of the file.
#[derive(Clone, Copy)]
struct Encoding {
    big: bool,
    /// Bytes of the number before the values of an array.
    header: usize,
}

/// Reads points and tetrahedra.
pub(super) fn read(bytes: &[u8]) -> Result<Raw, TetMeshError> {
    // Appended data may be no text, but all before it is.
    let valid = bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid());
    let mut tags = Tags { rest: valid, line: 1 };
    let mut encoding = None;
    let (mut points, mut connectivity, mut offsets, mut kinds) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut in_points = false;
    while let Some(tag) = tags.next()? {
        match tag.name {
            "VTKFile" => encoding = Some(file(&tag)?),
            "AppendedData" => break,
            "Points" => in_points = true,
            "/Points" => in_points = false,
            "DataArray" => {
                let encoding =
                    encoding.ok_or_else(|| tag.error("<VTKFile> is missing before this element"))?;
                match tag.get("Name") {
                    Some("connectivity") => connectivity = whole(&tag, encoding)?,
                    Some("offsets") => offsets = whole(&tag, encoding)?,
                    Some("types") => kinds = whole(&tag, encoding)?,
                    _ if in_points => points = numbers(&tag, encoding)?,
                    _ => {}
                }
            }
            _ => {}
        }
    }
    let mut raw = Raw::default();
    if !points.len().is_multiple_of(3) {
        return Err(TetMeshError::Format(format!(
            "a .vtu file with {} coordinates, which is no multiple of 3",
            points.len()
        )));
    }
    for (k, p) in points.chunks_exact(3).enumerate() {
        raw.node(k as u64, [p[0], p[1], p[2]]);
    }
    cells(&mut raw, &connectivity, &offsets, &kinds)
        .map_err(|what| TetMeshError::Text { position: "<Cells>".into(), what })?;
    Ok(raw)
}

fn file(tag: &Tag<'_>) -> Result<Encoding, TetMeshError> {
    match tag.get("type") {
        Some("UnstructuredGrid") => {}
        other => {
            let found = other.unwrap_or("missing");
            return Err(
                tag.error(format!("the type is {}; UnstructuredGrid is needed", shown(found.as_bytes())))
            );
        }
    }
    if tag.get("compressor").is_some() {
        return Err(tag.error("the arrays are compressed; save without compression"));
    }
    let header = match tag.get("header_type") {
        None | Some("UInt32") => 4,
        Some("UInt64") => 8,
        Some(other) => {
            return Err(
                tag.error(format!("header_type is {}; UInt32 or UInt64 is needed", shown(other.as_bytes())))
            );
        }
    };
    Ok(Encoding { big: tag.get("byte_order") == Some("BigEndian"), header })
}

fn cells(raw: &mut Raw, connectivity: &[u64], offsets: &[u64], kinds: &[u64]) -> Result<(), String> {
    if offsets.len() != kinds.len() {
        return Err(format!("{} offsets for {} types of cells", offsets.len(), kinds.len()));
    }
    let mut start = 0;
    for (k, (end, kind)) in offsets.iter().zip(kinds).enumerate() {
        let end = usize::try_from(*end).unwrap_or(usize::MAX);
        let nodes = connectivity.get(start..end).ok_or_else(|| {
            format!("offset {k} is {end}, after {start}, for {} entries of connectivity", connectivity.len())
        })?;
        start = end;
        match (kind, nodes.len()) {
            (10, 4) | (24, 10) => raw.element(nodes, Some(MIDDLES))?,
            (10 | 24, n) => {
                return Err(format!(
                    "cell {k} is a tetrahedron of type {kind} with {n} nodes; 4 or 10 are needed"
                ));
            }
            _ if FLAT.contains(kind) => {}
            _ => return Err(format!("cell {k} has type {kind}; tetrahedra, types 10 and 24, are needed")),
        }
    }
    Ok(())
}

/// The values of an array as the bytes of one number each.
fn values<'a>(tag: &Tag<'a>, encoding: Encoding) -> Result<Values<'a>, TetMeshError> {
    match tag.get("format") {
        Some("ascii") => Ok(Values::Text(tag.text.split_ascii_whitespace())),
        Some("binary") => {
            let mut bytes = decode(tag.text).ok_or_else(|| tag.error("found text that is no base64"))?;
            if bytes.len() < encoding.header {
                return Err(tag.error("the array ends before the number of its bytes"));
            }
            let body = bytes.split_off(encoding.header);
            let length = bytes.iter().enumerate().fold(0_u64, |sum, (k, b)| {
                let shift = if encoding.big { encoding.header - 1 - k } else { k };
                sum | u64::from(*b) << (8 * shift)
            });
            if length != body.len() as u64 {
                return Err(
                    tag.error(format!("the array has {} bytes; its header states {length}", body.len()))
                );
            }
            Ok(Values::Bytes(body))
        }
        other => {
            let found = other.unwrap_or("missing");
            Err(tag.error(format!(
                "the format of an array is {}; ascii or binary is needed",
                shown(found.as_bytes())
            )))
        }
    }
}

enum Values<'a> {
    Text(std::str::SplitAsciiWhitespace<'a>),
    Bytes(Vec<u8>),
}

/// Decodes base64; a header that is encoded on its own ends with padding in the middle of the text.
fn decode(text: &str) -> Option<Vec<u8>> {
    let text: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    for group in text.chunks(4) {
        STANDARD.decode_vec(group, &mut out).ok()?;
    }
    Some(out)
}

/// Reads bytes as numbers of a type.
fn typed<T>(
    tag: &Tag<'_>,
    bytes: &[u8],
    big: bool,
    read: &dyn Fn(u64, &str) -> Option<T>,
) -> Result<Vec<T>, TetMeshError> {
    let kind = tag.get("type").unwrap_or("missing");
    let size = match kind {
        "Int8" | "UInt8" => 1,
        "Int16" | "UInt16" => 2,
        "Int32" | "UInt32" | "Float32" => 4,
        "Int64" | "UInt64" | "Float64" => 8,
        _ => {
            return Err(tag.error(format!(
                "the type of an array is {}; Float64 or Int64 would be right",
                shown(kind.as_bytes())
            )));
        }
    };
    if !bytes.len().is_multiple_of(size) {
        return Err(tag.error(format!("the array has {} bytes, no multiple of {size}", bytes.len())));
    }
    let number = |chunk: &[u8]| {
        let bits = chunk
            .iter()
            .enumerate()
            .fold(0, |sum, (k, b)| sum | u64::from(*b) << (8 * if big { size - 1 - k } else { k }));
        read(bits, kind)
            .ok_or_else(|| tag.error(format!("an array of {kind} holds a number that is out of range here")))
    };
    bytes.chunks_exact(size).map(number).collect()
}

fn parsed<T: std::str::FromStr>(tag: &Tag<'_>, word: &str) -> Result<T, TetMeshError> {
    word.parse().map_err(|_| tag.error(format!("found {} in an array of numbers", shown(word.as_bytes()))))
}

fn whole(tag: &Tag<'_>, encoding: Encoding) -> Result<Vec<u64>, TetMeshError> {
    match values(tag, encoding)? {
        Values::Text(mut words) => words.try_fold(Vec::new(), |mut all, word| {
            all.push(parsed(tag, word)?);
            Ok(all)
        }),
        Values::Bytes(bytes) => typed(tag, &bytes, encoding.big, &|bits, kind| match kind {
            "Int8" => u64::try_from(bits as u8 as i8).ok(),
            "Int16" => u64::try_from(bits as u16 as i16).ok(),
            "Int32" => u64::try_from(bits as u32 as i32).ok(),
            "Int64" => u64::try_from(bits as i64).ok(),
            "Float32" | "Float64" => None,
            _ => Some(bits),
        }),
    }
}

fn numbers(tag: &Tag<'_>, encoding: Encoding) -> Result<Vec<f64>, TetMeshError> {
    match values(tag, encoding)? {
        Values::Text(mut words) => words.try_fold(Vec::new(), |mut all, word| {
            all.push(parsed(tag, word)?);
            Ok(all)
        }),
        Values::Bytes(bytes) => typed(tag, &bytes, encoding.big, &|bits, kind| match kind {
            "Float32" => Some(f32::from_bits(bits as u32).into()),
            "Float64" => Some(f64::from_bits(bits)),
            _ => None,
        }),
    }
}
