//! The file of a grain dictionary.

use super::coding::{Coding, DENSEST, decode, flac};
use super::error::{GRAINS_VERSION, GrainError};
use super::grains::GrainDictionary;
use crate::artefact::sealed::{seal, unseal};
use crate::artefact::value_file::Artefact;
use crate::core::node::Summary;
use std::borrow::Cow;

/// Version of files before there were tracks, the last of the fields.
const WITHOUT_TRACKS: u32 = 2;

/// The first bytes of a file of a dictionary.
const MAGIC: &[u8] = b"foley:FGRN\n";

impl GrainDictionary {
    /// The dictionary as one file: a signature, the version, a digest, the fields, and the samples as 32-bit floats, or as integers of up to 16 bits in a FLAC
    /// stream.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn to_bytes(&self) -> Result<Vec<u8>, String> {
        let fields = postcard::to_allocvec(&self.clone_without_samples()).map_err(|e| e.to_string())?;
        let mut body = (fields.len() as u64).to_le_bytes().to_vec();
        body.extend(fields);
        if self.bits == 0 {
            body.push(Coding::Float as u8);
            self.samples.iter().for_each(|x| body.extend(x.to_le_bytes()));
            return Ok(seal(MAGIC, self.version, &body));
        }
        let mut integers = vec![0_i16; self.samples.len()];
        for (span, step) in self.steps_of_samples().into_iter().filter(|(_, step)| *step > 0.0) {
            let scaled = |x: &f32| (x / step).round().clamp(-32_767.0, 32_767.0) as i16;
            integers[span.clone()].iter_mut().zip(&self.samples[span]).for_each(|(y, x)| *y = scaled(x));
        }
        if let Some(stream) = flac(&integers) {
            body.push(Coding::Flac as u8);
            body.extend(stream);
        } else {
            body.push(Coding::Integer as u8);
            integers.iter().for_each(|x| body.extend(x.to_le_bytes()));
        }
        Ok(seal(MAGIC, self.version, &body))
    }

    fn clone_without_samples(&self) -> Self {
        Self {
            samples: Vec::new(),
            sources: self.sources.clone(),
            grains: self.grains.clone(),
            runs: self.runs.clone(),
            steps: self.steps.clone(),
            tracks: self.tracks.clone(),
            ..*self
        }
    }

    /// Spans of all samples in order, with their steps.
    fn steps_of_samples(&self) -> Vec<(std::ops::Range<usize>, f32)> {
        let mut steps = self.steps.iter().copied();
        let mut spans = Vec::new();
        for (run, blocks) in self.runs.iter().zip(self.blocks()) {
            let of_run: Vec<f32> = steps.by_ref().take(blocks.len()).collect();
            for channel in 0..usize::from(run.channels) {
                let start = run.offset as usize + channel * run.frames as usize;
                spans.extend(
                    blocks.iter().zip(&of_run).map(|(b, step)| (start + b.start..start + b.end, *step)),
                );
            }
        }
        spans
    }

    /// The dictionary in such a file.
    ///
    /// # Errors
    /// Other files, other versions, damage.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let other = |found| GrainError::Version { found };
        let is_older =
            bytes.strip_prefix(MAGIC).is_some_and(|b| b.starts_with(&WITHOUT_TRACKS.to_le_bytes()));
        let version = if is_older { WITHOUT_TRACKS } else { GRAINS_VERSION };
        let body = unseal((MAGIC, version), "grains", bytes, other)?;
        let short = || "the grain dictionary is damaged: it is too short".to_owned();
        let damaged = |what: String| format!("the grain dictionary is damaged: {what}");
        let (head, rest) = body.split_at_checked(8).ok_or_else(short)?;
        let len = head.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
        let (fields, samples) = rest.split_at_checked(len).ok_or_else(short)?;
        // No tracks: a byte of 0.
        let fields = if is_older { Cow::from([fields, &[0]].concat()) } else { Cow::from(fields) };
        let mut all: Self = postcard::from_bytes(&fields).map_err(|e| damaged(e.to_string()))?;
        all.version = if is_older && all.version == WITHOUT_TRACKS { GRAINS_VERSION } else { all.version };
        let (coding, samples) = samples.split_first().ok_or_else(short)?;
        let coding = Coding::of(*coding).ok_or_else(|| damaged(format!("coding {coding}")))?;
        if (coding == Coding::Float) != (all.bits == 0) {
            return Err(damaged(format!("samples of {} bits coded as {coding:?}", all.bits)));
        }
        let wanted = all.runs.iter().map(|r| u64::from(r.frames) * u64::from(r.channels)).sum::<u64>();
        let bytes = samples.len() as u64;
        let fits = match coding {
            Coding::Float => bytes == 4 * wanted,
            Coding::Integer => bytes == 2 * wanted,
            Coding::Flac => wanted <= DENSEST * bytes,
        };
        if !fits {
            return Err(damaged(format!("{bytes} bytes for {wanted} samples")));
        }
        all.samples = vec![0.0; wanted as usize];
        // Spans of samples are those of valid fields only.
        all.validate().map_err(|e| e.to_string())?;
        if coding == Coding::Float {
            let values = samples.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            all.samples.iter_mut().zip(values).for_each(|(x, value)| *x = value);
        } else {
            let integers: Vec<i16> = match coding {
                Coding::Flac => decode(samples, wanted as usize).map_err(damaged)?,
                _ => samples.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect(),
            };
            for (span, step) in all.steps_of_samples() {
                let values = integers.get(span.clone()).into_iter().flatten();
                let into = all.samples.get_mut(span).into_iter().flatten();
                into.zip(values).for_each(|(x, value)| *x = f32::from(*value) * step);
            }
        }
        all.validate().map_err(|e| e.to_string())?;
        Ok(all)
    }
}

