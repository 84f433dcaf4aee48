//! Isophotes from a file, as a value node.

use super::code::decode_isophotes;
use super::curves::Isophotes;
use super::value::summary;
use crate::artefact::value_file::Artefact;
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for Isophotes {
    const CODE: &'static str = "F126";
    const HELP: Option<&'static str> = Some("a tap of `Isophotes` to a file that ends with .bin writes one");

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        decode_isophotes(bytes)
    }

    fn summary(&self) -> Summary {
        summary(self)
    }
}

artefact_file! {
    /// Reads isophotes from a file, as a tap of `Isophotes` writes it, so that no image is needed.
    pub struct IsophotesFile / IsophotesFileParams / IsophotesFilePorts / IsophotesFileIo, version 1;
    /// The file.
    path: "texture.isophotes";
    /// The isophotes.
    isophotes: Isophotes;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::files::MemoryFiles;
    use crate::core::params::AssetPath;
    use crate::core::standalone::Standalone;

    #[test]
    fn an_invalid_file_is_named() {
        let mut files = MemoryFiles::default();
        files.insert("a.bin", b"fISO".to_vec());
        let p = IsophotesFileParams { path: AssetPath("a.bin".into()) };
        let mut standalone = Standalone::func::<IsophotesFile>(p);
        standalone.files = files;
        let fault = standalone.run().err().unwrap();
        assert!(fault.code == "F126" && fault.message.contains("a.bin"), "{fault}");
    }
}
