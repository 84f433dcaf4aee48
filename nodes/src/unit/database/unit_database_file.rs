//! A unit database from its file, as a node.

use super::file::MARK;
use super::units::{UnitDatabase, database_summary};
use crate::artefact::value_file::Artefact;
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for UnitDatabase {
    const CODE: &'static str = "F101";
    const HELP: Option<&'static str> = Some("write one with --tap database=FILE.bin");
    const MAGIC: &'static [u8] = MARK;

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        Self::from_bytes(bytes)
    }

    fn summary(&self) -> Summary {
        database_summary(self)
    }
}

artefact_file! {
    /// A unit database from a file that a tap of `UnitDatabase` wrote: `--tap database=cotton.bin`.
    ///
    /// It holds the audio, the features and their conventions, so that the recordings are not needed. A file of another version
    /// or with damage is an error.
    pub struct UnitDatabaseFile / UnitDatabaseFileParams / UnitDatabaseFilePorts / UnitDatabaseFileIo, version 3;
    /// The database.
    path: "units.bin";
    /// The units.
    database: UnitDatabase;
}
