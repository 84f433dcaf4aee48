//! Units of recordings with their features, from which concatenative synthesis chooses.

use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::ops::Range;
use thiserror::Error;

use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::feature::FeatureConventions;

/// Format of [`UnitDatabase`] that this code reads and writes.
pub const DATABASE_VERSION: u32 = 4;

/// Speed and level of a segment relative to those of its recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variant {
    /// Factor on the speed, and on the pitch.
    pub speed: f32,
    /// Gain, dB.
    pub gain: f32,
}

impl Default for Variant {
    /// The recording itself.
    fn default() -> Self {
        Self { speed: 1.0, gain: 0.0 }
    }
}

/// A recording without any gap: filters, look-ahead and runs of units never leave it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Its first unit.
    pub start: u32,
    /// Its units.
    pub units: u32,
    /// Index of the recording that it comes from.
    pub source: u32,
    /// First channel of the recording that it holds; joint databases hold all from it on.
    pub channel: u32,
    /// Sample of the recording, at the database's rate, where it begins.
    pub offset: u64,
    /// Speed and level; different from those of the recording in an augmented database.
    pub variant: Variant,
}

impl Segment {
    /// Its units.
    #[must_use]
    pub fn range(&self) -> Range<usize> {
        self.start as usize..(self.start + self.units) as usize
    }

    /// Returns true if it has the speed and level of its recording.
    #[must_use]
    pub fn is_original(&self) -> bool {
        self.variant == Variant::default()
    }
}

/// A recording of a database.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnitSource {
    /// Provenance of the recording: its path by default.
    pub provenance: String,
    /// Licence of the recording.
    pub licence: String,
    /// A material, or a cause such as `friction`; may be empty.
    pub tag: String,
    /// Digest of its content, independent of the file name; empty if it is unknown.
    pub content: String,
}

/// Units of recordings, with their features as made and as filtered over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnitDatabase {
    /// [`DATABASE_VERSION`].
    pub version: u32,
    /// Conventions of the features, with the widths of the Gaussian that filtered them.
    pub conventions: FeatureConventions,
    /// Least energy of a band, as mean square of full scale.
    pub floor_energy: f64,
    /// Gap-free stretches, in order and without gaps between them.
    pub segments: Vec<Segment>,
    /// Recordings that the units come from.
    pub sources: Vec<UnitSource>,
    /// Samples, channel by channel: `[joined * units * unit]`, high-passed as the conventions state.
    pub audio: Vec<f32>,
    /// Features as made, `[units * dims]`.
    pub unfiltered: Vec<f32>,
    /// Features after the Gaussian over time, `[units * dims]`, which are compared with targets.
    pub features: Vec<f32>,
}

/// Reasons why a unit database cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum DatabaseError {
    /// Another version of the format.
    #[error("unit database has version {found}; this reads version {DATABASE_VERSION}: build it again")]
    Version {
        /// The version found.
        found: u32,
    },
    /// No units.
    #[error("the unit database holds no unit: give recordings of at least one unit, {unit} samples")]
    Empty {
        /// Samples in a unit.
        unit: u32,
    },
    /// A field of the wrong length.
    #[error("`{field}` holds {found} values; {expected} are needed")]
    Length {
        /// Name of the field.
        field: &'static str,
        /// Values found.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// A segment that does not begin where the one before ends.
    #[error("segment {index} begins at unit {found}; {expected} is next")]
    Segments {
        /// Index of the segment.
        index: usize,
        /// Its first unit.
        found: usize,
        /// The expected start.
        expected: usize,
    },
    /// A number that is not finite.
    #[error("`{field}` of unit {unit} holds {found}; only finite numbers can be compared")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// The unit.
        unit: usize,
        /// The value.
        found: f32,
    },
}

/// The file names of some paths, in order.
pub(crate) fn file_names<'a>(paths: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = paths.map(|path| path.rsplit(['/', '\\']).next().unwrap_or_default()).collect();
    names.join(", ")
}

impl UnitDatabase {
    /// Returns the number of units.
    #[must_use]
    pub fn len(&self) -> usize {
        self.segments.last().map_or(0, |last| last.range().end)
    }

    /// Returns true if there are no units.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the file names of its recordings in order, which identify it.
    #[must_use]
    pub fn recordings(&self) -> String {
        file_names(self.sources.iter().map(|s| s.provenance.as_str()))
    }

    /// Numbers in a feature vector.
    #[must_use]
    pub fn dims(&self) -> usize {
        self.conventions.dims()
    }

