//! Checked access to the bytes of a glTF asset: GLB chunks, buffers, accessors.

use std::collections::BTreeMap;
use std::sync::Arc;

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::{Source, View};

use super::super::bytes::{array, u32_le};
use super::super::{MeshError, MeshLimits};

pub(super) const FORMAT: &str = "glTF";

pub(super) fn malformed(what: impl Into<String>) -> MeshError {
    MeshError::Malformed { format: FORMAT, what: what.into() }
}

/// JSON and binary chunk of a GLB file, or the complete file as JSON.
///
/// The reader of the `gltf` crate subtracts the length of the header unchecked, so this function parses the container.
pub(super) fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshError> {
    if !bytes.starts_with(b"glTF") {
        if bytes.trim_ascii_start().first() == Some(&b'{') {
            return Ok((bytes, None));
        }
        let found = format!("it starts with {:?}", String::from_utf8_lossy(&bytes[..bytes.len().min(4)]));
        return Err(MeshError::Format { expected: "a glTF file (GLB or JSON)", found });
    }
    let version = u32_le(bytes.get(4..8).unwrap_or(&[]));
    if version != 2 {
        return Err(MeshError::Unsupported {
            format: FORMAT,
            what: format!("version {version}; this reader reads 2"),
        });
    }
    let (mut json, mut bin) = (None, None);
    let mut offset = 12;
    while let (Some(head), true) = (bytes.get(offset..offset + 8), json.is_none() || bin.is_none()) {
        let length = u32_le(head) as usize;
        let start = offset + 8;
        let Some(chunk) = bytes.get(start..start.saturating_add(length)) else {
            return Err(MeshError::Truncated {
                format: FORMAT,
                what: format!("the chunk at byte {offset}"),
                needed: start as u64 + length as u64,
                available: bytes.len() as u64,
            });
        };
        match &head[4..] {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if bin.is_none() => bin = Some(chunk),
            _ => {}
        }
        offset = start + length;
    }
    let json = json.ok_or_else(|| malformed("the GLB file has no JSON chunk"))?;
    Ok((json, bin))
}

/// Parses and validates the JSON, and checks first what the `gltf` crate indexes or unwraps without validation.
pub(super) fn document(json: &[u8]) -> Result<::gltf::Document, MeshError> {
    use ::gltf::json::validation::Checked::Invalid;
    let parsed = ::gltf::Gltf::from_slice_without_validation(json).map_err(|e| malformed(e.to_string()))?;
    let root = parsed.document.into_json();
    for (k, animation) in root.animations.iter().enumerate() {
        let sampler = animation.samplers.iter().find(|s| {
            matches!(s.interpolation, Invalid)
                || s.input.value() >= root.accessors.len()
                || s.output.value() >= root.accessors.len()
        });
        let channel = animation.channels.iter().find(|c| {
            matches!(c.target.path, Invalid)
                || c.target.node.value() >= root.nodes.len()
                || c.sampler.value() >= animation.samplers.len()
        });
        if sampler.is_some() || channel.is_some() {
            return Err(malformed(format!(
                "animation {k} has an unknown path or interpolation, or names a node, sampler or accessor that does not exist"
            )));
        }
    }
    for (k, accessor) in root.accessors.iter().enumerate() {
        let sparse = accessor.sparse.as_ref().is_some_and(|s| matches!(s.indices.component_type, Invalid));
        if sparse || matches!(accessor.component_type, Invalid) || matches!(accessor.type_, Invalid) {
            return Err(malformed(format!("accessor {k} has an unknown type or component type")));
        }
    }
    for (k, mesh) in root.meshes.iter().enumerate() {
        let outside = |p: &::gltf::json::mesh::Primitive| {
            p.attributes.values().any(|a| a.value() >= root.accessors.len())
        };
        if mesh.primitives.iter().any(|p| matches!(p.mode, Invalid) || outside(p)) {
            return Err(malformed(format!(
                "mesh {k} has a primitive of unknown mode (modes are 0 to 6) or without its accessors"
            )));
        }
    }
    ::gltf::Document::from_json(root).map_err(|e| malformed(e.to_string()))
}

/// Buffers of the asset, and accessors decoded from them.
pub(super) struct Buffers<'a> {
    buffers: Vec<std::borrow::Cow<'a, [u8]>>,
    decoded: BTreeMap<(usize, usize), Arc<Vec<f32>>>,
    /// Bytes left for decoded accessors.
    budget: u64,
    limits: MeshLimits,
}

