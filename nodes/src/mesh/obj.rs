//! Wavefront OBJ: polygons over vertices, as text.

use super::clip::metres;
use super::polygon::Triangulator;
use super::{Materials, MeshClip, MeshError, MeshLimits, ReadOptions, Topology};

/// The polygons of one OBJ file, or of one of its objects or groups.
///
/// # Shapes
/// `positions` has one entry per `v` line that belongs to the mesh, in file units. Face `k` has the corners
/// `corners[starts[k]..starts[k + 1]]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjMesh {
    /// Positions in file units.
    pub positions: Vec<[f64; 3]>,
    corners: Vec<u32>,
    starts: Vec<usize>,
    /// The material of each face (`usemtl`).
    materials: Materials,
}

impl ObjMesh {
    /// Reads an OBJ file: every face of it, or those of the object (`o`) or group (`g`) called `name`.
    ///
    /// With a name, only the vertices that its faces use are kept, in the order of the file. Texture coordinates,
    /// normals, lines and points are skipped, and of materials only the names are read; free-form surfaces are refused.
    ///
    /// # Errors
    /// [`MeshError::Line`] names the line and what is wrong in it; [`MeshError::NoSuchMesh`] lists the names there are.
    ///
    /// # Complexity
    /// O(bytes).
    ///
    /// # Example
    /// ```
    /// use foley_nodes::mesh::{MeshLimits, ObjMesh};
    /// let quad = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    /// let mesh = ObjMesh::parse(quad, None, &MeshLimits::default())?;
    /// assert_eq!(mesh.face(0), [0, 1, 2, 3]);
    /// # Ok::<(), foley_nodes::mesh::MeshError>(())
    /// ```
    pub fn parse(bytes: &[u8], name: Option<&str>, limits: &MeshLimits) -> Result<Self, MeshError> {
        limits.bytes(bytes.len() as u64)?;
        let mut parser = Parser {
            mesh: Self { starts: vec![0], ..Self::default() },
            wanted: name,
            names: Vec::new(),
            inside: name.is_none(),
            in_object: false,
            material: String::new(),
            limits,
        };
        let mut joined = Vec::new();
        let mut first = 0;
        for (k, raw) in bytes.split(|&b| b == b'\n').enumerate() {
            let raw = raw.strip_suffix(b"\r").unwrap_or(raw);
            if joined.is_empty() {
                first = k + 1;
            }
            if let Some(part) = raw.strip_suffix(b"\\") {
                joined.extend_from_slice(part);
                joined.push(b' ');
            } else if joined.is_empty() {
                parser.line(raw, first)?;
            } else {
                joined.extend_from_slice(raw);
                parser.line(&joined, first)?;
                joined.clear();
            }
        }
        if !joined.is_empty() {
            parser.line(&joined, first)?;
        }
        parser.finish()
    }

