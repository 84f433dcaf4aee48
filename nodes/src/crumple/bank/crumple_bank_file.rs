//! A bank from a file, as a value node.

use super::crumple_bank::{CrumpleBank, trial_bank};
use super::report::bank_summary;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// Reads a bank of micro-sounds from a file that a tap of `CrumpleExtractor` wrote.
    ///
    /// The file is JSON with every field of the bank: version, samples, energies and parameters of the extraction. A
    /// file of another version or one that was changed by hand is refused, and the message names the field.
    pub struct CrumpleBankFileParams {
        /// File of the bank.
        path: AssetPath;
    }
}
ports! {
    pub struct CrumpleBankFilePorts / CrumpleBankFileIo {
        in {}
        out {
            /// The bank.
            bank: Value<CrumpleBank>,
        }
    }
}

/// Reads a [`CrumpleBank`] from JSON.
#[derive(Debug)]
pub struct CrumpleBankFile;

fn parse(path: &str, bytes: &[u8]) -> Result<CrumpleBank, Reject> {
    let wrong = |what: String| Reject::new("F106", format!("{path:?}: {what}")).at("path");
    let bank: CrumpleBank = serde_json::from_slice(bytes)
        .map_err(|e| wrong(format!("this is no bank of crumple samples: {e}")))?;
    bank.validate().map_err(|e| wrong(e.to_string()))?;
    bank.altered().map_or(Ok(bank), |fault| Err(wrong(fault)))
}

impl Func for CrumpleBankFile {
    type Params = CrumpleBankFileParams;
    type Ports = CrumpleBankFilePorts;
    const NAME: &'static str = "CrumpleBankFile";
    const VERSION: u32 = 2;

    fn check(p: &CrumpleBankFileParams, s: &mut Shape<'_, '_, CrumpleBankFilePorts>) -> Result<(), Reject> {
        parse(&p.path.0, &s.bytes("path", &p.path.0)?).map(|_| ())
    }

    fn eval(
        p: &CrumpleBankFileParams,
        cx: &Build<'_>,
        mut io: CrumpleBankFileIo<'_>,
    ) -> Result<Summary, Fault> {
        let bank = parse(&p.path.0, &cx.bytes("path", &p.path.0)?)?;
        let summary = bank_summary(&bank);
        io.bank.set(bank);
        Ok(summary)
    }

    fn trial(_: &mut Rng) -> (CrumpleBankFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("bank.json", serde_json::to_vec(&trial_bank()).unwrap_or_default());
        (CrumpleBankFileParams { path: "bank.json".into() }, files)
    }
}
