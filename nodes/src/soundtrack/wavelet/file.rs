//! The file of a texture model.

use super::model::TextureModel;
use crate::artefact::sealed::{seal_value, unseal_value};
use crate::artefact::value_file::Artefact;
use crate::core::node::Summary;

/// The first bytes of a file of a texture model.
const MAGIC: &[u8] = b"foley:TXMD\n";
/// Version of the format.
const VERSION: u32 = 1;

impl TextureModel {
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
        let other = |found| format!("the texture model has version {found}; this reads version {VERSION}");
        unseal_value((MAGIC, VERSION), "texture models", bytes, other)
    }

    /// Figures for the summary of a run.
    #[must_use]
    pub fn figures(&self) -> Summary {
        let tree = &self.tree;
        let seconds: f64 = tree.sources.iter().map(|s| s.frames as f64 / tree.rate).sum();
        vec![
            ("recordings", tree.sources.len().into()),
            ("seconds", seconds.into()),
            ("levels", tree.depth.into()),
            ("roots", tree.roots().into()),
            ("block_s", (tree.span(0) as f64 / tree.rate).into()),
            ("threshold", self.thresholds.last().copied().unwrap_or(0.0).into()),
        ]
    }
}

impl Artefact for TextureModel {
    const CODE: &'static str = "F155";
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
    fn a_file_returns_the_same_model_and_others_are_refused() {
        let model = TextureModel::trial(&mut Rng::new(3));
        let bytes = model.to_bytes().unwrap();
        assert_eq!(TextureModel::from_bytes(&bytes).unwrap(), model);
        let error = |bytes: &[u8]| TextureModel::from_bytes(bytes).unwrap_err();
        assert!(error(b"RIFF").contains("no file of texture models"));
        assert!(error(&bytes[..bytes.len() - 1]).contains("digest"));
        let mut version = bytes.clone();
        version[MAGIC.len()] = 9;
        assert!(error(&version).contains("version 9"));
        let mut tree = model.clone();
        tree.tree.details[2][0] = f32::NAN;
        assert!(error(&tree.to_bytes().unwrap()).contains("damaged"));
    }
}
