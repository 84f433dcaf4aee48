//! The node `CurveOut`.

use super::curve::MotionCurve;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::params::OutPath;
use crate::core::ports::Value;
use crate::core::shape::{Build, Shape};
use crate::io::text_output::TextOutput;
use crate::{params, ports};
use std::fmt::Write;

params! {
    /// Writes a motion as CSV, which `CurveFile` reads: `time_s`, and a column for each channel. Gaps are empty.
    pub struct CurveOutParams {
        /// The file, such as `frames.csv`.
        path: OutPath;
    }
}
ports! {
    pub struct CurveOutPorts / CurveOutIo {
        in {
            /// The motion.
            curve: Value<MotionCurve>,
        }
        out {}
    }
}

/// A curve as CSV.
fn csv(curve: &MotionCurve) -> String {
    let mut text = String::from("time_s");
    for c in 0..curve.channels {
        // Writing to a string cannot fail.
        let _ = write!(text, ",channel_{c}");
    }
    text.push('\n');
    let mut gaps = curve.gaps.iter().peekable();
    for k in 0..curve.frames() {
        while gaps.next_if(|(_, to)| *to <= k).is_some() {}
        let is_gap = gaps.peek().is_some_and(|(from, _)| *from <= k);
        let _ = write!(text, "{}", k as f64 / curve.rate);
        for x in curve.frame(k) {
            let _ = if is_gap { write!(text, ",") } else { write!(text, ",{x}") };
        }
        text.push('\n');
    }
    text
}

/// The node that writes a [`MotionCurve`].
#[derive(Debug)]
pub struct CurveOut {
    file: TextOutput,
    text: String,
}

impl Node for CurveOut {
    type Params = CurveOutParams;
    type Ports = CurveOutPorts;
    const NAME: &'static str = "CurveOut";
    const CLASS: Class = Class::Offline;

    fn shape(_: &CurveOutParams, s: &mut Shape<'_, '_, CurveOutPorts>) -> Result<(), Reject> {
        s.ends(Some(0));
        Ok(())
    }

    fn build(p: &CurveOutParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let curve = cx.value(CurveOutPorts::curve);
        curve.validate().map_err(|e| Fault::new("F157", e.to_string()).at("curve"))?;
        Ok(Self { file: TextOutput::create(cx, "path", &p.path)?, text: csv(&curve) })
    }

    fn run(&mut self, _: CurveOutIo<'_>) -> Result<(), Fault> {
        Ok(())
    }

    fn finish(&mut self, _: CurveOutIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Summary::new();
        self.file.write(&self.text, &mut summary)?;
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve_table::read_curve_table;
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let nan = f32::NAN;
        let curve = MotionCurve::with_gaps(4.0, 2, vec![1.5, 2.0, nan, 3.0, -1e-7, 4.0]);
        let text = csv(&curve);
        assert_eq!(text, "time_s,channel_0,channel_1\n0,1.5,2\n0.25,,\n0.5,-0.0000001,4\n");
        let table = read_curve_table(text.as_bytes(), "").unwrap();
        assert_eq!((table.at(0, 0.0), table.at(1, 0.5)), (1.5, 4.0));
    }
}
