//! A bank from a file, as a value node.

use super::crumple_bank::CrumpleBank;
use super::report::bank_summary;
use crate::artefact::value_file::{Artefact, from_json};
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for CrumpleBank {
    const CODE: &'static str = "F106";

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        let bank: Self = from_json(bytes)?;
        bank.validate().map_err(|e| e.to_string())?;
        bank.altered().map_or(Ok(bank), Err)
    }

    fn summary(&self) -> Summary {
        bank_summary(self)
    }
}

artefact_file! {
    /// Reads a bank of micro-sounds from a file that a tap of `CrumpleExtractor` wrote.
    ///
    /// The file is JSON with every field of the bank: version, samples, energies and parameters of the extraction. A
    /// file of another version or one that was changed by hand is refused, and the message names the field.
    pub struct CrumpleBankFile / CrumpleBankFileParams / CrumpleBankFilePorts / CrumpleBankFileIo, version 2;
    /// File of the bank.
    path: "bank.json";
    /// The bank.
    bank: CrumpleBank;
}