    /// Audio channels of a unit.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.conventions.joined.max(1) as usize
    }

    /// Samples in a unit.
    #[must_use]
    pub fn unit(&self) -> usize {
        self.conventions.unit as usize
    }

    /// All samples of one channel, unit after unit.
    #[must_use]
    pub fn channel(&self, channel: usize) -> &[f32] {
        let samples = self.len() * self.unit();
        self.audio.get(channel * samples..(channel + 1) * samples).unwrap_or_default()
    }

    /// Filtered features of a unit.
    #[must_use]
    pub fn feature(&self, unit: usize) -> &[f32] {
        let dims = self.dims();
        self.features.get(unit * dims..(unit + 1) * dims).unwrap_or_default()
    }

    /// Index of the segment that holds a unit.
    #[must_use]
    pub fn segment_of(&self, unit: usize) -> Option<usize> {
        let after = self.segments.partition_point(|segment| segment.start as usize <= unit);
        let index = after.checked_sub(1)?;
        self.segments.get(index)?.range().contains(&unit).then_some(index)
    }

    /// The recording of a unit.
    #[must_use]
    pub fn source_of(&self, unit: usize) -> Option<&UnitSource> {
        let segment = self.segments.get(self.segment_of(unit)?)?;
        self.sources.get(segment.source as usize)
    }

    /// Segments with the speed and level of their recordings.
    pub fn originals(&self) -> impl Iterator<Item = &Segment> {
        self.segments.iter().filter(|segment| segment.is_original())
    }

    /// Number of units with the speed and level of their recordings, which come first.
    #[must_use]
    pub fn recorded(&self) -> usize {
        self.originals().map(|segment| segment.units as usize).sum()
    }

    /// The first unit with the sound of each unit at any level; empty if each is its own.
    ///
    /// # Complexity
    /// O(units) time and memory.
    #[must_use]
    pub fn same_sounds(&self) -> Vec<u32> {
        if self.segments.iter().all(|s| s.variant.gain == 0.0) {
            return Vec::new();
        }
        let mut firsts: HashMap<_, u32> = HashMap::new();
        let mut same = Vec::with_capacity(self.len());
        for s in &self.segments {
            let sound = (s.source, s.channel, s.offset, s.variant.speed.to_bits());
            let first = *firsts.entry(sound).or_insert(s.start);
            same.extend(first..first + s.units);
        }
        same
    }

    /// Checks the invariants that the type does not enforce: lengths, segments, finite numbers.
    ///
    /// # Errors
    /// The first thing found, with its place.
    pub fn validate(&self) -> Result<(), DatabaseError> {
        if self.version != DATABASE_VERSION {
            return Err(DatabaseError::Version { found: self.version });
        }
        let mut expected = 0;
        for (index, segment) in self.segments.iter().enumerate() {
            let found = segment.start as usize;
            if found != expected {
                return Err(DatabaseError::Segments { index, found, expected });
            }
            expected = segment.range().end;
        }
        let units = self.len();
        if units == 0 || self.unit() == 0 || self.dims() == 0 {
            return Err(DatabaseError::Empty { unit: self.conventions.unit });
        }
        let per = [
            ("audio", &self.audio, self.channels() * self.unit()),
            ("unfiltered", &self.unfiltered, self.dims()),
            ("features", &self.features, self.dims()),
        ];
        for (field, values, per) in per {
            let (found, expected) = (values.len(), per * units);
            if found != expected {
                return Err(DatabaseError::Length { field, found, expected });
            }
            // Every channel of the audio holds all units.
            let in_unit = if field == "audio" { self.unit() } else { per };
            if let Some(at) = values.iter().position(|x| !x.is_finite()) {
                let found = values[at];
                return Err(DatabaseError::NotFinite { field, unit: at / in_unit % units, found });
            }
        }
        Ok(())
    }
}

impl Data for UnitDatabase {
    const NAME: &'static str = "unit database";
    const FILES: bool = true;

    /// As [`UnitDatabase::to_bytes`].
    fn file(&self) -> Option<Vec<u8>> {
        self.to_bytes().ok()
    }

    fn trial(rng: &mut Rng) -> Self {
        let conventions = FeatureConventions::trial();
        let mut segments = Vec::new();
        let mut start = 0;
        for _ in 0..1 + rng.below(3) {
            let units = 1 + rng.below(60) as u32;
            segments.push(Segment { start, units, source: 0, ..Segment::default() });
            start += units;
        }
        let (units, dims) = (start as usize, conventions.dims());
        let mut values = |count: usize, most: f64| -> Vec<f32> {
            (0..count).map(|_| rng.between(-most, most) as f32).collect()
        };
        let audio = values(units * conventions.unit as usize, 0.5);
        let features = values(units * dims, 3.0);
        Self {
            version: DATABASE_VERSION,
            floor_energy: 1e-10,
            segments,
            sources: vec![UnitSource::default()],
            audio,
            unfiltered: features.clone(),
            features,
            conventions,
        }
    }
}

/// Figures of a database for the summary of a run.
pub(super) fn database_summary(db: &UnitDatabase) -> Summary {
    let of_units = |units: usize| (units * db.unit()) as f64 / db.conventions.rate.as_f64();
    vec![
        ("units", db.len().into()),
        ("recorded_units", db.recorded().into()),
        ("unit_samples", db.unit().into()),
        ("segments", db.segments.len().into()),
        ("seconds", of_units(db.recorded()).into()),
        ("floor_db", (10.0 * db.floor_energy.log10()).into()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trials_are_valid_and_faults_are_named_with_their_place() {
        let mut rng = Rng::new(1);
        let good = UnitDatabase::trial(&mut rng);
        good.validate().unwrap();
        let mut bad = good.clone();
        bad.features[4] = f32::NAN;
        assert!(matches!(bad.validate(), Err(DatabaseError::NotFinite { field: "features", unit: 1, .. })));
        let bad = UnitDatabase { version: 7, ..good.clone() };
        assert_eq!(bad.validate(), Err(DatabaseError::Version { found: 7 }));
        let bad = UnitDatabase { segments: Vec::new(), ..good.clone() };
        assert_eq!(bad.validate(), Err(DatabaseError::Empty { unit: 4 }));
        let mut bad = good.clone();
        bad.audio.pop();
        assert!(matches!(bad.validate(), Err(DatabaseError::Length { field: "audio", .. })));
        let mut bad = good;
        bad.segments[0].start = 1;
        assert!(matches!(bad.validate(), Err(DatabaseError::Segments { index: 0, found: 1, expected: 0 })));
    }

    #[test]
    fn a_unit_has_its_segment() {
        let mut rng = Rng::new(5);
        let db = UnitDatabase::trial(&mut rng);
        for (k, segment) in db.segments.iter().enumerate() {
            assert_eq!(db.segment_of(segment.range().start), Some(k));
            assert_eq!(db.segment_of(segment.range().end - 1), Some(k));
        }
        assert_eq!(db.segment_of(db.len()), None);
    }
}
