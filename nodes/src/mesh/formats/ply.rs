//! PLY: polygons over vertices, as text or as binary numbers of either order of bytes.

use super::{MeshError, MeshLimits, ObjMesh};

const FORMAT: &str = "PLY";
/// Longest header, bytes.
const MAX_HEADER: usize = 1 << 16;
/// Most properties of an element.
const MAX_PROPERTIES: usize = 256;

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// A number in the body.
#[derive(Clone, Copy)]
struct Scalar {
    bytes: usize,
    float: bool,
    signed: bool,
}

#[derive(Clone)]
struct Property {
    name: String,
    /// Type of the length, if it is a list.
    count: Option<Scalar>,
    scalar: Scalar,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

fn malformed(what: impl Into<String>) -> MeshError {
    MeshError::Malformed { format: FORMAT, what: what.into() }
}

fn scalar(word: &str) -> Result<Scalar, MeshError> {
    let (bytes, float, signed) = match word {
        "char" | "int8" => (1, false, true),
        "uchar" | "uint8" => (1, false, false),
        "short" | "int16" => (2, false, true),
        "ushort" | "uint16" => (2, false, false),
        "int" | "int32" => (4, false, true),
        "uint" | "uint32" => (4, false, false),
        "float" | "float32" => (4, true, true),
        "double" | "float64" => (8, true, true),
        other => {
            return Err(malformed(format!("{other:?} is no type of a property, such as float or uchar")));
        }
    };
    Ok(Scalar { bytes, float, signed })
}

/// The header: encoding, elements, and the first byte of the body.
fn header(bytes: &[u8]) -> Result<(Encoding, Vec<Element>, usize), MeshError> {
    let (mut encoding, mut elements, mut at) = (None, Vec::<Element>::new(), 0);
    loop {
        let rest = bytes.get(at..).unwrap_or_default();
        let Some(end) = rest.iter().take(MAX_HEADER).position(|b| *b == b'\n') else {
            return Err(malformed("the header has no line `end_header`"));
        };
        let text = String::from_utf8_lossy(&rest[..end]).into_owned();
        at += end + 1;
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["format", name, _] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    other => return Err(malformed(format!("{other:?} is no format of PLY"))),
                });
            }
            ["element", name, count] => {
                let count =
                    count.parse().map_err(|_| malformed(format!("{count:?} is no number of elements")))?;
                elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", of @ ..] => {
                let last = elements.last_mut().ok_or_else(|| malformed("a property before any element"))?;
                let (count, kind, name) = match of {
                    ["list", count, kind, name] => (Some(scalar(count)?), kind, name),
                    [kind, name] => (None, kind, name),
                    _ => return Err(malformed(format!("`{text}`: `property float x` is needed"))),
                };
                if count.is_some_and(|c| c.float) || last.properties.len() == MAX_PROPERTIES {
                    return Err(malformed(format!("`{text}`: lengths of lists are whole numbers")));
                }
                last.properties.push(Property { name: (*name).to_owned(), count, scalar: scalar(kind)? });
            }
            ["end_header"] => break,
            ["ply" | "comment" | "obj_info", ..] | [] => {}
            _ => return Err(malformed(format!("`{text}` is no line of a header"))),
        }
        if at > MAX_HEADER {
            return Err(malformed("the header is too long"));
        }
    }
    Ok((encoding.ok_or_else(|| malformed("the header has no line `format`"))?, elements, at))
}

/// The numbers of the body, in order.
struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
}

impl Body<'_> {
    fn number(&mut self, of: Scalar) -> Result<f64, MeshError> {
        if self.encoding == Encoding::Ascii {
            let rest = self.bytes.get(self.at..).unwrap_or_default();
            let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
            let word = rest[start..].split(u8::is_ascii_whitespace).next().unwrap_or_default();
            self.at += start + word.len();
            let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
            return number.ok_or_else(|| {
                malformed(format!("`{}` at byte {} is no number", String::from_utf8_lossy(word), self.at))
            });
        }
        let Some(raw) = self.bytes.get(self.at..self.at + of.bytes) else {
            return Err(MeshError::Truncated {
                format: FORMAT,
                what: "the body".into(),
                needed: (self.at + of.bytes) as u64,
                available: self.bytes.len() as u64,
            });
        };
        self.at += of.bytes;
        let mut wide = [0; 8];
        for (k, byte) in raw.iter().enumerate() {
            // Least significant first.
            wide[if self.encoding == Encoding::Little { k } else { of.bytes - 1 - k }] = *byte;
        }
        let unsigned = u64::from_le_bytes(wide);
        Ok(match (of.float, of.bytes) {
            (true, 4) => f64::from(f32::from_bits(unsigned as u32)),
            (true, _) => f64::from_bits(unsigned),
            (false, bytes) if of.signed => {
                let unused = 64 - 8 * bytes as u32;
                ((unsigned << unused) as i64 >> unused) as f64
            }
            (false, _) => unsigned as f64,
        })
    }

    fn length(&mut self, of: Scalar) -> Result<usize, MeshError> {
        let length = self.number(of)?;
        if (0.0..=65_535.0).contains(&length) && length.fract() == 0.0 {
            Ok(length as usize)
        } else {
            Err(malformed(format!("a list of {length} numbers")))
        }
    }
}

