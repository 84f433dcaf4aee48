//! The motion of any object of an archive: the product of the Xforms above it.

use super::archive::{Archive, Property};
use super::xform::Xform;
use super::{MeshError, MeshLimits, ObjectMotion, ReadSeek, check_times, transforms, world_at};

/// Times with a smaller difference are the same frame, s.
const TIME_TOLERANCE: f64 = 1e-9;

/// Reads the motion of an object in the space of the archive (usually Y up): all transforms above it are applied, and its own.
///
/// `object` is a full path, or the end of one if it is the only one with that end, where objects with a transform of their own precede others.
/// `None` reads the only object with an animated transform of its own. The frames are the samples of all animated transforms above the object.
///
/// # Errors
/// [`MeshError::NoSuchObject`] and [`MeshError::AmbiguousObject`] list the objects with transforms; [`MeshError::TransformNotFinite`] names
/// the first frame with an element that is NaN or infinite.
///
/// # Complexity
/// Linear in frames times transforms above the object; 104 bytes a frame.
pub fn object_motion(
    file: Box<dyn ReadSeek>,
    object: Option<&str>,
    limits: &MeshLimits,
) -> Result<ObjectMotion, MeshError> {
    let mut archive = Archive::open(file, *limits)?;
    let object = choose(&mut archive, object)?;
    let mut chain = transforms(&mut archive, object)?;
    let times = sample_times(&archive, &chain, limits)?;
    let path = archive.objects[object].path.clone();
    ObjectMotion::evaluate(path, times, |time| world_at(&mut archive, &mut chain, time))
}

/// The object of a name, or the only one with an animated transform of its own.
fn choose(archive: &mut Archive, wanted: Option<&str>) -> Result<usize, MeshError> {
    let (mut transformed, mut animated) = (Vec::new(), Vec::new());
    for object in 0..archive.objects.len() {
        let Some(xform) = archive.properties(object)?.into_iter().find(|p| p.name == ".xform") else {
            continue;
        };
        transformed.push(object);
        let changes = |p: &Property| [".vals", ".inherits"].contains(&&*p.name) && p.first_change().is_some();
        if archive.sub_properties(&xform)?.iter().any(changes) {
            animated.push(object);
        }
    }
    let Some(wanted) = wanted else {
        return match animated[..] {
            [object] => Ok(object),
            [] => Err(MeshError::AmbiguousObject { animated: 0, available: archive.paths(&transformed) }),
            _ => Err(MeshError::AmbiguousObject {
                animated: animated.len(),
                available: archive.paths(&animated),
            }),
        };
    };
    // Object 0 is the root, which has no name.
    let all: Vec<usize> = (1..archive.objects.len()).collect();
    let found = |among: &[usize]| archive.position(among, wanted).map(|k| among[k]);
    found(&transformed).or_else(|| found(&all)).ok_or_else(|| MeshError::NoSuchObject {
        wanted: wanted.to_owned(),
        available: archive.paths(&transformed),
    })
}

/// Times of the samples of all animated transforms; 0 if none is animated.
fn sample_times(archive: &Archive, chain: &[Xform], limits: &MeshLimits) -> Result<Vec<f64>, MeshError> {
    let mut times = Vec::new();
    for property in chain.iter().filter_map(Xform::animated) {
        let own: Vec<f64> =
            (0..property.samples).map(|k| archive.time(property, k)).collect::<Result<_, _>>()?;
        check_times(&own)?;
        times.extend(own);
        times.sort_unstable_by(f64::total_cmp);
        times.dedup_by(|later, earlier| *later - *earlier <= TIME_TOLERANCE);
        limits.frames(times.len() as u64)?;
    }
    Ok(if times.is_empty() { vec![0.0] } else { times })
}
