//! Point caches: PC2 and MDD hold the positions of each frame, an OBJ holds the faces.

use super::bytes::{Source, array, f32_le, u32_le};
use super::clip::{check_request, check_times, to_metres};
use super::{FrameReader, MeshError, MeshStream, ObjMesh, ReadOptions, ReadSeek};

/// Opens a PC2 file (POINTCACHE2, little endian) over the faces of `base`.
///
/// Frame i is at `(start + i * rate) / fps` seconds with the start and rate of the file.
///
/// # Errors
/// Another format, a truncated file, another number of vertices than `base`, an invalid start or rate.
pub fn open_pc2(
    file: Box<dyn ReadSeek>,
    base: &ObjMesh,
    fps: f64,
    options: &ReadOptions,
) -> Result<MeshStream, MeshError> {
    if !fps.is_finite() || fps <= 0.0 {
        return Err(MeshError::Parameter { name: "fps", value: fps, expected: "finite and positive" });
    }
    let mut source = Source::new(file, "PC2")?;
    let mut head = [0; 32];
    let n = source.length().min(32) as usize;
    source.read_at(0, &mut head[..n], || "the header".into())?;
    if !head.starts_with(b"POINTCACHE2\0") {
        let found = format!(
            "it starts with {:?}, not with \"POINTCACHE2\"",
            String::from_utf8_lossy(&head[..n.min(12)])
        );
        return Err(MeshError::Format { expected: "a PC2 file", found });
    }
    source.read_at(0, &mut head, || "the header".into())?;
    if u32_le(&head[12..]) != 1 {
        return Err(malformed("PC2", format!("version {}, it must be 1", u32_le(&head[12..]))));
    }
    let (points, frames) = (u32_le(&head[16..]), u32_le(&head[28..]));
    let (start, rate) = (f64::from(f32_le(&head[20..])), f64::from(f32_le(&head[24..])));
    if !start.is_finite() || !rate.is_finite() || rate <= 0.0 {
        let what =
            format!("start frame {start} and sample rate {rate}, both must be finite and the rate positive");
        return Err(malformed("PC2", what));
    }
    check_header(&source, "PC2", points, frames, 32, base, options)?;
    let times = (0..frames).map(|i| (start + f64::from(i) * rate) / fps).collect();
    finish(source, times, 32, f32::from_le_bytes, base, options)
}

/// Opens an MDD file (LightWave, big endian, with its own times) over the faces of `base`.
///
/// # Errors
/// A truncated file, another number of vertices than `base`, times that do not increase.
pub fn open_mdd(
    file: Box<dyn ReadSeek>,
    base: &ObjMesh,
    options: &ReadOptions,
) -> Result<MeshStream, MeshError> {
    let mut source = Source::new(file, "MDD")?;
    let mut head = [0; 8];
    source.read_at(0, &mut head, || "the header".into())?;
    let (frames, points) = (u32::from_be_bytes(array(&head)), u32::from_be_bytes(array(&head[4..])));
    // MDD has no magic number: another format or byte order shows in impossible counts.
    let data = 8 + 4 * u64::from(frames);
    check_header(&source, "MDD", points, frames, data, base, options)?;
    let mut table = vec![0; 4 * frames as usize];
    source.read_at(8, &mut table, || "the table of times".into())?;
    let times = table.as_chunks().0.iter().map(|b| f64::from(f32::from_be_bytes(*b))).collect();
    finish(source, times, data, f32::from_be_bytes, base, options)
}

fn malformed(format: &'static str, what: String) -> MeshError {
    MeshError::Malformed { format, what }
}

fn check_header(
    source: &Source,
    format: &'static str,
    points: u32,
    frames: u32,
    data: u64,
    base: &ObjMesh,
    options: &ReadOptions,
) -> Result<(), MeshError> {
    let options = options.checked()?;
    let frame = 12 * u64::from(points);
    let needed = u128::from(data) + u128::from(frame) * u128::from(frames);
    if u128::from(source.length()) < needed {
        let complete = source.length().saturating_sub(data) / frame.max(1);
        return Err(MeshError::Truncated {
            format,
            what: format!(
                "the header's {frames} frames of {points} vertices ({complete} complete frames are present)"
            ),
            needed: u64::try_from(needed).unwrap_or(u64::MAX),
            available: source.length(),
        });
    }
    if points == 0 || frames == 0 {
        return Err(MeshError::Empty {
            mesh: format.to_owned(),
            vertices: points as usize,
            faces: base.face_count(),
            frames: frames as usize,
        });
    }
    options.limits.vertices(u64::from(points))?;
    options.limits.frames(u64::from(frames))?;
    let expected = base.positions.len() as u64;
    if u64::from(points) != expected {
        return Err(MeshError::VertexCount { frame: 0, found: u64::from(points), expected });
    }
    Ok(())
}

fn finish(
    source: Source,
    times: Vec<f64>,
    data: u64,
    decode: impl Fn([u8; 4]) -> f32 + Send + 'static,
    base: &ObjMesh,
    options: &ReadOptions,
) -> Result<MeshStream, MeshError> {
    check_times(&times)?;
    let frames = times.len();
    let clip = base.clip(times, options)?;
    let bytes = vec![0; 12 * clip.vertex_count()];
    let scale = options.metres_per_unit;
    Ok(MeshStream { clip, frames: Box::new(Cache { source, data, decode, frames, bytes, scale }) })
}

