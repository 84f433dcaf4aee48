//! Contents of an Alembic archive: objects with properties, properties with samples, times of samples.
//!
//! # Source
//! The layout that the Alembic library writes (AbcCoreOgawa): children 2, 4 and 5 of the root are the top object, the
//! time samplings and the table of metadata; an object is its properties, its child objects and their headers.

use super::super::bytes::{f32_le, f64_le, u32_le, u64_le};
use super::super::{MeshError, MeshLimits, ReadSeek};
use super::ogawa::{Child, Ogawa, malformed};

/// Maximum number of objects of an archive.
const MAX_OBJECTS: usize = 1 << 16;
/// Maximum depth of an object.
const MAX_DEPTH: usize = 64;

const FLOAT32: u8 = 10;
const FLOAT64: u8 = 11;

/// Times of the samples of a property.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TimeSampling {
    period: f64,
    times: Vec<f64>,
}

impl TimeSampling {
    fn is_acyclic(&self) -> bool {
        self.period >= f64::MAX / 32.0
    }

    /// Time of a sample in seconds; `None` after the end of a list of times.
    pub(super) fn time(&self, sample: usize) -> Option<f64> {
        if self.is_acyclic() {
            return self.times.get(sample).copied();
        }
        let n = self.times.len().max(1);
        let start = self.times.get(sample % n).copied().unwrap_or(0.0);
        Some(start + (sample / n) as f64 * self.period)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    kind: u8,
    pod: u8,
    pub(super) extent: usize,
    pub(super) samples: usize,
    first_changed: usize,
    last_changed: usize,
    sampling: usize,
    child: Child,
}

impl Property {
    fn is_compound(&self) -> bool {
        self.kind == 0
    }

    fn is_array(&self) -> bool {
        self.kind >= 2
    }

    /// Index of the stored sample for sample `index`: repeated samples at both ends are stored once.
    fn stored(&self, index: usize) -> usize {
        if index < self.first_changed || (self.first_changed == 0 && self.last_changed == 0) {
            0
        } else {
            (index.min(self.last_changed) + 1).saturating_sub(self.first_changed)
        }
    }

    /// First sample that differs from sample 0.
    pub(super) fn first_change(&self) -> Option<usize> {
        (self.samples > 1 && self.last_changed >= self.first_changed && self.last_changed > 0)
            .then_some(self.first_changed)
    }

    fn component_size(&self) -> Option<u64> {
        match self.pod {
            0..=2 => Some(1),
            3 | 4 | 9 => Some(2),
            5 | 6 | 10 => Some(4),
            7 | 8 | 11 => Some(8),
            _ => None,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Object {
    pub(super) path: String,
    pub(super) parent: Option<usize>,
    properties: Option<Child>,
}

pub(super) struct Archive {
    ogawa: Ogawa,
    pub(super) samplings: Vec<TimeSampling>,
    pub(super) objects: Vec<Object>,
    limits: MeshLimits,
}

/// A cursor over a table.
struct Table<'a> {
    bytes: &'a [u8],
    what: &'static str,
}

impl<'a> Table<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], MeshError> {
        if n > self.bytes.len() {
            return Err(malformed(format!(
                "the table of {} ends {} bytes early",
                self.what,
                n - self.bytes.len()
            )));
        }
        let (head, rest) = self.bytes.split_at(n);
        self.bytes = rest;
        Ok(head)
    }

    fn u32(&mut self) -> Result<u32, MeshError> {
        Ok(u32_le(self.take(4)?))
    }

    /// An integer of one, two or four bytes.
    fn sized(&mut self, hint: u32) -> Result<usize, MeshError> {
        Ok(match hint {
            0 => usize::from(self.take(1)?[0]),
            1 => u32_le(self.take(2)?) as usize,
            2 => self.u32()? as usize,
            _ => {
                return Err(malformed(format!(
                    "size hint {hint} in the table of {}; it must be 0, 1 or 2",
                    self.what
                )));
            }
        })
    }

    fn name(&mut self, n: usize) -> Result<String, MeshError> {
        Ok(String::from_utf8_lossy(self.take(n)?).into_owned())
    }
}

impl Archive {
    pub(super) fn open(file: Box<dyn ReadSeek>, limits: MeshLimits) -> Result<Self, MeshError> {
        let (mut ogawa, root) = Ogawa::open(file, limits.max_bytes)?;
        if root.len() < 6 {
            return Err(malformed(format!("the root has {} children, an archive has 6", root.len())));
        }
        let times = ogawa.data(root[4])?;
        let samplings = time_samplings(&times)?;
        let mut archive = Self { ogawa, samplings, objects: Vec::new(), limits };
        archive.read_objects(root[2])?;
        Ok(archive)
    }

