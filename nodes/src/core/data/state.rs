//! State of nodes: saved to an archive, and restored into a new node.
//!
//! One description serves both directions: a node lists its state in [`Node::archive_state`](crate::core::node::Node::archive_state), and a
//! [`StateArchive`] either writes it to bytes or restores it from bytes.

use super::fault::Fault;
use serde::{Serialize, de::DeserializeOwned};
use std::io::{Seek, SeekFrom, Write};

/// Saves states to bytes, or restores them in the same order.
#[derive(Debug)]
pub struct StateArchive<'a>(Mode<'a>);

#[derive(Debug)]
enum Mode<'a> {
    Save(&'a mut Vec<u8>),
    Restore(&'a [u8]),
}

impl<'a> StateArchive<'a> {
    /// Saves to the end of these bytes.
    #[must_use]
    pub fn save(bytes: &'a mut Vec<u8>) -> Self {
        Self(Mode::Save(bytes))
    }

    /// Restores from these bytes.
    #[must_use]
    pub fn restore(bytes: &'a [u8]) -> Self {
        Self(Mode::Restore(bytes))
    }

    /// Returns true for an archive that restores.
    #[must_use]
    pub fn restores(&self) -> bool {
        matches!(self.0, Mode::Restore(_))
    }

    /// Returns true if all saved data has been restored.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        matches!(self.0, Mode::Restore([]))
    }

    /// Saves or restores every state of a list, which must have the same length when it is restored as when it was saved.
    ///
    /// # Errors
    /// When it is not, or as [`Stateful::archive_state`].
    pub fn each<'s, S: Stateful + 's>(
        &mut self,
        states: impl IntoIterator<Item = &'s mut S, IntoIter: ExactSizeIterator>,
    ) -> Result<(), Fault> {
        let states = states.into_iter();
        let (own, mut count) = (states.len(), states.len());
        count.archive_state(self)?;
        if count != own {
            return Err(mismatch());
        }
        states.into_iter().try_for_each(|state| state.archive_state(self))
    }
}

/// Error for bytes of another state type.
pub(super) fn mismatch() -> Fault {
    Fault::new("F084", "the saved state of a run does not fit its nodes")
        .help("run it from its beginning: --checkpoint 0")
}

/// A state that can be saved and restored.
pub trait Stateful {
    /// Saves the state, or replaces it.
    ///
    /// # Errors
    /// If the saved state is not of this kind.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault>;
}

impl<T: Serialize + DeserializeOwned> Stateful for T {
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        match &mut archive.0 {
            Mode::Save(bytes) => postcard::to_io(self, bytes).map(drop).map_err(|_| mismatch()),
            Mode::Restore(bytes) => {
                let (state, rest) = postcard::take_from_bytes(bytes).map_err(|_| mismatch())?;
                *self = state;
                *bytes = rest;
                Ok(())
            }
        }
    }
}

/// Saves the position of a sink, or continues at it in a sink that holds everything before it.
///
/// # Errors
/// When the sink fails.
pub fn archive_position<W: Write + Seek + ?Sized>(
    sink: &mut W,
    archive: &mut StateArchive<'_>,
) -> Result<(), Fault> {
    let failed = |e: std::io::Error| Fault::new("F080", format!("an output cannot be continued: {e}"));
    let mut place = if archive.restores() { 0 } else { sink.stream_position().map_err(failed)? };
    place.archive_state(archive)?;
    sink.flush().map_err(failed)?;
    if archive.restores() {
        sink.seek(SeekFrom::Start(place)).map_err(failed)?;
    }
    Ok(())
}

/// Serde for arrays that are longer than serde supports: `#[serde(with = "long")]`.
pub mod long {
    use serde::de::{DeserializeOwned, Error};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes the elements and their number.
    ///
    /// # Errors
    /// As the serializer.
    pub fn serialize<T: Serialize, S: Serializer, const N: usize>(
        array: &[T; N],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        array.as_slice().serialize(to)
    }

