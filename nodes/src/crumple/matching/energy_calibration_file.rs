//! A calibration from a file, as a value node.

use super::calibration::{EnergyCalibration, calibration_summary};
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
    /// Reads a calibration from a file that a tap of `EnergyCalibration` wrote.
    ///
    /// The file is JSON with every field. A file of another version or one that was changed by hand is refused, and the
    /// message names the field.
    pub struct EnergyCalibrationFileParams {
        /// File of the calibration.
        path: AssetPath;
    }
}
ports! {
    pub struct EnergyCalibrationFilePorts / EnergyCalibrationFileIo {
        in {}
        out {
            /// The calibration.
            calibration: Value<EnergyCalibration>,
        }
    }
}

/// Reads an [`EnergyCalibration`] from JSON.
#[derive(Debug)]
pub struct EnergyCalibrationFile;

fn parse(path: &str, bytes: &[u8]) -> Result<EnergyCalibration, Reject> {
    let wrong = |what: String| Reject::new("F106", format!("{path:?}: {what}")).at("path");
    let calibration: EnergyCalibration =
        serde_json::from_slice(bytes).map_err(|e| wrong(format!("this is no energy calibration: {e}")))?;
    calibration.validate().map_err(|e| wrong(e.to_string()))?;
    calibration.altered().map_or(Ok(calibration), |fault| Err(wrong(fault)))
}

impl Func for EnergyCalibrationFile {
    type Params = EnergyCalibrationFileParams;
    type Ports = EnergyCalibrationFilePorts;
    const NAME: &'static str = "EnergyCalibrationFile";
    const VERSION: u32 = 3;

    fn check(
        p: &EnergyCalibrationFileParams,
        s: &mut Shape<'_, '_, EnergyCalibrationFilePorts>,
    ) -> Result<(), Reject> {
        parse(&p.path.0, &s.bytes("path", &p.path.0)?).map(|_| ())
    }

    fn eval(
        p: &EnergyCalibrationFileParams,
        cx: &Build<'_>,
        mut io: EnergyCalibrationFileIo<'_>,
    ) -> Result<Summary, Fault> {
        let calibration = parse(&p.path.0, &cx.bytes("path", &p.path.0)?)?;
        let summary = calibration_summary(&calibration);
        io.calibration.set(calibration);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (EnergyCalibrationFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let calibration = serde_json::to_vec(&<EnergyCalibration as Data>::trial(rng));
        files.insert("take.json", calibration.unwrap_or_default());
        (EnergyCalibrationFileParams { path: "take.json".into() }, files)
    }
}
