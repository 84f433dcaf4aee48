//! A friction model from a file, as a value node.

use super::friction_model::FrictionModel;
use super::report::model_summary;
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
    /// Reads a friction model from a file that a tap of a model wrote.
    ///
    /// The file is JSON with every field of the model: version, speeds, spectra and conventions. A file of another
    /// version is refused.
    pub struct FrictionModelFileParams {
        /// File of the model.
        path: AssetPath;
    }
}

ports! {
    pub struct FrictionModelFilePorts / FrictionModelFileIo {
        in {}
        out {
            /// The friction model.
            model: Value<FrictionModel>,
        }
    }
}

/// Reads a [`FrictionModel`] from JSON.
#[derive(Debug)]
pub struct FrictionModelFile;

fn parse(bytes: &[u8]) -> Result<FrictionModel, Reject> {
    let wrong = |what: String| Reject::new("F076", what).at("path");
    let model: FrictionModel =
        serde_json::from_slice(bytes).map_err(|e| wrong(format!("this is no friction model: {e}")))?;
    model.validate().map_err(|e| wrong(e.to_string()))?;
    Ok(model)
}

impl Func for FrictionModelFile {
    type Params = FrictionModelFileParams;
    type Ports = FrictionModelFilePorts;
    const NAME: &'static str = "FrictionModelFile";
    const VERSION: u32 = 2;

    fn check(
        p: &FrictionModelFileParams,
        s: &mut Shape<'_, '_, FrictionModelFilePorts>,
    ) -> Result<(), Reject> {
        parse(&s.bytes("path", &p.path.0)?).map(|_| ())
    }

    fn eval(
        p: &FrictionModelFileParams,
        cx: &Build<'_>,
        mut io: FrictionModelFileIo<'_>,
    ) -> Result<Summary, Fault> {
        let model = parse(&cx.bytes("path", &p.path.0)?)?;
        let summary = model_summary(&model);
        io.model.set(model);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (FrictionModelFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert(
            "model.json",
            serde_json::to_vec(&<FrictionModel as Data>::trial(rng)).unwrap_or_default(),
        );
        (FrictionModelFileParams { path: "model.json".into() }, files)
    }
}
