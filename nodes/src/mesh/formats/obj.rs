//! Wavefront OBJ: polygons over vertices, as text. PLY files become the same.

use super::clip::to_metres;
use super::ply;
use super::{Materials, MeshClip, MeshError, MeshLimits, ReadOptions, Topology, Triangulator};

/// The polygons of one OBJ or PLY file, or of one object or group of an OBJ file.
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
    /// Parses an OBJ file: all its faces, or those of the object (`o`) or group (`g`) called `name`.
    ///
    /// With a name, only the vertices that its faces use remain, in the order of the file. Texture coordinates, normals,
    /// lines and points are skipped. Only the names of materials are read. Free-form surfaces are an error.
    ///
    /// A file that begins with `ply` is read as PLY, as text or binary; its objects have no names.
    ///
    /// # Errors
    /// [`MeshError::Line`] names the line and its error; [`MeshError::NoSuchMesh`] lists the existing names.
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
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            if let Some(wanted) = name {
                return Err(MeshError::NoSuchMesh { wanted: wanted.to_owned(), available: Vec::new() });
            }
            return ply::parse(bytes, limits)?.checked();
        }
        let mut parser = Parser {
            mesh: Self::empty(),
            wanted: name,
            names: Vec::new(),
            selected: name.is_none(),
            object_selected: false,
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

    /// A mesh without vertices.
    pub(super) fn empty() -> Self {
        Self { starts: vec![0], ..Self::default() }
    }

    /// Adds a polygon of a material.
    pub(super) fn push_face(&mut self, corners: &[u32], material: &str) {
        self.corners.extend(corners);
        self.starts.push(self.corners.len());
        self.materials.push(material);
    }

    /// The mesh, if all vertices that its faces name exist.
    fn checked(self) -> Result<Self, MeshError> {
        let vertices = self.positions.len();
        for face in 0..self.face_count() {
            // Vertices may follow the faces that use them.
            if let Some(&c) = self.face(face).iter().find(|&&c| c as usize >= vertices) {
                return Err(MeshError::FaceIndex { face, vertex: i64::from(c), vertices });
            }
        }
        Ok(self)
    }

    /// Number of polygons.
    #[must_use]
    pub fn face_count(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Corners of one polygon; empty for a face that does not exist.
    #[must_use]
    pub fn face(&self, index: usize) -> &[u32] {
        match (self.starts.get(index), self.starts.get(index + 1)) {
            (Some(&a), Some(&b)) => &self.corners[a..b],
            _ => &[],
        }
    }

    /// The triangles with the rest pose in metres, and the number of dropped faces.
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
            rest.push(to_metres(p, options.metres_per_unit, 0, v)?);
        }
        Ok((Topology { rest, triangles: faces.triangles }, faces.dropped))
    }

    /// A clip with the faces, rest pose and materials of this mesh.
    pub(super) fn clip(&self, times: Vec<f64>, options: &ReadOptions) -> Result<MeshClip, MeshError> {
        let (topology, dropped) = self.topology(options)?;
        Ok(MeshClip::new(topology, times, dropped)?.with_materials(self.triangle_materials()?))
    }

    /// The material of each triangle of [`ObjMesh::topology`].
    fn triangle_materials(&self) -> Result<Materials, MeshError> {
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

    /// First face that differs from that of `other`.
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
    /// True while faces belong to the wanted object or group.
    selected: bool,
    /// True if the wanted name is that of the current object: its groups are selected too.
    object_selected: bool,
    /// Material of the faces that follow.
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
                        error(format!("`{}` is not a number in `v x y z`", String::from_utf8_lossy(word)))
                    })?;
                }
                self.limits.vertices(self.mesh.positions.len() as u64 + 1)?;
                self.mesh.positions.push(p);
            }
            Some(b"f" | b"fo") if self.selected => self.face(words, line)?,
            Some(b"o") => {
                let found = self.name(bytes, 1);
                self.selected = self.wanted.is_none_or(|w| w == found);
                self.object_selected = self.wanted.is_some() && self.selected;
            }
            Some(b"g") => {
                let found = self.name(bytes, 1);
                // A `g` line may name several groups.
                let named =
                    self.wanted.is_some_and(|w| found == w || found.split_whitespace().any(|g| g == w));
                self.selected = self.wanted.is_none() || self.object_selected || named;
            }
            Some(b"usemtl") => {
                let text = bytes.trim_ascii().get(6..).unwrap_or(&[]);
                self.material = String::from_utf8_lossy(text).trim().to_owned();
            }
            Some(b"cstype" | b"surf" | b"curv" | b"curv2") => {
                return Err(error("free-form curves and surfaces are not supported: export polygons".into()));
            }
            _ => {}
        }
        Ok(())
    }

    fn name(&mut self, bytes: &[u8], skip: usize) -> String {
        /// Maximum number of names in the error message.
        const MAX_NAMES: usize = 256;
        let text = String::from_utf8_lossy(bytes.trim_ascii().get(skip..).unwrap_or(&[])).trim().to_owned();
        if self.wanted.is_some()
            && self.names.len() < MAX_NAMES
            && !text.is_empty()
            && !self.names.contains(&text)
        {
            self.names.push(text.clone());
        }
        text
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>, line: usize) -> Result<(), MeshError> {
        let vertices = self.mesh.positions.len();
        let start = self.mesh.corners.len();
        for word in words {
            // v, v/vt, v//vn and v/vt/vn: the parts after the first slash must be numbers and are not used.
            let mut parts = word.split(|&b| b == b'/');
            let vertex = parts.next().and_then(integer);
            let rest = parts.clone().count() <= 2 && parts.all(|p| p.is_empty() || integer(p).is_some());
            let (Some(vertex), true) = (vertex, rest) else {
                let what = format!(
                    "`{}` is not a corner; write v, v/vt, v//vn or v/vt/vn",
                    String::from_utf8_lossy(word)
                );
                return Err(MeshError::Line { line, what });
            };
            // Negative numbers count back from the last vertex so far.
            let index = if vertex > 0 { vertex - 1 } else { vertices as i64 + vertex };
            if vertex == 0 || index < 0 || index >= i64::from(u32::MAX) {
                let what = format!(
                    "a face names vertex {vertex}, there are {vertices} so far (1 to {vertices}, or -1 to -{vertices})"
                );
                return Err(MeshError::Line { line, what });
            }
            self.mesh.corners.push(index as u32);
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
        let Self { mesh, wanted, names, .. } = self;
        let mut mesh = mesh.checked()?;
        let vertices = mesh.positions.len();
        if let Some(wanted) = wanted {
            if mesh.face_count() == 0 {
                return Err(MeshError::NoSuchMesh { wanted: wanted.to_owned(), available: names });
            }
            let mut used = vec![false; vertices];
            mesh.corners.iter().for_each(|&c| used[c as usize] = true);
            let mut new_index = Vec::with_capacity(vertices);
            let mut next = 0;
            for &u in &used {
                new_index.push(next);
                next += u32::from(u);
            }
            mesh.corners.iter_mut().for_each(|c| *c = new_index[*c as usize]);
            let mut used = used.iter();
            mesh.positions.retain(|_| used.next().copied().unwrap_or(false));
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
mod tests;
