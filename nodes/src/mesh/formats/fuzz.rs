//! A fixed-seed fuzzer: reading a damaged file returns a stream or an error, never panics and terminates soon.

use std::io::Cursor;

use super::*;

/// SplitMix64.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

fn damage(valid: &[u8], random: &mut SplitMix) -> Vec<u8> {
    let mut bytes = valid.to_vec();
    // Half of the files retain their lengths, so that the damage reaches the contents and not only the container.
    let (edits, first, kinds) = if random.below(2) == 0 { (0, 1, 2) } else { (random.below(4), 0, 7) };
    for _ in 0..=edits {
        if bytes.is_empty() {
            break;
        }
        let index = random.below(bytes.len());
        match first + random.below(kinds) {
            0 => bytes.truncate(index),
            1 => bytes[index] ^= 1 << random.below(8),
            2 => bytes[index] = [0, 1, 0x7f, 0x80, 0xff, b'-', b'9'][random.below(7)],
            3 => {
                let end = bytes.len().min(index + 4);
                bytes[index..end].fill(if random.below(2) == 0 { 0xff } else { 0 });
            }
            4 => {
                let end = bytes.len().min(index + 1 + random.below(16));
                let part = bytes[index..end].to_vec();
                let target = random.below(bytes.len());
                bytes.splice(target..target, part);
            }
            5 => {
                let end = bytes.len().min(index + 1 + random.below(16));
                bytes.drain(index..end);
            }
            // Eight bytes from another position in the file.
            _ => {
                let from = random.below(bytes.len());
                for k in 0..8 {
                    if index + k < bytes.len() && from + k < bytes.len() {
                        bytes[index + k] = bytes[from + k];
                    }
                }
            }
        }
    }
    bytes
}

fn options() -> ReadOptions {
    let limits =
        MeshLimits { max_vertices: 10_000, max_faces: 10_000, max_frames: 10_000, max_bytes: 1 << 20 };
    ReadOptions { metres_per_unit: 1.0, limits }
}

/// Reads the first and last frames of the damaged files that open; returns the number of files that open.
fn read_damaged(valid: &[u8], rounds: u64, open: impl Fn(Vec<u8>) -> Result<MeshStream, MeshError>) -> usize {
    assert!(open(valid.to_vec()).is_ok());
    let mut opened = 0;
    for round in 0..rounds {
        let bytes = damage(valid, &mut SplitMix(round));
        match open(bytes) {
            Ok(mut stream) => {
                opened += 1;
                let mut out = vec![[0.0; 3]; stream.clip.vertex_count()];
                for k in [0, 1, stream.clip.frame_count() - 1] {
                    let read = stream.frames.read_frame(k, &mut out);
                    assert!(read.is_err() || out.iter().flatten().all(|x| x.is_finite()));
                }
                let t = stream.clip.topology();
                assert!(t.triangles.iter().flatten().all(|&v| (v as usize) < t.rest.len()));
                assert!(t.rest.iter().flatten().all(|x| x.is_finite()));
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    opened
}

/// Reads the motion of an object of damaged files; returns the number of files that are read.
fn read_damaged_motions(valid: &[u8], read: impl Fn(Vec<u8>) -> Result<ObjectMotion, MeshError>) -> usize {
    assert!(read(valid.to_vec()).is_ok());
    let mut accepted = 0;
    for round in 0..4000 {
        match read(damage(valid, &mut SplitMix(round))) {
            Ok(motion) => {
                accepted += 1;
                assert!(!motion.times().is_empty() && clip::check_times(motion.times()).is_ok());
                for frame in 0..motion.times().len() {
                    assert!(motion.position(frame, [0.0; 3]).unwrap().iter().all(|x| x.is_finite()));
                }
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    accepted
}

#[test]
fn motions_of_damaged_scenes_are_read_or_rejected() {
    let limits = options().limits;
    for object in [None, Some("sheetShape")] {
        let read = |b| alembic::object_motion(Box::new(Cursor::new(b)), object, &limits);
        assert!(read_damaged_motions(&alembic::tests::sheet(), read) > 100);
    }
    for (valid, object) in [(gltf::tests::moving(), None), (gltf::tests::skinned(), Some("b"))] {
        let selection =
            gltf::GltfSelection { object: object.map(str::to_owned), ..gltf::GltfSelection::default() };
        let read = |b: Vec<u8>| gltf::object_motion(&b, &selection, &mut |_| Ok(vec![0; 64]), &limits);
        assert!(read_damaged_motions(&valid, read) > 100);
    }
}

#[test]
fn damaged_alembic_files_are_read_or_rejected() {
    let open = |b| alembic::open(Box::new(Cursor::new(b)), Some("/scene/sheet/sheetShape"), &options());
    let opened = read_damaged(&alembic::tests::sheet(), 4000, open);
    assert!(opened > 100, "some damaged files must remain readable: {opened}");
}

#[test]
fn damaged_point_caches_are_read_or_rejected() {
    let base = point_cache::tests::base();
    let pc2 = read_damaged(&point_cache::tests::pc2(5), 4000, |b| {
        open_pc2(Box::new(Cursor::new(b)), &base, 24.0, &options())
    });
    let mdd = read_damaged(&point_cache::tests::mdd(&[0.0, 0.5, 1.0]), 4000, |b| {
        open_mdd(Box::new(Cursor::new(b)), &base, &options())
    });
    assert!(pc2 > 100 && mdd > 100);
}

#[test]
fn damaged_obj_files_are_read_or_rejected() {
    let valid = b"# square\no sheet\nv 0 0 0\nv 1 0 0\nv 1 1 0 1.0\nv 0 1e0 0\nvt 0 0\nf 1/1 2/1 3/1 \\\n4/1\nf -4 -3//1 -2\n";
    let opened = read_damaged(valid, 6000, |b| {
        open_obj_sequence(Box::new(move |_| Ok(b.clone())), vec![0.0, 1.0], None, &options())
    });
    assert!(opened > 100);
}

#[test]
fn damaged_gltf_files_are_read_or_rejected() {
    for valid in [gltf::tests::moving(), gltf::tests::skinned()] {
        let opened = read_damaged(&valid, 4000, |b| {
            gltf::open(&b, &gltf::GltfSelection::default(), &mut |_| Ok(vec![0; 64]), &options())
        });
        assert!(opened > 100);
    }
}
