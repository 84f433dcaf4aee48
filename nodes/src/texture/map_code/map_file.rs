//! Coded maps from files, as a value node.

use super::code::CodedMap;
use super::file::{decode_map, encode_map};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Data;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// Reads a coded map from a file, as a tap of `coded` of `MapCoder` writes it, so that no image is needed.
    ///
    /// `MapExcitation` plays it by its input `coded`.
    pub struct MapFileParams {
        /// The file.
        path: AssetPath;
    }
}
ports! {
    pub struct MapFilePorts / MapFileIo {
        in {}
        out {
            /// The code.
            coded: Value<CodedMap>,
        }
    }
}

/// The node over [`decode_map`].
#[derive(Debug)]
pub struct MapFile;

impl Func for MapFile {
    type Params = MapFileParams;
    type Ports = MapFilePorts;
    const NAME: &'static str = "MapFile";

    fn check(p: &MapFileParams, s: &mut Shape<'_, '_, MapFilePorts>) -> Result<(), Reject> {
        let bytes = s.bytes("path", &p.path.0)?;
        decode_map(&bytes).map(|_| ()).map_err(|e| wrong(&p.path.0, &e))
    }

    fn eval(p: &MapFileParams, cx: &Build<'_>, mut io: MapFileIo<'_>) -> Result<Summary, Fault> {
        let map = decode_map(&cx.bytes("path", &p.path.0)?).map_err(|e| wrong(&p.path.0, &e))?;
        let summary: Summary = vec![
            ("columns", map.width.into()),
            ("rows", map.height.into()),
            ("bytes", map.bytes.len().into()),
            ("scale", map.scale.into()),
        ];
        io.coded.set(map);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (MapFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("surface.map.bin", encode_map(&CodedMap::trial(rng)));
        (MapFileParams { path: AssetPath("surface.map.bin".into()) }, files)
    }
}

fn wrong(path: &str, what: &str) -> Reject {
    let help = "a tap of `coded` of `MapCoder` to a file that ends with .bin writes one";
    Reject::new("F112", format!("{path:?}: {what}")).at("path").help(help)
}

#[cfg(test)]
mod tests {
    use super::*;
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