impl Artefact for GrainDictionary {
    const CODE: &'static str = "F150";
    const HELP: Option<&'static str> = Some("write one with --tap dictionary=FILE.bin");
    const MAGIC: &'static [u8] = MAGIC;

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        Self::from_bytes(bytes)
    }

    fn summary(&self) -> Summary {
        self.summary()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;

    #[test]
    fn files_return_the_same_dictionary_and_its_digest() {
        let rounded = GrainDictionary::trial(&mut Rng::new(3));
        let mut exact = GrainDictionary { bits: 0, ..rounded.clone() };
        exact.steps.clear();
        let mut coarse = rounded.clone();
        coarse.quantise(6);
        let size = |dictionary: &GrainDictionary| dictionary.to_bytes().unwrap().len();
        assert!(2 * size(&coarse) < size(&rounded) && size(&rounded) < size(&exact));
        for dictionary in [rounded, exact, coarse] {
            let bytes = dictionary.to_bytes().unwrap();
            let read = GrainDictionary::from_bytes(&bytes).unwrap();
            assert_eq!(read, dictionary);
            assert_eq!(read.id(), dictionary.id());
        }
    }

    #[test]
    fn damaged_cut_and_foreign_files_are_refused() {
        let bytes = GrainDictionary::trial(&mut Rng::new(4)).to_bytes().unwrap();
        let error = |bytes: &[u8]| GrainDictionary::from_bytes(bytes).unwrap_err();
        assert!(error(b"").contains("no file of grains"));
        assert!(error(&bytes[..bytes.len() - 1]).contains("damaged"));
        let mut changed = bytes.clone();
        *changed.last_mut().unwrap() ^= 1;
        assert!(error(&changed).contains("digest"));
        let mut version = bytes;
        version[MAGIC.len()] = 9;
        assert!(error(&version).contains("version 9"));
    }

    #[test]
    fn files_of_version_2_have_no_tracks() {
        let dictionary = GrainDictionary { tracks: None, ..GrainDictionary::trial(&mut Rng::new(5)) };
        let bytes = GrainDictionary { version: WITHOUT_TRACKS, ..dictionary.clone() }.to_bytes().unwrap();
        let body = unseal((MAGIC, WITHOUT_TRACKS), "grains", &bytes, |v| v).unwrap();
        let (head, rest) = body.split_at(8);
        let len = u64::from_le_bytes(head.try_into().unwrap());
        let (fields, samples) = rest.split_at(len as usize);
        let (last, older) = fields.split_last().unwrap();
        assert_eq!(*last, 0);
        let older = [&(len - 1).to_le_bytes(), older, samples].concat();
        let read = GrainDictionary::from_bytes(&seal(MAGIC, WITHOUT_TRACKS, &older)).unwrap();
        assert_eq!(read, dictionary);
    }
}