/// Reads the elements `vertex` (properties `x`, `y` and `z`) and `face` (the list `vertex_indices`); others are skipped.
pub(super) fn parse(bytes: &[u8], limits: &MeshLimits) -> Result<ObjMesh, MeshError> {
    let (encoding, elements, at) = header(bytes)?;
    let mut body = Body { bytes, at, encoding };
    let mut mesh = ObjMesh::empty();
    let mut found = false;
    for element in &elements {
        let axis = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name);
        let (vertices, faces) = (element.name == "vertex", element.name == "face");
        if vertices {
            limits.vertices(element.count)?;
            let axes = element.properties.iter().filter(|p| p.count.is_none() && axis(&p.name).is_some());
            if axes.count() != 3 {
                return Err(malformed("vertices need one each of the properties x, y and z"));
            }
            found = true;
        }
        if faces {
            limits.faces(element.count)?;
        }
        if element.properties.is_empty() && element.count > 0 {
            return Err(malformed(format!("the element {:?} has no property", element.name)));
        }
        for _ in 0..element.count {
            let mut position = [0.0; 3];
            for property in &element.properties {
                let Some(count) = property.count else {
                    let number = body.number(property.scalar)?;
                    if let Some(axis) = axis(&property.name).filter(|_| vertices) {
                        position[axis] = number;
                    }
                    continue;
                };
                let corners = faces && matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
                let mut face = Vec::new();
                for _ in 0..body.length(count)? {
                    let number = body.number(property.scalar)?;
                    if corners {
                        if number.fract() != 0.0 || !(0.0..f64::from(u32::MAX)).contains(&number) {
                            return Err(malformed(format!("a face names vertex {number}")));
                        }
                        face.push(number as u32);
                    }
                }
                if corners {
                    if face.len() < 3 {
                        return Err(malformed(format!("a face has {} corners; 3 are needed", face.len())));
                    }
                    mesh.push_face(&face, "");
                }
            }
            if vertices {
                mesh.positions.push(position);
            }
        }
    }
    if !found {
        return Err(malformed("there is no element `vertex`"));
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty uchar red\nproperty double y\nproperty float z\n\
                          element face 2\nproperty int flags\nproperty list uchar int vertex_indices\nend_header\n";

    fn read(bytes: &[u8]) -> Result<ObjMesh, MeshError> {
        ObjMesh::parse(bytes, None, &MeshLimits::default())
    }

    fn text() -> String {
        format!(
            "ply\nformat ascii 1.0\ncomment a square\n{HEADER}0 9 0 0\n1 9 0 0\n1 9 1.5 0\n0 9 1 -0.25\n7 3 0 1 2\n7 3 0 2 3\n"
        )
    }

    fn binary(little: bool) -> Vec<u8> {
        let name = if little { "binary_little_endian" } else { "binary_big_endian" };
        let mut out = format!("ply\nformat {name} 1.0\n{HEADER}").into_bytes();
        let mut put = |raw: &[u8]| {
            let mut raw = raw.to_vec();
            if !little {
                raw.reverse();
            }
            out.extend(raw);
        };
        for (x, y, z) in [(0.0_f32, 0.0_f64, 0.0_f32), (1.0, 0.0, 0.0), (1.0, 1.5, 0.0), (0.0, 1.0, -0.25)] {
            put(&x.to_le_bytes());
            put(&[9]);
            put(&y.to_le_bytes());
            put(&z.to_le_bytes());
        }
        for face in [[0_i32, 1, 2], [0, 2, 3]] {
            put(&(-7_i32).to_le_bytes());
            put(&[3]);
            face.iter().for_each(|v| put(&v.to_le_bytes()));
        }
        out
    }

    #[test]
    fn all_encodings_are_one_mesh() {
        let mesh = read(text().as_bytes()).unwrap();
        assert_eq!(mesh.positions, [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0], [0.0, 1.0, -0.25]]);
        assert_eq!((mesh.face(0), mesh.face(1), mesh.face_count()), (&[0, 1, 2][..], &[0, 2, 3][..], 2));
        assert_eq!(read(&binary(true)).unwrap(), mesh);
        assert_eq!(read(&binary(false)).unwrap(), mesh);
        assert_eq!(read(text().replace('\n', "\r\n").as_bytes()).unwrap(), mesh);
    }

    #[test]
    fn damage_is_named() {
        let whole = text();
        for (from, to, part) in [
            ("0 2 3\n", "0 2 4\n", "vertex 4"),
            ("3 0 2 3\n", "2 0 2\n", "2 corners"),
            ("1.5", "wide", "`wide`"),
            ("property float z\n", "", "x, y and z"),
            ("ascii", "morse", "morse"),
            ("vertex 4", "vertex 99999999999", "vertices"),
            ("end_header", "end", "`end`"),
        ] {
            let error = read(whole.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(error.contains(part), "{from:?}: {error}");
        }
        let short = binary(true);
        let error = read(&short[..short.len() - 3]).unwrap_err().to_string();
        assert!(error.contains("truncated"), "{error}");
    }
}
