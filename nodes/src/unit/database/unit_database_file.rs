//! A unit database from its file, as a node.

use std::io::Read;

use super::file::MARK;
use super::units::{UnitDatabase, database_summary};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// A unit database from a file, as a tap of `UnitDatabase` wrote it: `--tap database=cotton.bin`.
    ///
    /// It holds the audio, the features and their conventions, so that the recordings are not needed. A file of another version
    /// or with damage is an error.
    pub struct UnitDatabaseFileParams {
        /// The database.
        path: AssetPath;
    }
}

ports! {
    pub struct UnitDatabaseFilePorts / UnitDatabaseFileIo {
        in {}
        out {
            /// The units.
            database: Value<UnitDatabase>,
        }
    }
}

/// Reads a [`UnitDatabase`] from its file.
#[derive(Debug)]
pub struct UnitDatabaseFile;

impl Func for UnitDatabaseFile {
    type Params = UnitDatabaseFileParams;
    type Ports = UnitDatabaseFilePorts;
    const NAME: &'static str = "UnitDatabaseFile";
    const VERSION: u32 = 3;

    fn check(p: &UnitDatabaseFileParams, s: &mut Shape<'_, '_, UnitDatabaseFilePorts>) -> Result<(), Reject> {
        // The first bytes tell; all of them are read when it runs.
        let mut head = [0; MARK.len()];
        let read = s.open("path", &p.path.0)?.read_exact(&mut head);
        if read.is_ok() && head == MARK {
            return Ok(());
        }
        let message = format!("{:?} is no unit database", p.path.0);
        Err(Reject::new("F101", message).at("path").help("write one with --tap database=FILE.bin"))
    }

    fn eval(
        p: &UnitDatabaseFileParams,
        cx: &Build<'_>,
        mut io: UnitDatabaseFileIo<'_>,
    ) -> Result<Summary, Fault> {
        let bytes = cx.bytes("path", &p.path.0)?;
        let db = UnitDatabase::from_bytes(&bytes).map_err(|e| Fault::new("F101", e).at("path"))?;
        let summary = database_summary(&db);
        io.database.set(db);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (UnitDatabaseFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let db = <UnitDatabase as crate::core::item::Data>::trial(rng);
        files.insert("units.bin", db.to_bytes().unwrap_or_default());
        (UnitDatabaseFileParams { path: "units.bin".into() }, files)
    }
}