    /// Number of polygons.
    #[must_use]
    pub fn face_count(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Corners of one polygon; nothing for a face that does not exist.
    #[must_use]
    pub fn face(&self, index: usize) -> &[u32] {
        match (self.starts.get(index), self.starts.get(index + 1)) {
            (Some(&a), Some(&b)) => &self.corners[a..b],
            _ => &[],
        }
    }

    /// The triangles and the rest pose in metres, and the number of faces dropped.
    ///
    /// # Errors
    /// [`MeshError::Empty`] without vertices or faces, [`MeshError::NotFinite`] for a bad position.
    pub fn topology(&self, options: &ReadOptions) -> Result<(Topology, usize), MeshError> {
        let options = options.checked()?;
        let mut triangles = Triangulator::new();
        for face in 0..self.face_count() {
            triangles.push(&self.positions, self.face(face))?;
            options.limits.faces(triangles.triangle_count() as u64)?;
        }
        let faces = triangles.finish();
        if self.positions.is_empty() || faces.triangles.is_empty() {
            return Err(MeshError::Empty {
                mesh: "OBJ".to_owned(),
                vertices: self.positions.len(),
                faces: faces.triangles.len(),
                frames: 1,
            });
        }
        let mut rest = Vec::with_capacity(self.positions.len());
        for (v, &p) in self.positions.iter().enumerate() {
            rest.push(metres(p, options.metres_per_unit, 0, v)?);
        }
        Ok((Topology { rest, triangles: faces.triangles }, faces.dropped))
    }

    /// A clip with the faces and rest pose of this mesh.
    pub(super) fn clip(&self, times: Vec<f64>, options: &ReadOptions) -> Result<MeshClip, MeshError> {
        let (topology, dropped) = self.topology(options)?;
        Ok(MeshClip::new(topology, times, dropped)?.with_materials(self.of_triangles()?))
    }

    /// The material of each triangle that [`ObjMesh::topology`] gives.
    fn of_triangles(&self) -> Result<Materials, MeshError> {
        if self.materials.names().iter().all(String::is_empty) {
            return Ok(Materials::default());
        }
        let mut triangles = Triangulator::new();
        let mut materials = Materials::default();
        for face in 0..self.face_count() {
            let before = triangles.triangle_count();
            triangles.push(&self.positions, self.face(face))?;
            let name = self.materials.name(self.materials.of_triangle(face as u32));
            (before..triangles.triangle_count()).for_each(|_| materials.push(name));
        }
        Ok(materials)
    }

    /// First face that is not the same in `other`.
    pub(super) fn first_different_face(&self, other: &Self) -> Option<usize> {
        if self.starts == other.starts && self.corners == other.corners {
            return None;
        }
        (0..self.face_count().max(other.face_count())).find(|&k| self.face(k) != other.face(k))
    }
}

struct Parser<'a> {
    mesh: ObjMesh,
    wanted: Option<&'a str>,
    names: Vec<String>,
    /// Whether faces belong to the wanted object or group.
    inside: bool,
    /// Whether the wanted name is that of an object: its groups are inside too.
    in_object: bool,
    /// What the faces that follow are made of.
    material: String,
    limits: &'a MeshLimits,
}

