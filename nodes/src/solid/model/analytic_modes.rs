//! Computed frequencies beside those of theory, as a node.

use super::analytic::{AnalyticMode, bar, plate, sphere};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::plot::{Chart, Line};
use crate::table::ResultTable;
use crate::{params, ports};

params! {
    /// Frequencies of a bar, a plate and a ball by the elements of `ModalAnalysis`, beside those of theory.
    ///
    /// A steel bar of 200 x 20 x 20 mm has the bending modes of Timoshenko's theory, a free plate of 200 x 200 x 2 mm those of thin plates,
    /// and a ball of 50 mm radius those of elasticity, each with its multiplicity. `bound` is the difference that is accepted at 4, 24 and 12
    /// cells. The defaults are coarser.
    ///
    /// # Source
    /// Timoshenko (Phil. Mag. 41, 1921); Leissa (J. Sound Vib. 31, 1973); Lamb (Proc. London Math. Soc. 13, 1881).
    pub struct AnalyticModesParams {
        /// Cells across the bar.
        bar: usize = 2, unit "", range 2..=16;
        /// Cells along an edge of the plate.
        plate: usize = 12, unit "", range 4..=100;
        /// Cells across the ball, an even number.
        ball: usize = 6, unit "", range 4..=40;
    }
}
ports! {
    pub struct AnalyticModesPorts / AnalyticModesIo {
        in {}
        out {
            /// A row for each frequency of theory.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`bar`], [`plate`] and [`sphere`].
#[derive(Debug)]
pub struct AnalyticModes;

impl Func for AnalyticModes {
    type Params = AnalyticModesParams;
    type Ports = AnalyticModesPorts;
    const NAME: &'static str = "AnalyticModes";

    fn eval(p: &AnalyticModesParams, _: &Build<'_>, mut io: AnalyticModesIo<'_>) -> Result<Summary, Fault> {
        let fault = |e: super::super::fem::eigen::EigenError| Fault::new("F078", e.to_string());
        let objects =
            [bar(p.bar).map_err(fault)?, plate(p.plate).map_err(fault)?, sphere(p.ball).map_err(fault)?];
        let all: Vec<AnalyticMode> = objects.into_iter().flatten().collect();
        let mut table = ResultTable::new(&[
            "object",
            "mode",
            "multiplicity",
            "theory_hz",
            "lowest_hz",
            "highest_hz",
            "largest_difference_percent",
            "bound_percent",
            "within",
        ]);
        for mode in &all {
            let difference = mode.difference();
            table.push([
                mode.object.into(),
                mode.kind.as_str().into(),
                mode.count.into(),
                mode.theory_hz.into(),
                mode.computed_hz[0].into(),
                mode.computed_hz[1].into(),
                (100.0 * difference).into(),
                (100.0 * mode.bound).into(),
                if difference.abs() <= mode.bound { "yes" } else { "no" }.into(),
            ]);
        }
        let lines = all.chunk_by(|a, b| a.object == b.object).map(|modes| {
            let points = modes.iter().map(|m| [m.theory_hz, 100.0 * m.difference()]).collect();
            Line::dots(modes[0].object, points)
        });
        let axes = (("frequency by theory, Hz", true), ("computed - theory, %", false));
        table.charts = vec![Chart::of("Frequencies by finite elements", axes.0, axes.1, lines.collect())];
        let within = all.iter().filter(|m| m.difference().abs() <= m.bound).count();
        io.table.set(table);
        Ok(vec![("within_their_bounds", format!("{within} of {}", all.len()).into())])
    }

    fn trial(rng: &mut Rng) -> (AnalyticModesParams, MemoryFiles) {
        let p = AnalyticModesParams { bar: 2, plate: 4 + rng.below(3), ball: 4 };
        (p, MemoryFiles::default())
    }
}
