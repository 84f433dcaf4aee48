//! The file of a model of patterns.

use super::model::{ModelError, PatternModel};
use crate::artefact::sealed::{seal_value, unseal_value};
use crate::artefact::value_file::Artefact;
use crate::core::node::Summary;

/// The first bytes of a file of a model.
const MAGIC: &[u8] = b"foley:FSTA\n";
/// Version of the format.
const VERSION: u32 = 1;

impl PatternModel {
    /// The model as one file: a signature, the version, a digest, and the fields.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn to_bytes(&self) -> Result<Vec<u8>, String> {
        seal_value(MAGIC, VERSION, self)
    }

    /// The model in such a file.
    ///
    /// # Errors
    /// Other files, other versions, damage.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let other = |found| ModelError::Version { found, wanted: VERSION };
        let model: Self = unseal_value((MAGIC, VERSION), "pattern statistics", bytes, other)?;
        model.validate().map_err(|e| e.to_string())?;
        Ok(model)
    }
}

impl Artefact for PatternModel {
    const CODE: &'static str = "F151";
    const HELP: Option<&'static str> = Some("write one with --tap model=FILE.bin");
    const MAGIC: &'static [u8] = MAGIC;

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        Self::from_bytes(bytes)
    }

    fn summary(&self) -> Summary {
        self.figures()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::random::Rng;

    #[test]
    fn a_file_returns_the_same_model() {
        let model = PatternModel::trial(&mut Rng::new(3));
        assert_eq!(PatternModel::from_bytes(&model.to_bytes().unwrap()).unwrap(), model);
    }

    #[test]
    fn damaged_cut_and_foreign_files_are_refused() {
        let model = PatternModel::trial(&mut Rng::new(4));
        let bytes = model.to_bytes().unwrap();
        let error = |bytes: &[u8]| PatternModel::from_bytes(bytes).unwrap_err();
        assert!(error(b"RIFF").contains("no file of pattern statistics"));
        assert!(error(&bytes[..bytes.len() - 1]).contains("digest"));
        let mut version = bytes.clone();
        version[MAGIC.len()] = 9;
        assert!(error(&version).contains("version 9"));
        for (field, damaged) in [
            ("intervals", PatternModel { intervals: vec![3.0, f64::NAN], ..model.clone() }),
            ("levels", PatternModel { levels: vec![1.0, 0.0], ..model.clone() }),
            ("persistence", PatternModel { persistence: 1.5, ..model.clone() }),
            ("cluster_levels", PatternModel { cluster_levels: Vec::new(), ..model.clone() }),
            ("transitions", PatternModel { transitions: vec![1.0], ..model.clone() }),
            ("envelope", PatternModel { envelope: Vec::new(), ..model.clone() }),
            ("rate", PatternModel { rate: 0.0, ..model.clone() }),
        ] {
            let e = error(&damaged.to_bytes().unwrap());
            assert!(e.contains(field), "{e}");
        }
    }
}