impl<'a> Buffers<'a> {
    pub(super) fn load(
        document: &::gltf::Document,
        bin: Option<&'a [u8]>,
        resolve: &mut dyn FnMut(&str) -> std::io::Result<Vec<u8>>,
        limits: MeshLimits,
    ) -> Result<Self, MeshError> {
        let mut total = 0;
        let mut buffers = Vec::new();
        for buffer in document.buffers() {
            let bytes: std::borrow::Cow<'a, [u8]> = match buffer.source() {
                Source::Bin => {
                    bin.ok_or_else(|| malformed("a buffer without uri needs a GLB binary chunk"))?.into()
                }
                Source::Uri(uri) => match uri.strip_prefix("data:") {
                    Some(data) => data_uri(data)?.into(),
                    None => resolve(uri).map_err(|source| MeshError::Io { format: FORMAT, source })?.into(),
                },
            };
            let (needed, available) = (buffer.length() as u64, bytes.len() as u64);
            if needed > available {
                let what = format!("buffer {}", buffer.index());
                return Err(MeshError::Truncated { format: FORMAT, what, needed, available });
            }
            total += available;
            limits.bytes(total)?;
            buffers.push(bytes);
        }
        Ok(Self { buffers, decoded: BTreeMap::new(), budget: limits.max_bytes, limits })
    }

    /// Values of an accessor of `width` components as floats; normalised integers become fractions.
    pub(super) fn floats(
        &mut self,
        accessor: &::gltf::Accessor<'_>,
        width: usize,
    ) -> Result<Arc<Vec<f32>>, MeshError> {
        if let Some(values) = self.decoded.get(&(accessor.index(), width)) {
            return Ok(values.clone());
        }
        let mut out = Vec::new();
        self.decode(accessor, width, |pod, normalised, bytes| out.push(float(pod, normalised, bytes)), true)?;
        let out = Arc::new(with_sparse_values(self, accessor, width, out)?);
        self.decoded.insert((accessor.index(), width), out.clone());
        Ok(out)
    }

    /// Values of an accessor of unsigned integers.
    pub(super) fn integers(
        &mut self,
        accessor: &::gltf::Accessor<'_>,
        width: usize,
    ) -> Result<Vec<u32>, MeshError> {
        if accessor.sparse().is_some() {
            return Err(MeshError::Unsupported {
                format: FORMAT,
                what: "a sparse accessor for indices or joints".into(),
            });
        }
        if !matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32) {
            return Err(malformed(format!(
                "accessor {} holds {:?}, unsigned integers are expected",
                accessor.index(),
                accessor.data_type()
            )));
        }
        let mut out = Vec::new();
        self.decode(accessor, width, |pod, _, bytes| out.push(integer(pod, bytes)), false)?;
        Ok(out)
    }

    /// Subtracts the memory of decoded values from the budget.
    pub(super) fn charge(&mut self, count: usize, width: usize) -> Result<(), MeshError> {
        let size = (count as u64).saturating_mul(4 * width as u64);
        if size > self.budget {
            return self.limits.bytes(size.saturating_add(self.limits.max_bytes));
        }
        self.budget -= size;
        Ok(())
    }

    fn decode(
        &mut self,
        accessor: &::gltf::Accessor<'_>,
        width: usize,
        mut each: impl FnMut(DataType, bool, &[u8]),
        zeros: bool,
    ) -> Result<(), MeshError> {
        let index = accessor.index();
        if components(accessor.dimensions()) != width {
            return Err(malformed(format!(
                "accessor {index} has the shape {:?}, {width} components are expected",
                accessor.dimensions()
            )));
        }
        let (count, pod) = (accessor.count(), accessor.data_type());
        let size = component_size(pod);
        let Some(view) = accessor.view() else {
            if !zeros || accessor.sparse().is_none() {
                return Err(malformed(format!("accessor {index} has no bufferView and is not sparse")));
            }
            // These zeros take no bytes of the file: they are limited like vertices.
            self.limits.vertices(count as u64)?;
            self.charge(count, width)?;
            (0..count * width).for_each(|_| each(DataType::U8, false, &[0]));
            return Ok(());
        };
        let item = width * size;
        let stride = view.stride().unwrap_or(item);
        if items(self.view(&view)?, accessor.offset(), count, stride, item).is_none() {
            return Err(too_long(index, &view));
        }
        self.charge(count, width)?;
        let bytes = items(self.view(&view)?, accessor.offset(), count, stride, item)
            .ok_or_else(|| too_long(index, &view))?;
        for k in 0..count {
            let row = &bytes[k * stride..k * stride + item];
            row.chunks_exact(size).for_each(|b| each(pod, accessor.normalized(), b));
        }
        Ok(())
    }

    fn view(&self, view: &View<'_>) -> Result<&[u8], MeshError> {
        let end = view.offset().saturating_add(view.length());
        self.buffers.get(view.buffer().index()).and_then(|b| b.get(view.offset()..end)).ok_or_else(|| {
            malformed(format!("bufferView {} reaches byte {end}, its buffer is shorter", view.index()))
        })
    }
}

fn too_long(accessor: usize, view: &View<'_>) -> MeshError {
    malformed(format!(
        "accessor {accessor} reaches beyond bufferView {} of {} bytes",
        view.index(),
        view.length()
    ))
}

/// The part of a view that holds `count` items; `None` if the view is too short.
fn items(view: &[u8], offset: usize, count: usize, stride: usize, item: usize) -> Option<&[u8]> {
    if count == 0 {
        return Some(&[]);
    }
    if stride < item {
        return None;
    }
    let length = stride.checked_mul(count - 1)?.checked_add(item)?;
    view.get(offset..offset.checked_add(length)?)
}