    fn read_objects(&mut self, top: Child) -> Result<(), MeshError> {
        let mut pending = vec![(top, String::new(), None, 0usize)];
        while let Some((child, path, parent, depth)) = pending.pop() {
            if depth > MAX_DEPTH || self.objects.len() >= MAX_OBJECTS {
                return Err(malformed(format!("more than {MAX_DEPTH} levels or {MAX_OBJECTS} objects")));
            }
            let group = self.ogawa.group(child)?;
            let index = self.objects.len();
            let properties = group.first().copied().filter(|c| !c.is_data());
            self.objects.push(Object { path: path.clone(), parent, properties });
            let Some((&headers, children)) = group.split_last().filter(|(last, _)| last.is_data()) else {
                continue;
            };
            let bytes = self.ogawa.data(headers)?;
            // The last 32 bytes are hashes of the children.
            let mut table = Table { bytes: &bytes[..bytes.len().saturating_sub(32)], what: "objects" };
            let mut found = Vec::new();
            for k in 1.. {
                if table.bytes.is_empty() {
                    break;
                }
                let length = table.u32()? as usize;
                let name = table.name(length)?;
                if table.take(1)?[0] == 0xff {
                    let metadata = table.u32()? as usize;
                    table.take(metadata)?;
                }
                let Some(&child) = children.get(k) else {
                    return Err(malformed(format!("object `{path}/{name}` has a header and no group")));
                };
                found.push((child, format!("{path}/{name}"), Some(index), depth + 1));
            }
            if found.len() + pending.len() > MAX_OBJECTS {
                return Err(malformed(format!("more than {MAX_OBJECTS} objects")));
            }
            pending.extend(found.into_iter().rev());
        }
        Ok(())
    }

    /// Position in `among` of the object with the path `wanted`, or else of the only one whose path ends in `/wanted`.
    pub(super) fn position(&self, among: &[usize], wanted: &str) -> Option<usize> {
        let exact = among.iter().position(|&object| self.objects[object].path == wanted);
        exact.or_else(|| {
            let ends = |path: &str| path.strip_suffix(wanted).is_some_and(|rest| rest.ends_with('/'));
            let mut found = (0..among.len()).filter(|&k| ends(&self.objects[among[k]].path));
            found.next().filter(|_| found.next().is_none())
        })
    }

    /// Paths of objects.
    pub(super) fn paths(&self, objects: &[usize]) -> Vec<String> {
        objects.iter().map(|&object| self.objects[object].path.clone()).collect()
    }

    /// Properties of an object.
    pub(super) fn properties(&mut self, object: usize) -> Result<Vec<Property>, MeshError> {
        match self.objects[object].properties {
            Some(child) => self.compound(child),
            None => Ok(Vec::new()),
        }
    }

    /// Properties of a compound property.
    pub(super) fn sub_properties(&mut self, property: &Property) -> Result<Vec<Property>, MeshError> {
        if property.is_compound() { self.compound(property.child) } else { Ok(Vec::new()) }
    }

    fn compound(&mut self, child: Child) -> Result<Vec<Property>, MeshError> {
        let group = self.ogawa.group(child)?;
        let Some((&headers, children)) = group.split_last().filter(|(last, _)| last.is_data()) else {
            return Ok(Vec::new());
        };
        let bytes = self.ogawa.data(headers)?;
        let mut table = Table { bytes: &bytes, what: "properties" };
        let mut out = Vec::new();
        while !table.bytes.is_empty() {
            let Some(&child) = children.get(out.len()) else {
                return Err(malformed(format!("property {} has a header and no group", out.len())));
            };
            out.push(property_header(&mut table, child, self.samplings.len())?);
        }
        Ok(out)
    }

    /// Stored samples of a property as children of its group.
    pub(super) fn samples(&mut self, property: &Property) -> Result<Samples, MeshError> {
        self.limits.frames(property.samples as u64)?;
        let size = property.component_size().ok_or_else(|| {
            malformed(format!(
                "property `{}` holds type {}, numbers are 0 to 11",
                property.name, property.pod
            ))
        })?;
        let group = self.ogawa.group(property.child)?;
        Ok(Samples { property: property.clone(), size, group })
    }

    /// Number of values (of `extent` components each) in one sample.
    pub(super) fn count(&mut self, samples: &Samples, index: usize) -> Result<u64, MeshError> {
        let (data, dims) = samples.children(index)?;
        let length = self.ogawa.data_length(data)?;
        let item = samples.size * samples.property.extent.max(1) as u64;
        // Samples begin with a key of 16 bytes.
        let payload = length.saturating_sub(16);
        if payload % item != 0 {
            return Err(malformed(format!(
                "sample {index} of `{}` has {payload} bytes, a multiple of {item} is expected",
                samples.property.name
            )));
        }
        if let Some(dims) = dims {
            let shape = self.ogawa.data_length(dims)?;
            if shape >= 8 {
                let mut first = [0; 8];
                self.ogawa.read(dims, 0, &mut first)?;
                if shape > 8 || u64_le(&first) != payload / item {
                    return Err(malformed(format!(
                        "sample {index} of `{}` is not a plain list",
                        samples.property.name
                    )));
                }
            }
        }
        Ok(payload / item)
    }

