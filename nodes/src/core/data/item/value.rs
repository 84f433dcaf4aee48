//! Values: the runtime's view of their type, and shared values.

use super::contract::Data;
use super::described::{Described, OfData};
use crate::core::random::Rng;
use std::any::{Any, TypeId};
use std::fmt::{self, Debug};
use std::io::{self, BufWriter};
use std::sync::Arc;

/// The runtime's view of a [`Data`] type.
pub struct DataType {
    /// The name that people see.
    pub name: &'static str,
    /// Identity.
    pub id: fn() -> TypeId,
    /// Writes the value as JSON without a tree, which would take many times the memory of a large value.
    pub json: fn(&AnyValue, &mut dyn io::Write) -> io::Result<()>,
    /// True if its values have drawings.
    pub plots: bool,
    /// True if they have a file format of their own.
    pub files: bool,
    /// The value drawn as SVG.
    pub plot: fn(&AnyValue) -> Option<String>,
    /// The value as a file of its own kind.
    pub file: fn(&AnyValue) -> Option<Vec<u8>>,
    /// The value as bytes, for the memo.
    pub encode: fn(&AnyValue) -> Option<Vec<u8>>,
    /// The value from its bytes.
    pub decode: fn(&[u8]) -> Option<AnyValue>,
    /// A valid value for trials.
    pub trial: fn(&mut Rng) -> AnyValue,
}

impl Debug for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl<T: Data> Described for OfData<T> {
    type Info = DataType;
    const INFO: &'static DataType = &DataType {
        name: T::NAME,
        id: TypeId::of::<T>,
        json: |value, to| match value.get::<T>() {
            Some(v) => Ok(serde_json::to_writer_pretty(to, v)?),
            None => Ok(()),
        },
        plots: T::PLOTS,
        files: T::FILES,
        plot: |value| value.get::<T>().and_then(T::plot),
        file: |value| value.get::<T>().and_then(T::file),
        encode: |value| value.get::<T>().and_then(|v| postcard::to_allocvec(v).ok()),
        decode: |bytes| postcard::from_bytes::<T>(bytes).ok().map(AnyValue::new),
        trial: |rng| AnyValue::new(T::trial(rng)),
    };
}

/// A shared value with the hash of its content.
#[derive(Clone)]
pub struct AnyValue {
    data: Arc<dyn Any + Send + Sync>,
    hash: [u8; 32],
    kind: &'static DataType,
}

impl AnyValue {
    /// Shares a value.
    #[must_use]
    pub fn new<T: Data>(value: T) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(T::NAME.as_bytes()).update(&[0]);
        // A value may be large: its bytes are never there at once. A hasher takes all that is written.
        let _ = postcard::to_io(&value, BufWriter::with_capacity(1 << 16, &mut hasher));
        Self { data: Arc::new(value), hash: *hasher.finalize().as_bytes(), kind: OfData::<T>::INFO }
    }

    /// The value, where it is a `T`.
    #[must_use]
    pub fn get<T: Data>(&self) -> Option<&T> {
        self.data.downcast_ref()
    }

    /// The value as a shared pointer, where it is a `T`.
    #[must_use]
    pub fn shared<T: Data>(&self) -> Option<Arc<T>> {
        Arc::clone(&self.data).downcast().ok()
    }

    /// The value as JSON text.
    #[must_use]
    pub fn json(&self) -> String {
        let mut text = Vec::new();
        // Writing to memory cannot fail; a value without JSON writes none.
        let _ = (self.kind.json)(self, &mut text);
        String::from_utf8(text).unwrap_or_default()
    }

    /// Hash of the content: equal values have equal hashes.
    #[must_use]
    pub fn hash(&self) -> [u8; 32] {
        self.hash
    }

    /// Its type.
    #[must_use]
    pub fn kind(&self) -> &'static DataType {
        self.kind
    }
}

impl Debug for AnyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}#{:02x}{:02x}{:02x}{:02x}",
            self.kind.name, self.hash[0], self.hash[1], self.hash[2], self.hash[3]
        )
    }
}