/// Replaces the items of a sparse accessor in `out`.
fn with_sparse_values(
    buffers: &mut Buffers<'_>,
    accessor: &::gltf::Accessor<'_>,
    width: usize,
    mut out: Vec<f32>,
) -> Result<Vec<f32>, MeshError> {
    use ::gltf::accessor::sparse::IndexType;
    let Some(sparse) = accessor.sparse() else { return Ok(out) };
    let (count, pod, index) = (sparse.count(), accessor.data_type(), accessor.index());
    let kind = match sparse.indices().index_type() {
        IndexType::U8 => DataType::U8,
        IndexType::U16 => DataType::U16,
        IndexType::U32 => DataType::U32,
    };
    let (index_size, size) = (component_size(kind), component_size(pod));
    let (indices, values) = (sparse.indices(), sparse.values());
    let index_bytes = items(buffers.view(&indices.view())?, indices.offset(), count, index_size, index_size);
    let values_view = values.view();
    let rows = items(buffers.view(&values_view)?, values.offset(), count, width * size, width * size);
    let (Some(index_bytes), Some(rows)) = (index_bytes, rows) else {
        return Err(too_long(index, &values_view));
    };
    for (item, row) in index_bytes.chunks_exact(index_size).zip(rows.chunks_exact(width * size)) {
        let item = integer(kind, item) as usize;
        let Some(slot) = out.get_mut(item.saturating_mul(width)..(item + 1).saturating_mul(width)) else {
            return Err(malformed(format!(
                "sparse accessor {index} replaces item {item}; it has {}",
                accessor.count()
            )));
        };
        for (x, b) in slot.iter_mut().zip(row.chunks_exact(size)) {
            *x = float(pod, accessor.normalized(), b);
        }
    }
    Ok(out)
}

fn components(dimensions: Dimensions) -> usize {
    match dimensions {
        Dimensions::Scalar => 1,
        Dimensions::Vec2 => 2,
        Dimensions::Vec3 => 3,
        Dimensions::Vec4 | Dimensions::Mat2 => 4,
        Dimensions::Mat3 => 9,
        Dimensions::Mat4 => 16,
    }
}

fn component_size(pod: DataType) -> usize {
    match pod {
        DataType::I8 | DataType::U8 => 1,
        DataType::I16 | DataType::U16 => 2,
        DataType::U32 | DataType::F32 => 4,
    }
}

fn integer(pod: DataType, b: &[u8]) -> u32 {
    match pod {
        DataType::U8 | DataType::I8 => u32::from(b[0]),
        DataType::U16 | DataType::I16 => u32::from(u16::from_le_bytes(array(b))),
        DataType::U32 | DataType::F32 => u32_le(b),
    }
}

fn float(pod: DataType, normalised: bool, b: &[u8]) -> f32 {
    let (value, full) = match pod {
        DataType::F32 => return f32::from_le_bytes(array(b)),
        DataType::I8 => (f32::from(b[0] as i8), 127.0),
        DataType::U8 => (f32::from(b[0]), 255.0),
        DataType::I16 => (f32::from(i16::from_le_bytes(array(b))), 32767.0),
        DataType::U16 => (f32::from(u16::from_le_bytes(array(b))), 65535.0),
        DataType::U32 => (u32_le(b) as f32, u32::MAX as f32),
    };
    if normalised { (value / full).max(-1.0) } else { value }
}

/// Bytes of a `data:` address without its scheme.
fn data_uri(rest: &str) -> Result<Vec<u8>, MeshError> {
    let (kind, text) = rest.split_once(',').ok_or_else(|| malformed("a data: address has no comma"))?;
    if !kind.ends_with(";base64") {
        return Err(MeshError::Unsupported {
            format: FORMAT,
            what: "a data: address that is not base64".into(),
        });
    }
    base64(text.as_bytes()).ok_or_else(|| malformed("a data: address holds characters that are not base64"))
}

fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 2);
    let (mut bits, mut bit_count) = (0u32, 0);
    for &c in text {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        bit_count += 6;
        if bit_count >= 8 {
            bit_count -= 8;
            out.push((bits >> bit_count) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_text_is_decoded() {
        assert_eq!(base64(b"Zm9sZXk="), Some(b"foley".to_vec()));
        assert_eq!(base64(b"Zm9sZQ=="), Some(b"fole".to_vec()));
        assert_eq!(base64(b"/+8"), Some(vec![0xff, 0xef]));
        assert_eq!(base64(b"a b"), None);
    }

    #[test]
    fn integers_are_normalised_to_one() {
        assert_eq!(float(DataType::I8, true, &[0x80]), -1.0);
        assert_eq!(float(DataType::U16, true, &[0xff, 0xff]), 1.0);
        assert_eq!(float(DataType::I16, false, &[0xfe, 0xff]), -2.0);
    }
}
