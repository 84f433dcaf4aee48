//! A calibration from a file, as a value node.

use super::calibration::{EnergyCalibration, calibration_summary};
use crate::artefact::value_file::{Artefact, from_json};
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for EnergyCalibration {
    const CODE: &'static str = "F106";

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        let calibration: Self = from_json(bytes)?;
        calibration.validate().map_err(|e| e.to_string())?;
        calibration.altered().map_or(Ok(calibration), Err)
    }

    fn summary(&self) -> Summary {
        calibration_summary(self)
    }
}

artefact_file! {
    /// Reads a calibration from a file that a tap of `EnergyCalibration` wrote.
    ///
    /// The file is JSON with every field. A file of another version or one that was changed by hand is refused, and the
    /// message names the field.
    pub struct EnergyCalibrationFile / EnergyCalibrationFileParams / EnergyCalibrationFilePorts / EnergyCalibrationFileIo, version 3;
    /// File of the calibration.
    path: "take.json";
    /// The calibration.
    calibration: EnergyCalibration;
}
