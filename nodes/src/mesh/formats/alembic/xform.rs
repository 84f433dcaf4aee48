//! The Xform schema: a list of operations whose values change with time.

use super::super::MeshError;
use super::super::affine::Affine;
use super::archive::{Archive, Property, Samples};
use super::ogawa::malformed;

/// Number of values that an operation takes.
fn channels(op: u8) -> Option<usize> {
    match op >> 4 {
        0 | 1 => Some(3),
        2 => Some(4),
        3 => Some(16),
        4..=6 => Some(1),
        _ => None,
    }
}

/// Transform of one operation with angles in degrees.
fn operation(op: u8, v: &[f64]) -> Affine {
    let axis = |a| Affine::axis_angle(a, v[0].to_radians());
    match op >> 4 {
        0 => Affine::scale([v[0], v[1], v[2]]),
        1 => Affine::translation([v[0], v[1], v[2]]),
        2 => Affine::axis_angle([v[0], v[1], v[2]], v[3].to_radians()),
        // Alembic multiplies row vectors, so its matrices are transposed.
        3 => Affine(std::array::from_fn(|r| std::array::from_fn(|c| v[4 * c + r]))),
        4 => axis([1.0, 0.0, 0.0]),
        5 => axis([0.0, 1.0, 0.0]),
        _ => axis([0.0, 0.0, 1.0]),
    }
}

pub(super) struct Xform {
    ops: Vec<u8>,
    values: Option<Samples>,
    inherits: Option<Samples>,
    scratch: Vec<u8>,
    before: Vec<f64>,
    after: Vec<f64>,
}

/// The sample at or before `time`, the next one, and the fraction of the interval between them.
fn bracket(archive: &Archive, property: &Property, time: f64) -> Result<(usize, usize, f64), MeshError> {
    let (mut low, mut high) = (0, property.samples - 1);
    while low < high {
        let middle = (low + high).div_ceil(2);
        if archive.time(property, middle)? <= time + 1e-9 { low = middle } else { high = middle - 1 }
    }
    let (t, next) = (archive.time(property, low)?, (low + 1).min(property.samples - 1));
    let step = archive.time(property, next)? - t;
    let fraction = if step > 0.0 { ((time - t) / step).clamp(0.0, 1.0) } else { 0.0 };
    // Within 1 ns of a sample that sample applies without interpolation.
    Ok((low, next, if (time - t).abs() <= 1e-9 { 0.0 } else { fraction }))
}

impl Xform {
    /// Reads the operations of the `.xform` compound of an object.
    pub(super) fn open(archive: &mut Archive, compound: &Property, path: &str) -> Result<Self, MeshError> {
        let properties = archive.sub_properties(compound)?;
        let mut find = |name: &str| match properties.iter().find(|p| p.name == name && p.samples > 0) {
            Some(p) => archive.samples(p).map(Some),
            None => Ok(None),
        };
        let (ops, values, inherits) = (find(".ops")?, find(".vals")?, find(".inherits")?);
        let mut xform = Self {
            ops: Vec::new(),
            values,
            inherits,
            scratch: Vec::new(),
            before: Vec::new(),
            after: Vec::new(),
        };
        if let Some(ops) = ops {
            let codes = &mut xform.ops;
            archive.read(&ops, 0, &mut xform.scratch, |x| {
                codes.push(x as u8);
                Ok(())
            })?;
        }
        let mut needed = 0;
        for &op in &xform.ops {
            needed += channels(op).ok_or_else(|| {
                malformed(format!("operation {op:#04x} in the transform of `{path}`, known are 0x00 to 0x6f"))
            })?;
        }
        if let Some(values) = &xform.values {
            xform.before.reserve(needed);
            for index in [0, values.property.samples - 1] {
                let items = archive.count(values, index)?;
                let found = items.saturating_mul(values.property.extent.max(1) as u64);
                if found != needed as u64 {
                    return Err(malformed(format!(
                        "the transform of `{path}` has {found} values, its operations take {needed}"
                    )));
                }
            }
        } else if needed > 0 {
            return Err(malformed(format!("the transform of `{path}` has operations and no `.vals`")));
        }
        Ok(xform)
    }

    /// The property with the times of the transform, if it is animated.
    pub(super) fn animated(&self) -> Option<&Property> {
        [&self.values, &self.inherits]
            .into_iter()
            .flatten()
            .map(|s| &s.property)
            .find(|p| p.first_change().is_some())
    }

    /// The transform at a time, and true if it inherits the transforms of its parents.
    ///
    /// The values of operations are interpolated linearly between samples: rotations by angle, matrices by element.
    pub(super) fn evaluate(&mut self, archive: &mut Archive, time: f64) -> Result<(Affine, bool), MeshError> {
        let mut matrix = Affine::IDENTITY;
        if let Some(values) = &self.values {
            let (a, b, fraction) = bracket(archive, &values.property, time)?;
            read_into(archive, values, a, &mut self.scratch, &mut self.before)?;
            if fraction > 0.0 {
                read_into(archive, values, b, &mut self.scratch, &mut self.after)?;
                self.before.iter_mut().zip(&self.after).for_each(|(x, y)| *x += (y - *x) * fraction);
            }
            let mut rest = &self.before[..];
            for &op in &self.ops {
                let n = channels(op).unwrap_or(0);
                if rest.len() < n {
                    return Err(malformed(format!(
                        "a transform has {} values at {time} s, too few",
                        self.before.len()
                    )));
                }
                let (operands, tail) = rest.split_at(n);
                matrix = matrix.product(&operation(op, operands));
                rest = tail;
            }
        }
        let mut inherits = true;
        if let Some(samples) = &self.inherits {
            let (index, _, _) = bracket(archive, &samples.property, time)?;
            archive.read(samples, index, &mut self.scratch, |x| {
                inherits = x != 0.0;
                Ok(())
            })?;
        }
        Ok((matrix, inherits))
    }
}

fn read_into(
    archive: &mut Archive,
    samples: &Samples,
    index: usize,
    scratch: &mut Vec<u8>,
    out: &mut Vec<f64>,
) -> Result<(), MeshError> {
    /// Limit on the memory that a file can request with a long list of values.
    const MAX_VALUES: usize = 4096;
    out.clear();
    archive.read(samples, index, scratch, |x| {
        if out.len() >= MAX_VALUES {
            return Err(malformed(format!("a transform has more than {MAX_VALUES} values")));
        }
        out.push(x);
        Ok(())
    })
}
