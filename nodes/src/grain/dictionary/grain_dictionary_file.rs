//! A grain dictionary from its file, as a node.

use super::grains::GrainDictionary;
use crate::artefact_file;

artefact_file! {
    /// A grain dictionary from a file that a tap of `GrainDictionary` wrote: `--tap dictionary=stone.bin`.
    ///
    /// It holds the sound of all grains, so that the recordings are not needed. A file of another version or with damage is an error.
    pub struct GrainDictionaryFile / GrainDictionaryFileParams / GrainDictionaryFilePorts / GrainDictionaryFileIo, version 2;
    /// The dictionary.
    path: "grains.bin";
    /// The grains.
    dictionary: GrainDictionary;
}
