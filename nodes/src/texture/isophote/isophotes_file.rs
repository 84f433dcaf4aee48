//! Isophotes from a file, as a value node.

use super::code::{decode_isophotes, encode_isophotes};
use super::curves::Isophotes;
use super::value::summary;
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
    /// Reads isophotes from a file, as a tap of `Isophotes` writes it, so that no image is needed.
    pub struct IsophotesFileParams {
        /// The file.
        path: AssetPath;
    }
}
ports! {
    pub struct IsophotesFilePorts / IsophotesFileIo {
        in {}
        out {
            /// The isophotes.
            isophotes: Value<Isophotes>,
        }
    }
}

/// The node over [`decode_isophotes`].
#[derive(Debug)]
pub struct IsophotesFile;

impl Func for IsophotesFile {
    type Params = IsophotesFileParams;
    type Ports = IsophotesFilePorts;
    const NAME: &'static str = "IsophotesFile";

    fn check(p: &IsophotesFileParams, s: &mut Shape<'_, '_, IsophotesFilePorts>) -> Result<(), Reject> {
        let bytes = s.bytes("path", &p.path.0)?;
        decode_isophotes(&bytes).map(|_| ()).map_err(|e| wrong(&p.path.0, &e))
    }

    fn eval(p: &IsophotesFileParams, cx: &Build<'_>, mut io: IsophotesFileIo<'_>) -> Result<Summary, Fault> {
        let found = decode_isophotes(&cx.bytes("path", &p.path.0)?).map_err(|e| wrong(&p.path.0, &e))?;
        let summary = summary(&found);
        io.isophotes.set(found);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (IsophotesFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("texture.isophotes", encode_isophotes(&Isophotes::trial(rng)));
        (IsophotesFileParams { path: AssetPath("texture.isophotes".into()) }, files)
    }
}

fn wrong(path: &str, what: &str) -> Reject {
    let help = "a tap of `Isophotes` to a file that ends with .bin writes one";
    Reject::new("F126", format!("{path:?}: {what}")).at("path").help(help)
}

#[cfg(test)]
mod tests {
    use super::*;
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