    /// Reads as many elements as the array has.
    ///
    /// # Errors
    /// As the deserializer, and where there are fewer or more.
    pub fn deserialize<'de, T: DeserializeOwned, D: Deserializer<'de>, const N: usize>(
        from: D,
    ) -> Result<[T; N], D::Error> {
        let list = Vec::<T>::deserialize(from)?;
        let found = list.len();
        list.try_into().map_err(|_| D::Error::invalid_length(found, &"as many elements as the array has"))
    }
}

/// Names the fields of a type that change while it works: `impl_state!(Filter { z, each stages })`.
///
/// A field after `each` is a list, an array or an option of states that is as long when it is restored.
#[macro_export]
macro_rules! impl_state {
    ($ty:ty { $($fields:tt)* }) => {
        impl $crate::core::state::Stateful for $ty {
            $crate::archive_state!($($fields)*);
        }
    };
    (@ $own:ident, $archive:ident, ) => { Ok(()) };
    (@ $own:ident, $archive:ident, each $field:tt $(, $($rest:tt)*)?) => {{
        $archive.each(&mut $own.$field)?;
        $crate::impl_state!(@ $own, $archive, $($($rest)*)?)
    }};
    (@ $own:ident, $archive:ident, $field:tt $(, $($rest:tt)*)?) => {{
        $crate::core::state::Stateful::archive_state(&mut $own.$field, $archive)?;
        $crate::impl_state!(@ $own, $archive, $($($rest)*)?)
    }};
}

/// The [`Node::archive_state`](crate::core::node::Node::archive_state) of a node, or the [`Stateful::archive_state`](crate::core::state::Stateful::archive_state) of a type with parameters, by the fields
/// that change while it works, as in [`impl_state!`](crate::impl_state).
#[macro_export]
macro_rules! archive_state {
    ($($fields:tt)*) => {
        fn archive_state(
            &mut self,
            archive: &mut $crate::core::state::StateArchive<'_>,
        ) -> Result<(), $crate::core::fault::Fault> {
            $crate::impl_state!(@ self, archive, $($fields)*)
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Filter {
        b: f64,
        z: [f64; 2],
    }
    impl_state!(Filter { z });

    struct Voices {
        seen: u64,
        filters: Vec<Filter>,
        last: Option<Filter>,
        queue: Vec<(i64, String)>,
    }
    impl_state!(Voices { seen, each filters, each last, queue });

    fn voices(filters: usize, x: f64) -> Voices {
        let filter = |k: usize| Filter { b: x, z: [x + k as f64, f64::NAN] };
        Voices {
            seen: x as u64,
            filters: (0..filters).map(filter).collect(),
            last: Some(filter(9)),
            queue: vec![(-3, format!("{x}"))],
        }
    }

    #[test]
    fn what_was_saved_comes_back_and_the_rest_stays() {
        let mut bytes = Vec::new();
        voices(3, 5.0).archive_state(&mut StateArchive::save(&mut bytes)).unwrap();
        let mut other = voices(3, 7.0);
        let mut archive = StateArchive::restore(&bytes);
        other.archive_state(&mut archive).unwrap();
        assert!(archive.is_empty());
        assert_eq!((other.seen, &*other.queue), (5, &[(-3, "5".to_owned())][..]));
        assert_eq!(other.filters.iter().map(|f| f.z[0]).collect::<Vec<_>>(), [5.0, 6.0, 7.0]);
        assert!(other.last.unwrap().z[1].is_nan());
        assert_eq!(other.filters[0].b, 7.0, "what a node was built with is not carried");
    }

    #[test]
    fn another_number_of_states_or_fewer_bytes_are_refused() {
        let mut bytes = Vec::new();
        voices(3, 5.0).archive_state(&mut StateArchive::save(&mut bytes)).unwrap();
        assert_eq!(
            voices(2, 5.0).archive_state(&mut StateArchive::restore(&bytes)).unwrap_err().code,
            "F084"
        );
        for length in 0..bytes.len() {
            let cut = voices(3, 5.0).archive_state(&mut StateArchive::restore(&bytes[..length]));
            assert_eq!(cut.unwrap_err().code, "F084");
        }
    }
}
