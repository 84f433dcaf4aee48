//! A warp from its file, as a node.

use super::warp::Warp;
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
    /// A warp from a file: JSON as a tap of `TpsFit` writes it.
    ///
    /// Its `content` is a digest of all else that it holds; a warp that was changed by hand under it is refused, one without it is
    /// taken as it is.
    pub struct WarpFileParams {
        /// The file.
        path: AssetPath;
    }
}
ports! {
    pub struct WarpFilePorts / WarpFileIo {
        in {}
        out {
            /// The warp.
            warp: Value<Warp>,
        }
    }
}

/// The node `WarpFile`.
#[derive(Debug)]
pub struct WarpFile;

fn read_warp(path: &str, bytes: &[u8]) -> Result<Warp, Reject> {
    let wrong = |message: String| Reject::new("F111", format!("{path:?}: {message}")).at("path");
    let warp: Warp = serde_json::from_slice(bytes).map_err(|e| wrong(format!("this is no warp: {e}")))?;
    warp.fault().or_else(|| warp.altered()).map_or(Ok(warp), |fault| Err(wrong(fault)))
}

impl Func for WarpFile {
    type Params = WarpFileParams;
    type Ports = WarpFilePorts;
    const NAME: &'static str = "WarpFile";
    const VERSION: u32 = 5;

    fn check(p: &WarpFileParams, s: &mut Shape<'_, '_, WarpFilePorts>) -> Result<(), Reject> {
        read_warp(&p.path.0, &s.bytes("path", &p.path.0)?).map(|_| ())
    }

    fn eval(p: &WarpFileParams, cx: &Build<'_>, mut io: WarpFileIo<'_>) -> Result<Summary, Fault> {
        let warp = read_warp(&p.path.0, &cx.bytes("path", &p.path.0)?)?;
        let summary = warp.summary();
        io.warp.set(warp);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (WarpFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        // Writing to a vector does not fail.
        files.insert("trial.warp", serde_json::to_vec(&<Warp as Data>::trial(rng)).unwrap_or_default());
        (WarpFileParams { path: "trial.warp".into() }, files)
    }
}
