//! Coded maps from files, as a value node.

use super::code::CodedMap;
use super::file::decode_map;
use crate::artefact::value_file::Artefact;
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for CodedMap {
    const CODE: &'static str = "F112";
    const HELP: Option<&'static str> =
        Some("a tap of `coded` of `MapCoder` to a file that ends with .bin writes one");

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        decode_map(bytes)
    }

    fn summary(&self) -> Summary {
        vec![
            ("columns", self.width.into()),
            ("rows", self.height.into()),
            ("bytes", self.bytes.len().into()),
            ("scale", self.scale.into()),
        ]
    }
}

artefact_file! {
    /// Reads a coded map from a file, as a tap of `coded` of `MapCoder` writes it, so that no image is needed.
    ///
    /// `MapExcitation` plays it by its input `coded`.
    pub struct MapFile / MapFileParams / MapFilePorts / MapFileIo, version 1;
    /// The file.
    path: "surface.map.bin";
    /// The code.
    coded: CodedMap;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::fault::Fault;
    use crate::core::files::MemoryFiles;
    use crate::core::item::Data;
    use crate::core::params::AssetPath;
    use crate::core::random::Rng;
    use crate::core::standalone::Standalone;

    fn read(bytes: Vec<u8>) -> Result<CodedMap, Fault> {
        let mut files = MemoryFiles::default();
        files.insert("a.bin", bytes);
        let p = MapFileParams { path: AssetPath("a.bin".into()) };
        let mut standalone = Standalone::func::<MapFile>(p);
        standalone.files = files;
        Ok(standalone.run()?.value(0).unwrap().get::<CodedMap>().unwrap().clone())
    }

    #[test]
    fn files_of_a_tap_are_read_and_other_files_are_named() {
        let map = CodedMap::trial(&mut Rng::new(3));
        assert_eq!(read(map.file().unwrap()).unwrap(), map);
        let fault = read(b"fISO".to_vec()).unwrap_err();
        assert!(fault.code == "F112" && fault.message.contains("a.bin"), "{fault}");
    }
}
