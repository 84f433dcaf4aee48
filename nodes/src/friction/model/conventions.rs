//! Conventions of the spectra of a friction model.

use serde::{Deserialize, Serialize};

/// Area of cloth that a friction model's level stands for, in square metres.
pub const REFERENCE_AREA: f64 = 1e-4;

/// Source of the spectra of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Origin {
    /// Roller recording with an encoder, averaged in speed bins.
    Roller,
    /// Roller recording with an encoder, one spectrum per clip.
    RollerRaw,
    /// Plain recordings whose speeds are assumed, not measured.
    Recordings,
    /// Spectra from a caller.
    Given,
    /// Half-way between the models of two materials, of a pair that was not recorded.
    Inferred,
}

/// Processing of the spectra. Models with equal conventions can be compared.
///
/// A file also holds their digest (`hash`), which detects changes by hand. A file without a digest is accepted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "StoredConventions", try_from = "StoredConventions")]
pub struct Conventions {
    /// Source of the spectra.
    pub origin: Origin,
    /// Length of an analysis clip, in samples at the model's rate.
    pub clip_samples: u32,
    /// Time from one analysis clip to the next, in seconds; 0 when unknown.
    pub hop: f64,
    /// Cut-off of the high-pass applied to the spectra, in hertz; 0 for none.
    pub high_pass: f64,
    /// True if a noise floor was subtracted.
    pub floor_subtracted: bool,
    /// Sliding area in the recording, in square metres; the spectra are per [`REFERENCE_AREA`].
    pub contact_area: f64,
}

impl Conventions {
    /// The first 16 hexadecimal digits of [`hash`](Self::hash), as stored in files.
    fn digest(&self) -> String {
        blake3::Hash::from_bytes(self.hash()).to_hex()[..16].to_owned()
    }

    /// Returns a digest of all fields.
    #[must_use]
    pub fn hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&[self.origin as u8, u8::from(self.floor_subtracted)]);
        hasher.update(&self.clip_samples.to_le_bytes());
        for x in [self.hop, self.high_pass, self.contact_area] {
            hasher.update(&x.to_bits().to_le_bytes());
        }
        *hasher.finalize().as_bytes()
    }
}

/// [`Conventions`] as stored in files.
#[derive(Serialize, Deserialize)]
struct StoredConventions {
    origin: Origin,
    clip_samples: u32,
    hop: f64,
    high_pass: f64,
    floor_subtracted: bool,
    contact_area: f64,
    #[serde(default)]
    hash: String,
}

impl From<Conventions> for StoredConventions {
    fn from(c: Conventions) -> Self {
        let hash = c.digest();
        let Conventions { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area } = c;
        Self { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area, hash }
    }
}

impl TryFrom<StoredConventions> for Conventions {
    type Error = String;

    fn try_from(stored: StoredConventions) -> Result<Self, String> {
        let StoredConventions { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area, hash } =
            stored;
        let conventions = Self { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area };
        let expected = conventions.digest();
        if !hash.is_empty() && hash != expected {
            return Err(format!(
                "`hash` of the conventions is {hash:?}, their fields give {expected:?}: the fields were changed by hand"
            ));
        }
        Ok(conventions)
    }
}

/// A recording that a model was made from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// Subject and author of the recording.
    pub provenance: String,
    /// Licence of the recording.
    pub licence: String,
}

/// Numbers of clips that were analysed but not used, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rejections {
    /// On the seam of the cloth on the roller.
    pub seam: u32,
    /// Changed speed by more than the limit.
    pub speed_change: u32,
    /// Slower than the slowest speed to measure.
    pub at_rest: u32,
    /// Without encoder readings for the whole clip.
    pub outside_encoder: u32,
    /// Below the level of silence.
    pub silent: u32,
    /// Recordings shorter than one clip.
    pub too_short: u32,
}