impl Parser<'_> {
    fn line(&mut self, raw: &[u8], line: usize) -> Result<(), MeshError> {
        let bytes = raw.split(|&b| b == b'#').next().unwrap_or(&[]);
        let mut words = bytes.split(|b| b.is_ascii_whitespace() || *b == 0).filter(|w| !w.is_empty());
        let error = |what: String| MeshError::Line { line, what };
        match words.next() {
            Some(b"v") => {
                let mut p = [0.0; 3];
                for (k, x) in p.iter_mut().enumerate() {
                    let word = words
                        .next()
                        .ok_or_else(|| error(format!("`v` has {k} numbers, at least 3 are needed")))?;
                    *x = number(word).ok_or_else(|| {
                        error(format!("`{}` is no number in `v x y z`", String::from_utf8_lossy(word)))
                    })?;
                }
                self.limits.vertices(self.mesh.positions.len() as u64 + 1)?;
                self.mesh.positions.push(p);
            }
            Some(b"f" | b"fo") if self.inside => self.face(words, line)?,
            Some(b"o") => {
                let found = self.name(bytes, 1);
                self.inside = self.wanted.is_none_or(|w| w == found);
                self.in_object = self.wanted.is_some() && self.inside;
            }
            Some(b"g") => {
                let found = self.name(bytes, 1);
                // A `g` line may name several groups.
                let named =
                    self.wanted.is_some_and(|w| found == w || found.split_whitespace().any(|g| g == w));
                self.inside = self.wanted.is_none() || self.in_object || named;
            }
            Some(b"usemtl") => {
                let text = bytes.trim_ascii().get(6..).unwrap_or(&[]);
                self.material = String::from_utf8_lossy(text).trim().to_owned();
            }
            Some(b"cstype" | b"surf" | b"curv" | b"curv2") => {
                return Err(error("free-form curves and surfaces are not read: export polygons".into()));
            }
            _ => {}
        }
        Ok(())
    }

    fn name(&mut self, bytes: &[u8], skip: usize) -> String {
        /// Names kept for the error message.
        const KEPT: usize = 256;
        let text = String::from_utf8_lossy(bytes.trim_ascii().get(skip..).unwrap_or(&[])).trim().to_owned();
        if self.wanted.is_some() && self.names.len() < KEPT && !text.is_empty() && !self.names.contains(&text)
        {
            self.names.push(text.clone());
        }
        text
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>, line: usize) -> Result<(), MeshError> {
        let vertices = self.mesh.positions.len();
        let start = self.mesh.corners.len();
        for word in words {
            // v, v/vt, v//vn and v/vt/vn: what follows the first stroke has to be numbers, and is not used.
            let mut parts = word.split(|&b| b == b'/');
            let vertex = parts.next().and_then(integer);
            let rest = parts.clone().count() <= 2 && parts.all(|p| p.is_empty() || integer(p).is_some());
            let (Some(vertex), true) = (vertex, rest) else {
                let what = format!(
                    "`{}` is no corner: v, v/vt, v//vn or v/vt/vn are",
                    String::from_utf8_lossy(word)
                );
                return Err(MeshError::Line { line, what });
            };
            // Negative numbers count back from the last vertex so far.
            let at = if vertex > 0 { vertex - 1 } else { vertices as i64 + vertex };
            if vertex == 0 || at < 0 || at >= i64::from(u32::MAX) {
                let what = format!(
                    "a face names vertex {vertex}, there are {vertices} so far (1 to {vertices}, or -1 to -{vertices})"
                );
                return Err(MeshError::Line { line, what });
            }
            self.mesh.corners.push(at as u32);
        }
        if self.mesh.corners.len() - start < 3 {
            let what =
                format!("a face has {} corners, at least 3 are needed", self.mesh.corners.len() - start);
            return Err(MeshError::Line { line, what });
        }
        self.mesh.starts.push(self.mesh.corners.len());
        self.mesh.materials.push(&self.material);
        self.limits.faces(self.mesh.face_count() as u64)
    }

    fn finish(self) -> Result<ObjMesh, MeshError> {
        let Self { mut mesh, wanted, names, .. } = self;
        let vertices = mesh.positions.len();
        for face in 0..mesh.face_count() {
            // Vertices may follow the faces that use them.
            if let Some(&c) = mesh.face(face).iter().find(|&&c| c as usize >= vertices) {
                return Err(MeshError::FaceIndex { face, vertex: i64::from(c), vertices });
            }
        }
        if let Some(wanted) = wanted {
            if mesh.face_count() == 0 {
                return Err(MeshError::NoSuchMesh { wanted: wanted.to_owned(), available: names });
            }
            let mut used = vec![false; vertices];
            mesh.corners.iter().for_each(|&c| used[c as usize] = true);
            let mut moved = Vec::with_capacity(vertices);
            let mut next = 0;
            for &u in &used {
                moved.push(next);
                next += u32::from(u);
            }
            mesh.corners.iter_mut().for_each(|c| *c = moved[*c as usize]);
            let mut keep = used.iter();
            mesh.positions.retain(|_| keep.next().copied().unwrap_or(false));
        }
        Ok(mesh)
    }
}

fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn integer(word: &[u8]) -> Option<i64> {
    std::str::from_utf8(word).ok()?.parse().ok().filter(|&i: &i64| i.unsigned_abs() < 1 << 40)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    fn parse(text: &str, name: Option<&str>) -> Result<ObjMesh, MeshError> {
        ObjMesh::parse(text.as_bytes(), name, &MeshLimits::default())
    }

    #[test]
    fn every_form_of_a_corner_names_the_same_vertex() {
        for face in [
            "1 2 3 4",
            "1/1 2/2 3/3 4/4",
            "1//9 2//9 3//9 4//9",
            "1/1/1 2/2/2 3/3/3 4/4/4",
            "-4 -3 -2 -1",
            "1/ 2/ 3/ 4/",
        ] {
            let mesh = parse(&format!("# a square\r\n{SQUARE}f {face} # end\r\n"), None).unwrap();
            assert_eq!(mesh.face(0), [0, 1, 2, 3], "{face}");
        }
    }

    #[test]
    fn a_line_goes_on_after_a_backslash() {
        let mesh = parse(&format!("{SQUARE}f 1 2 \\\n3 \\\r\n4"), None).unwrap();
        assert_eq!(mesh.face(0), [0, 1, 2, 3]);
    }

    #[test]
    fn one_object_or_group_keeps_only_its_own_vertices() {
        let text = format!(
            "o left\n{SQUARE}f 1 2 3\no right side\nv 2 0 0\nv 3 0 0\nv 3 1 0\ng a b\nf 5 6 7\ng c\nf 1 6 7\n"
        );
        let right = parse(&text, Some("right side")).unwrap();
        assert_eq!((right.positions.len(), right.face_count()), (4, 2));
        assert_eq!((right.face(0), right.face(1)), (&[1, 2, 3][..], &[0, 2, 3][..]));
        assert_eq!(
            parse(&text, Some("b")).unwrap().positions,
            [[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0]]
        );
        let error = parse(&text, Some("middle")).unwrap_err().to_string();
        assert!(error.contains("left, right side, a b, c"), "{error}");
    }

    #[test]
    fn triangles_keep_the_material_of_their_face() {
        let text =
            format!("{SQUARE}f 1 2 3 4\nusemtl silk\nf 1 1 2\nf 1 2 3\nusemtl wool cloth # thick\nf 2 3 4\n");
        let clip = parse(&text, None).unwrap().clip(vec![0.0], &ReadOptions::default()).unwrap();
        let materials = clip.materials();
        let names: Vec<_> = (0..4).map(|t| materials.name(materials.of_triangle(t))).collect();
        assert_eq!(names, ["", "", "silk", "wool cloth"]);
        let plain = parse(&format!("{SQUARE}f 1 2 3 4\n"), None).unwrap();
        assert_eq!(
            plain.clip(vec![0.0], &ReadOptions::default()).unwrap().materials(),
            &Materials::default()
        );
    }

    #[test]
    fn errors_name_the_line_and_what_would_be_right() {
        for (text, line, part) in [
            ("v 1 2\n", 1, "at least 3"),
            ("\n\nv 1 2 x\n", 3, "`x` is no number"),
            ("v 0 0 0\nf 1 2\n", 2, "2 corners"),
            ("v 0 0 0\nf 0 1 1\n", 2, "vertex 0"),
            ("v 0 0 0\nf -2 1 1\n", 2, "vertex -2"),
            ("f 1/1/1/1 2 3\n", 1, "no corner"),
            ("cstype bspline\n", 1, "free-form"),
        ] {
            match parse(text, None).unwrap_err() {
                MeshError::Line { line: found, what } => {
                    assert_eq!(found, line, "{text}");
                    assert!(what.contains(part), "{what}");
                }
                other => panic!("{other}"),
            }
        }
        assert!(matches!(
            parse("v 0 0 0\nf 1 2 3\n", None),
            Err(MeshError::FaceIndex { face: 0, vertex: 1, .. })
        ));
    }

    #[test]
    fn a_rest_pose_is_scaled_to_metres_and_must_be_finite() {
        let options = ReadOptions { metres_per_unit: 0.01, ..ReadOptions::default() };
        let (t, dropped) =
            parse(&format!("{SQUARE}f 1 2 3 4\nf 1 1 2\n"), None).unwrap().topology(&options).unwrap();
        assert_eq!((t.rest[2], dropped), ([0.01, 0.01, 0.0], 1));
        let nan = parse("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", None).unwrap().topology(&options);
        assert!(matches!(nan, Err(MeshError::NotFinite { vertex: 1, .. })));
        let empty = parse("v 0 0 0\n", None).unwrap().topology(&options);
        assert!(matches!(empty, Err(MeshError::Empty { vertices: 1, faces: 0, .. })));
    }

    #[test]
    fn limits_are_kept() {
        let limits = MeshLimits { max_vertices: 3, ..MeshLimits::default() };
        let error = ObjMesh::parse(SQUARE.as_bytes(), None, &limits).unwrap_err();
        assert!(matches!(error, MeshError::Limit { field: "max_vertices", .. }));
    }
}
