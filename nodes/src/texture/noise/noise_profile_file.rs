//! Noise profiles as files, and the node that reads them.
//!
//! A file holds, little endian: `fNOI`; version and part, one byte each; samples and factor of the detail in 32 bits each (a factor of 1
//! for none); seed of the detail and spacing in m in 64 bits each; the samples as 16-bit floats.

use super::detail::MAX_EXTENDED;
use super::profile::stored;
use crate::artefact::value_file::Artefact;
use crate::artefact_file;
use crate::core::node::Summary;
use crate::texture::maps::{Detail, NoisePart, NoiseProfile};
use half::f16;

/// First bytes of a file.
const MAGIC: &[u8; 4] = b"fNOI";
const VERSION: u8 = 1;

/// Writes a profile, without its detail, as bytes.
#[must_use]
pub fn encode_profile(profile: &NoiseProfile) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    let Detail { factor, seed } = profile.detail.unwrap_or(Detail { factor: 1, seed: 0 });
    out.extend_from_slice(&[VERSION, u8::from(profile.part == NoisePart::Detail)]);
    out.extend_from_slice(&u32::try_from(profile.samples.len()).unwrap_or(u32::MAX).to_le_bytes());
    out.extend_from_slice(&factor.to_le_bytes());
    out.extend_from_slice(&seed.to_le_bytes());
    out.extend_from_slice(&profile.spacing.to_le_bytes());
    out.extend(profile.samples.iter().flat_map(|x| stored(*x).to_le_bytes()));
    out
}

/// Reads a profile from bytes.
///
/// # Errors
/// A message with the defect.
pub fn decode_profile(bytes: &[u8]) -> Result<NoiseProfile, String> {
    let rest =
        bytes.strip_prefix(MAGIC).ok_or("this is not a noise profile: it does not begin with `fNOI`")?;
    let (header, code) = rest.split_first_chunk::<26>().ok_or("it ends in its header")?;
    if header[0] != VERSION {
        return Err(format!("version {}; this foley reads version {VERSION}", header[0]));
    }
    let word = |at: usize| [0, 1, 2, 3].map(|k| header[at + k]);
    let double = |at: usize| [0, 1, 2, 3, 4, 5, 6, 7].map(|k| header[at + k]);
    let part = match header[1] {
        0 => NoisePart::Whole,
        1 => NoisePart::Detail,
        part => return Err(format!("it has part {part}; 0 is the whole, 1 the detail")),
    };
    let (count, factor) = (u32::from_le_bytes(word(2)) as usize, u32::from_le_bytes(word(6)));
    let (seed, spacing) = (u64::from_le_bytes(double(10)), f64::from_le_bytes(double(18)));
    if code.len() != 2 * count {
        return Err(format!("it is damaged: {} bytes for {count} samples of 2 bytes", code.len()));
    }
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Err(format!("it has a sample every {spacing} m"));
    }
    if factor == 0 || count.saturating_mul(factor as usize) > MAX_EXTENDED && factor > 1 {
        return Err(format!(
            "its {count} samples with detail of factor {factor} are more than {MAX_EXTENDED}"
        ));
    }
    let samples: Vec<f32> =
        code.as_chunks().0.iter().map(|pair| f16::from_le_bytes(*pair).to_f32()).collect();
    if let Some(k) = samples.iter().position(|x| !x.is_finite()) {
        return Err(format!("sample {k} is {}", samples[k]));
    }
    let detail = Some(Detail { factor, seed }).filter(|detail| detail.factor > 1);
    Ok(NoiseProfile { samples, spacing, detail, part })
}

impl Artefact for NoiseProfile {
    const CODE: &'static str = "F112";
    const HELP: Option<&'static str> =
        Some("a tap of `profile` of `NoiseProfile` to a file that ends with .bin writes one");

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        decode_profile(bytes)
    }

    fn summary(&self) -> Summary {
        vec![
            ("samples", self.samples.len().into()),
            ("spacing_m", self.spacing.into()),
            ("detail_factor", self.detail.map_or(1, |detail| u64::from(detail.factor)).into()),
        ]
    }
}

artefact_file! {
    /// Reads a noise profile from a file, as a tap of `NoiseProfile` writes it, so that no image is needed.
    ///
    /// The file holds the profile without its detail, which is added again, the same to the bit.
    pub struct NoiseProfileFile / NoiseProfileFileParams / NoiseProfileFilePorts / NoiseProfileFileIo, version 1;
    /// The file.
    path: "surface.noise.bin";
    /// The profile.
    profile: NoiseProfile;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_files_are_refused_with_their_defect() {
        let profile = NoiseProfile {
            samples: vec![0.5; 100],
            spacing: 0.001,
            detail: Some(Detail { factor: 16, seed: 77 }),
            part: NoisePart::Detail,
        };
        let good = encode_profile(&profile);
        assert_eq!(decode_profile(&good).unwrap(), profile);
        let damaged = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            decode_profile(&bytes).unwrap_err()
        };
        assert!(damaged(0, b'x').contains("fNOI"));
        assert!(damaged(4, 9).contains("version 9"));
        assert!(damaged(5, 7).contains("part 7"));
        assert!(damaged(6, 99).contains("damaged"));
        assert!(damaged(13, 9).contains("factor"));
        assert!(damaged(29, 0xff).contains("every"));
        assert!(damaged(31, 0x7c).contains("sample 0"));
        assert!(decode_profile(&good[..20]).unwrap_err().contains("header"));
        assert!(decode_profile(&good[..good.len() - 1]).unwrap_err().contains("damaged"));
    }
}
