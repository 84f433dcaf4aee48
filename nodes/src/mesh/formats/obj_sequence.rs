//! Sequences of OBJ files, one per frame.

use super::clip::{check_request, check_times, to_metres};
use super::{FrameReader, MeshError, MeshStream, ObjMesh, ReadOptions};

/// Function that returns the bytes of the OBJ file of a frame.
pub type OpenFrame = Box<dyn FnMut(usize) -> std::io::Result<Vec<u8>> + Send>;

/// Opens a sequence of OBJ files with the same faces and a frame at each of `times` (seconds).
///
/// Opening reads only the first file. Each frame reads its own file.
///
/// # Errors
/// [`MeshError::Frame`] names the frame whose file is missing or wrong, [`MeshError::TopologyChanged`] the first frame
/// and face that differ.
pub fn open_obj_sequence(
    mut open: OpenFrame,
    times: Vec<f64>,
    name: Option<&str>,
    options: &ReadOptions,
) -> Result<MeshStream, MeshError> {
    let options = *options.checked()?;
    options.limits.frames(times.len() as u64)?;
    check_times(&times)?;
    if times.is_empty() {
        return Err(MeshError::Empty { mesh: "OBJ sequence".into(), vertices: 0, faces: 0, frames: 0 });
    }
    let name = name.map(str::to_owned);
    let base = load(&mut open, 0, name.as_deref(), &options)?;
    let frames = times.len();
    let clip = base.clip(times, &options)?;
    Ok(MeshStream { clip, frames: Box::new(Sequence { open, name, base, frames, options }) })
}

fn load(
    open: &mut OpenFrame,
    frame: usize,
    name: Option<&str>,
    options: &ReadOptions,
) -> Result<ObjMesh, MeshError> {
    let in_frame = |source| MeshError::Frame { frame, source: Box::new(source) };
    let bytes = open(frame).map_err(|source| in_frame(MeshError::Io { format: "OBJ", source }))?;
    ObjMesh::parse(&bytes, name, &options.limits).map_err(in_frame)
}

struct Sequence {
    open: OpenFrame,
    name: Option<String>,
    base: ObjMesh,
    frames: usize,
    options: ReadOptions,
}

impl FrameReader for Sequence {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        check_request(index, self.frames, out.len(), self.base.positions.len())?;
        let mesh = load(&mut self.open, index, self.name.as_deref(), &self.options)?;
        if mesh.positions.len() != out.len() {
            let (found, expected) = (mesh.positions.len() as u64, out.len() as u64);
            return Err(MeshError::VertexCount { frame: index, found, expected });
        }
        if let Some(face) = self.base.first_different_face(&mesh) {
            let what =
                format!("face {face} is {:?}, in frame 0 it is {:?}", mesh.face(face), self.base.face(face));
            return Err(MeshError::TopologyChanged { frame: index, what });
        }
        for (v, (q, &p)) in out.iter_mut().zip(&mesh.positions).enumerate() {
            *q = to_metres(p, self.options.metres_per_unit, index, v)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(files: &'static [&'static str]) -> Result<MeshStream, MeshError> {
        let open: OpenFrame = Box::new(move |k| {
            files.get(k).map(|f| f.as_bytes().to_vec()).ok_or_else(|| std::io::ErrorKind::NotFound.into())
        });
        open_obj_sequence(open, vec![0.0, 0.04, 0.08, 0.12], None, &ReadOptions::default())
    }

    #[test]
    fn frames_are_read_and_errors_name_the_frame() {
        let mut s = sequence(&[
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "v 0 0 1\nv 1 0 1\nv 0 1 1\nf -3 -2 -1\n",
            "v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 3 2\n",
        ])
        .unwrap();
        let mut out = [[0.0; 3]; 3];
        s.frames.read_frame(1, &mut out).unwrap();
        assert_eq!(out, [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]);
        assert!(matches!(s.frames.read_frame(2, &mut out), Err(MeshError::TopologyChanged { frame: 2, .. })));
        assert!(matches!(s.frames.read_frame(3, &mut out), Err(MeshError::Frame { frame: 3, .. })));
        assert!(matches!(s.frames.read_frame(4, &mut out), Err(MeshError::NoSuchFrame { frames: 4, .. })));
        assert!(matches!(s.frames.read_frame(0, &mut out[..2]), Err(MeshError::OutputLength { .. })));
    }
}
