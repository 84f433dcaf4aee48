//! How the spectra of a friction model were made.

use serde::{Deserialize, Serialize};

/// Area of cloth that a friction model's level stands for, in square metres.
pub const REFERENCE_AREA: f64 = 1e-4;

/// How a model's spectra came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Origin {
    /// Roller recording with an encoder, averaged in speed bins.
    Roller,
    /// Roller recording with an encoder, one spectrum per clip.
    RollerRaw,
    /// Plain recordings whose speeds are assumed, not measured.
    Recordings,
    /// Spectra handed over by a caller.
    Given,
    /// Half-way between the models of two materials, for a pair that was not recorded.
    Inferred,
}

/// What was done to the spectra, so that a reader can tell whether two models may be compared.
///
/// In a file its digest stands beside it (`hash`), so that a change by hand is seen; a file without one is taken as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Written", try_from = "Written")]
pub struct Conventions {
    /// How the spectra came about.
    pub origin: Origin,
    /// Length of an analysis clip, in samples at the model's rate.
    pub clip_samples: u32,
    /// Distance of analysis clips, in seconds; 0 when unknown.
    pub hop: f64,
    /// Cut-off of the high-pass applied to the spectra, in hertz; 0 for none.
    pub high_pass: f64,
    /// Whether a noise floor was subtracted.
    pub floor_subtracted: bool,
    /// Sliding area that the recording heard, in square metres; the spectra are per 1e-4 m^2.
    pub contact_area: f64,
}

impl Conventions {
    /// The start of [`hash`](Self::hash), as files have it.
    fn digest(&self) -> String {
        blake3::Hash::from_bytes(self.hash()).to_hex()[..16].to_owned()
    }

    /// A digest of all fields.
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

/// [`Conventions`] as they are written.
#[derive(Serialize, Deserialize)]
struct Written {
    origin: Origin,
    clip_samples: u32,
    hop: f64,
    high_pass: f64,
    floor_subtracted: bool,
    contact_area: f64,
    #[serde(default)]
    hash: String,
}

impl From<Conventions> for Written {
    fn from(c: Conventions) -> Self {
        let hash = c.digest();
        let Conventions { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area } = c;
        Self { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area, hash }
    }
}

impl TryFrom<Written> for Conventions {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let Written { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area, hash } = written;
        let conventions = Self { origin, clip_samples, hop, high_pass, floor_subtracted, contact_area };
        let own = conventions.digest();
        if !hash.is_empty() && hash != own {
            return Err(format!(
                "the conventions have the hash {own}, and not {hash:?}: they were changed under it"
            ));
        }
        Ok(conventions)
    }
}

/// A recording that went into a model.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// What was recorded and by whom.
    pub provenance: String,
    /// The licence that it came under.
    pub licence: String,
}

/// Clips that were analysed but not used, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rejections {
    /// Touched the seam of the cloth on the roller.
    pub seam: u32,
    /// The speed changed by more than the limit.
    pub speed_change: u32,
    /// Slower than the slowest speed to be measured.
    pub at_rest: u32,
    /// No encoder reading for the whole clip.
    pub outside_encoder: u32,
    /// Too quiet to hold friction.
    pub silent: u32,
    /// Recordings shorter than one clip.
    pub too_short: u32,
}
