//! A friction model from a file, as a value node.

use super::friction_model::FrictionModel;
use super::report::model_summary;
use crate::artefact::value_file::{Artefact, from_json};
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for FrictionModel {
    const CODE: &'static str = "F076";

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        let model: Self = from_json(bytes)?;
        model.validate().map_err(|e| e.to_string())?;
        Ok(model)
    }

    fn summary(&self) -> Summary {
        model_summary(self)
    }
}

artefact_file! {
    /// Reads a friction model from a file that a tap of a model wrote.
    ///
    /// The file is JSON with every field of the model: version, speeds, spectra and conventions. A file of another
    /// version is refused.
    pub struct FrictionModelFile / FrictionModelFileParams / FrictionModelFilePorts / FrictionModelFileIo, version 2;
    /// File of the model.
    path: "model.json";
    /// The friction model.
    model: FrictionModel;
}
