//! The node `TextureModelFile`.

use super::model::TextureModel;
use crate::artefact_file;

artefact_file! {
    /// Reads the model of a sound texture that a tap of a `TextureModel` has written.
    pub struct TextureModelFile / TextureModelFileParams / TextureModelFilePorts / TextureModelFileIo, version 1;
    /// The file.
    path: "rain.texture.bin";
    /// The model.
    model: TextureModel;
}