    /// Calls `each` with the components of one sample in order.
    pub(super) fn read(
        &mut self,
        samples: &Samples,
        index: usize,
        scratch: &mut Vec<u8>,
        mut each: impl FnMut(f64) -> Result<(), MeshError>,
    ) -> Result<(), MeshError> {
        let components = self.count(samples, index)? * samples.property.extent.max(1) as u64;
        let (data, _) = samples.children(index)?;
        let size = samples.size as usize;
        // In blocks, so that a long sample is not copied as a whole.
        const BLOCK: u64 = 1 << 14;
        let mut done = 0;
        while done < components {
            let n = BLOCK.min(components - done) as usize;
            scratch.resize(n * size, 0);
            self.ogawa.read(data, 16 + done * samples.size, scratch)?;
            for item in scratch.chunks_exact(size) {
                each(number(samples.property.pod, item))?;
            }
            done += n as u64;
        }
        Ok(())
    }

    /// Time of a sample of a property.
    pub(super) fn time(&self, property: &Property, index: usize) -> Result<f64, MeshError> {
        self.samplings[property.sampling].time(index).ok_or_else(|| {
            malformed(format!("sample {index} of `{}` has no time in its time sampling", property.name))
        })
    }
}

/// Positions of the stored samples of one property.
pub(super) struct Samples {
    pub(super) property: Property,
    size: u64,
    group: Vec<Child>,
}

impl Samples {
    pub(super) fn is_float(&self) -> bool {
        matches!(self.property.pod, FLOAT32 | FLOAT64)
    }

    fn children(&self, index: usize) -> Result<(Child, Option<Child>), MeshError> {
        let stored = self.property.stored(index);
        let missing = || malformed(format!("sample {index} of `{}` is missing", self.property.name));
        if index >= self.property.samples {
            return Err(missing());
        }
        if self.property.is_array() {
            let data = self.group.get(2 * stored).copied().ok_or_else(missing)?;
            Ok((data, self.group.get(2 * stored + 1).copied()))
        } else {
            Ok((self.group.get(stored).copied().ok_or_else(missing)?, None))
        }
    }
}

/// Parses one property header: 32 bits of flags, then integers of the width that the flags state.
fn property_header(table: &mut Table<'_>, child: Child, samplings: usize) -> Result<Property, MeshError> {
    let info = table.u32()?;
    let hint = info >> 2 & 3;
    let mut property = Property {
        name: String::new(),
        kind: (info & 3) as u8,
        pod: (info >> 4 & 15) as u8,
        extent: (info >> 12 & 0xff) as usize,
        samples: 0,
        first_changed: 0,
        last_changed: 0,
        sampling: 0,
        child,
    };
    if !property.is_compound() {
        property.samples = table.sized(hint)?;
        if info & 0x200 != 0 {
            property.first_changed = table.sized(hint)?;
            property.last_changed = table.sized(hint)?;
        } else if info & 0x800 == 0 {
            property.first_changed = 1;
            property.last_changed = property.samples.saturating_sub(1);
        }
        if info & 0x100 != 0 {
            property.sampling = table.sized(hint)?;
        }
    }
    let length = table.sized(hint)?;
    property.name = table.name(length)?;
    if info >> 20 & 0xff == 0xff {
        let metadata = table.sized(hint)?;
        table.take(metadata)?;
    }
    if property.sampling >= samplings {
        return Err(malformed(format!(
            "property `{}` uses time sampling {}, there are {samplings}",
            property.name, property.sampling
        )));
    }
    Ok(property)
}

fn time_samplings(bytes: &[u8]) -> Result<Vec<TimeSampling>, MeshError> {
    let mut table = Table { bytes, what: "time samplings" };
    let mut out = Vec::new();
    while !table.bytes.is_empty() {
        table.u32()?;
        let period = f64_le(table.take(8)?);
        let n = table.u32()? as usize;
        let times = table.take(n.saturating_mul(8))?.chunks_exact(8).map(f64_le).collect();
        out.push(TimeSampling { period, times });
    }
    if out.is_empty() {
        // Sampling 0 of every archive: one sample per second from 0 s.
        out.push(TimeSampling { period: 1.0, times: vec![0.0] });
    }
    Ok(out)
}

fn number(pod: u8, b: &[u8]) -> f64 {
    use super::super::bytes::array;
    match pod {
        0 | 1 => f64::from(b[0]),
        2 => f64::from(b[0] as i8),
        3 => f64::from(u16::from_le_bytes(array(b))),
        4 => f64::from(i16::from_le_bytes(array(b))),
        5 => f64::from(u32_le(b)),
        6 => f64::from(u32_le(b) as i32),
        7 => u64_le(b) as f64,
        8 => u64_le(b) as i64 as f64,
        FLOAT32 => f64::from(f32_le(b)),
        FLOAT64 => f64_le(b),
        _ => f64::NAN,
    }
}
