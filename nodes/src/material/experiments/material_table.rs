//! Dampings of materials beside each other, as a node.

use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::{Many, Value};
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::material::Material;
use crate::material::estimation::report::{AtFrequency, REPORTED_HZ};
use crate::plot::{Chart, Line};
use crate::table::{Cell, ResultTable};
use crate::{params, ports};
use std::f64::consts::TAU;

/// Number of points of a curve.
const STEPS: usize = 60;
/// Range of the chart, Hz.
const BAND: [f64; 2] = [50.0, 20_000.0];

params! {
    /// Damping parameters of materials beside each other, with the corresponding decay times, and their curves over frequency.
    ///
    /// Each row is one material: its parameters in the convention of `c` (1/s, s, s^(2 g3 - 1)), and the time of a decay by 60 dB at 100,
    /// 300, 1000, 3000 and 10,000 Hz, which can be compared across models.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), table 1.
    pub struct MaterialTableParams {}
}
ports! {
    pub struct MaterialTablePorts / MaterialTableIo {
        in {
            /// The materials, one row each.
            materials: Many<Value<Material>>,
        }
        out {
            /// Parameters and decay times.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`material_table`].
#[derive(Debug)]
pub struct MaterialTable;

/// The table of materials.
#[must_use]
pub fn material_table(materials: &[&Material]) -> ResultTable {
    let t60 = REPORTED_HZ.map(|f| format!("t60_s_at_{f}_hz"));
    let head = ["material", "parameters"].into_iter().chain(t60.iter().map(String::as_str));
    let mut table = ResultTable::new(&head.collect::<Vec<_>>());
    let mut lines = Vec::new();
    for material in materials {
        let model = &material.damping;
        let named = model.names().into_iter().zip(model.parameters());
        let parameters: Vec<String> =
            named.map(|(name, value)| format!("{name} = {}", Cell::from(value).text())).collect();
        let at = REPORTED_HZ.map(|f| Cell::from(AtFrequency::of(model, f, None).t60));
        table.push([material.name.as_str().into(), parameters.join(", ").into()].into_iter().chain(at));
        let frequency = |k: usize| BAND[0] * libm::pow(BAND[1] / BAND[0], k as f64 / STEPS as f64);
        let curve = (0..=STEPS).map(frequency).map(|f| [f, model.c((TAU * f).powi(2))]);
        lines.push(Line::new(material.name.as_str(), curve.collect()));
    }
    let axes = (("natural frequency, Hz", true), ("damping c, 1/s", true));
    table.charts = vec![Chart::of("Damping of materials", axes.0, axes.1, lines)];
    table
}

impl Func for MaterialTable {
    type Params = MaterialTableParams;
    type Ports = MaterialTablePorts;
    const NAME: &'static str = "MaterialTable";
    const VERSION: u32 = 2;

    fn eval(_: &MaterialTableParams, _: &Build<'_>, mut io: MaterialTableIo<'_>) -> Result<Summary, Fault> {
        let materials: Vec<&Material> = io.materials.iter().collect();
        let summary = vec![("materials", materials.len().into())];
        let table = material_table(&materials);
        io.table.set(table);
        Ok(summary)
    }

    fn trial(_: &mut Rng) -> (MaterialTableParams, MemoryFiles) {
        (MaterialTableParams {}, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::DampingModel;

    #[test]
    fn a_row_has_the_parameters_and_the_decay_times() {
        let rayleigh = DampingModel::Rayleigh { a1: 3.9, a2: 1e-8 };
        let table = material_table(&[&Material::new("porcelain", rayleigh)]);
        let csv = table.csv();
        // c = 3.9 + 1e-8 (2 pi 10000)^2 = 43.4 1/s, T60 = 13.8 / c.
        assert!(
            csv.contains("porcelain,\"a1 = 3.90000, a2 = 1.00000e-8\"") && csv.contains(",0.318"),
            "{csv}"
        );
        assert!(csv.starts_with("material,parameters,t60_s_at_100_hz,"));
    }
}
