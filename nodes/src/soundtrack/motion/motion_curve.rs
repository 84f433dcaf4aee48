//! The node `MotionCurve`.

use super::curve::MotionCurve;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, params, ports};

params! {
    /// Collects a stream of numbers, such as the speed of a body, as a curve that can be searched and compared.
    ///
    /// Items that are not finite are gaps; those of up to 0.1 s are filled by a straight line.
    pub struct MotionCurveParams {}
}
ports! {
    pub struct MotionCurvePorts / MotionCurveIo {
        in {
            /// The motion.
            motion: Stream<f32>,
        }
        out {
            /// The curve, once the motion has ended.
            curve: Fold<MotionCurve>,
        }
    }
}

/// Longest curve, in numbers.
const MAX_VALUES: i64 = 1 << 26;

/// The node over [`MotionCurve`].
#[derive(Debug)]
pub struct MotionCurveNode {
    rate: f64,
    channels: usize,
    values: Vec<f32>,
    limit: usize,
}

impl Node for MotionCurveNode {
    type Params = MotionCurveParams;
    type Ports = MotionCurvePorts;
    const NAME: &'static str = "MotionCurve";
    const CLASS: Class = Class::Offline;

    fn shape(_: &MotionCurveParams, s: &mut Shape<'_, '_, MotionCurvePorts>) -> Result<(), Reject> {
        let motion = s.input(MotionCurvePorts::motion);
        let values = motion.items().map(|n| n * i64::from(motion.format.0));
        if values.is_none_or(|n| n > MAX_VALUES) {
            let found = values.map_or("does not end".into(), |n| format!("has {n} numbers"));
            let message = format!("`motion` {found}; a curve is made of at most {MAX_VALUES}");
            return Err(Reject::new("F157", message)
                .at("motion")
                .help("cut it with Trim, or lower its rate"));
        }
        s.ends(motion.end);
        Ok(())
    }

    fn build(_: &MotionCurveParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let motion = cx.input(MotionCurvePorts::motion);
        let channels = usize::from(motion.format.0);
        let limit = motion.items().unwrap_or(0).max(0) as usize * channels;
        Ok(Self { rate: motion.rate.as_f64(), channels, values: Vec::with_capacity(limit), limit })
    }

    fn run(&mut self, io: MotionCurveIo<'_>) -> Result<(), Fault> {
        let left = self.limit - self.values.len();
        let items = io.motion.items();
        self.values.extend_from_slice(&items[..items.len().min(left)]);
        Ok(())
    }

    fn finish(&mut self, mut io: MotionCurveIo<'_>) -> Result<Summary, Fault> {
        let curve = MotionCurve::with_gaps(self.rate, self.channels, std::mem::take(&mut self.values));
        let summary = vec![("frames", curve.frames().into()), ("gaps", curve.gaps.len().into())];
        io.curve.set(curve);
        Ok(summary)
    }

    archive_state!(values);
}
