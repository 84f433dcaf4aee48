//! A model of patterns from its file, as a node.

use super::model::PatternModel;
use crate::artefact_file;

artefact_file! {
    /// A model of patterns from a file that a tap of `PatternStatistics` wrote: `--tap model=scrape.bin`.
    ///
    /// It belongs to the dictionary that it was made with. A file of another version or with damage is an error.
    pub struct PatternModelFile / PatternModelFileParams / PatternModelFilePorts / PatternModelFileIo, version 1;
    /// The model.
    path: "model.bin";
    /// The model.
    model: PatternModel;
}
