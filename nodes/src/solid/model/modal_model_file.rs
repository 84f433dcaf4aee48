//! A modal model from a file, as a node.

use super::modal_model::{MARK, ModalModel};
use crate::artefact::value_file::Artefact;
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for ModalModel {
    const CODE: &'static str = "F078";
    const HELP: Option<&'static str> = Some("a tap of `model` of a ModalAnalysis writes one");
    const MAGIC: &'static [u8] = MARK;

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        Self::from_bytes(bytes)
    }

    fn summary(&self) -> Summary {
        Self::summary(self)
    }
}

artefact_file! {
    /// The modes of an object from a file that a tap of a `ModalAnalysis` wrote.
    ///
    /// An analysis takes seconds to minutes; its result can be stored, and be read without the mesh.
    pub struct ModalModelFile / ModalModelFileParams / ModalModelFilePorts / ModalModelFileIo, version 1;
    /// The file.
    path: "trial.modal-model.bin";
    /// The modes with their shapes.
    model: ModalModel;
}
