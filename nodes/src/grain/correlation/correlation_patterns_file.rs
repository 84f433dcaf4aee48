//! Correlation patterns from their file, as a node.

use super::patterns::CorrelationPatterns;
use crate::artefact_file;

artefact_file! {
    /// Correlation patterns from a file that a tap of `GrainCorrelate` wrote: `--tap patterns=stone.patterns.bin`.
    ///
    /// They belong to the dictionary that they were made with. A file of another version or with damage is an error.
    pub struct CorrelationPatternsFile / CorrelationPatternsFileParams / CorrelationPatternsFilePorts / CorrelationPatternsFileIo, version 1;
    /// The patterns.
    path: "patterns.bin";
    /// The patterns.
    patterns: CorrelationPatterns;
}