/// A cache whose numbers `D` decodes: a type of its own for each format, so that the loop over them has no call.
struct Cache<D> {
    source: Source,
    /// Byte offset of the first frame.
    data: u64,
    decode: D,
    frames: usize,
    bytes: Vec<u8>,
    scale: f64,
}

impl<D: Fn([u8; 4]) -> f32 + Send> FrameReader for Cache<D> {
    fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
        check_request(index, self.frames, out.len(), self.bytes.len() / 12)?;
        let offset = self.data + (index * self.bytes.len()) as u64;
        self.source.read_at(offset, &mut self.bytes, || format!("frame {index}"))?;
        let numbers = self.bytes.as_chunks::<4>().0.as_chunks::<3>().0;
        for (v, (q, numbers)) in out.iter_mut().zip(numbers).enumerate() {
            let p = numbers.map(|b| f64::from((self.decode)(b)));
            *q = to_metres(p, self.scale, index, v)?;
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::mesh::MeshLimits;
    use std::io::Cursor;

    pub(in crate::mesh) fn base() -> ObjMesh {
        ObjMesh::parse(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", None, &MeshLimits::default()).unwrap()
    }

    pub(in crate::mesh) fn pc2(frames: u32) -> Vec<u8> {
        let mut b = b"POINTCACHE2\0".to_vec();
        b.extend(1u32.to_le_bytes());
        b.extend(3u32.to_le_bytes());
        b.extend(2f32.to_le_bytes());
        b.extend(0.5f32.to_le_bytes());
        b.extend(frames.to_le_bytes());
        (0..frames * 9).for_each(|k| b.extend((k as f32).to_le_bytes()));
        b
    }

    pub(in crate::mesh) fn mdd(times: &[f32]) -> Vec<u8> {
        let mut b = (times.len() as u32).to_be_bytes().to_vec();
        b.extend(3u32.to_be_bytes());
        times.iter().for_each(|t| b.extend(t.to_be_bytes()));
        (0..times.len() * 9).for_each(|k| b.extend((k as f32).to_be_bytes()));
        b
    }

    fn open(bytes: Vec<u8>) -> Result<MeshStream, MeshError> {
        open_pc2(Box::new(Cursor::new(bytes)), &base(), 10.0, &ReadOptions::default())
    }

    #[test]
    fn pc2_frames_have_their_times_and_positions() {
        let mut s = open(pc2(4)).unwrap();
        assert_eq!(s.clip.times(), [0.2, 0.25, 0.3, 0.35]);
        let mut out = [[0.0; 3]; 3];
        s.frames.read_frame(2, &mut out).unwrap();
        assert_eq!(out[1], [21.0, 22.0, 23.0]);
    }

    #[test]
    fn mdd_frames_have_the_times_of_the_file() {
        let bytes = mdd(&[0.0, 0.5, 0.625]);
        let options = ReadOptions { metres_per_unit: 0.5, ..ReadOptions::default() };
        let mut s = open_mdd(Box::new(Cursor::new(bytes)), &base(), &options).unwrap();
        assert_eq!(s.clip.times(), [0.0, 0.5, 0.625]);
        let mut out = [[0.0; 3]; 3];
        s.frames.read_frame(1, &mut out).unwrap();
        assert_eq!(out[0], [4.5, 5.0, 5.5]);
    }

    #[test]
    fn invalid_caches_are_rejected_with_the_reason() {
        let mut cut = pc2(4);
        cut.truncate(32 + 36 * 3 + 5);
        let error = open(cut).unwrap_err().to_string();
        assert!(error.contains("3 complete frames are present"), "{error}");
        let mut other = pc2(4);
        other[16] = 2;
        assert!(matches!(open(other), Err(MeshError::VertexCount { found: 2, expected: 3, .. })));
        assert!(matches!(open(b"POINTCACHE1".to_vec()), Err(MeshError::Format { .. })));
        assert!(matches!(open(pc2(0)), Err(MeshError::Empty { frames: 0, .. })));
        let repeated_time =
            open_mdd(Box::new(Cursor::new(mdd(&[0.0, 0.0]))), &base(), &ReadOptions::default());
        assert!(matches!(repeated_time, Err(MeshError::Times { frame: 1, .. })));
        let empty = open_mdd(Box::new(Cursor::new(Vec::new())), &base(), &ReadOptions::default());
        assert!(matches!(empty, Err(MeshError::Truncated { .. })));
    }

    #[test]
    fn a_nan_names_its_frame_and_vertex() {
        let mut bytes = pc2(2);
        let at = 32 + 36 + 12 + 4;
        bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        let mut s = open(bytes).unwrap();
        let error = s.frames.read_frame(1, &mut [[0.0; 3]; 3]).unwrap_err();
        assert!(matches!(error, MeshError::NotFinite { frame: 1, vertex: 1, .. }));
    }
}
