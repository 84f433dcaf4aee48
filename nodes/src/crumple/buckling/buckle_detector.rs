//! Detection of buckling vertices, as a node.

use super::buckle;
use super::buckles::Buckles;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::ports::{Stream, Value};
use crate::core::shape::{Build, Shape};
use crate::curvature::{Curvatures, RestNoise};
use crate::{archive_state, params, ports};

params! {
    /// Detects the vertices of a cloth whose mean curvature changes sign from one frame to the next.
    ///
    /// A vertex buckles outwards (label 1) when its curvature changes from below 0 to 0 or above, and inwards (-1) when
    /// it changes back. On nearly flat cloth the sign is noise. A dead band `h_eps` above 0 excludes it: a vertex buckles
    /// only if its absolute curvature has exceeded `h_eps` in two frames in sequence since its sign last changed, or in one
    /// frame on either side. Three times the noise of the resting
    /// cloth is a good dead band; `RestNoise` measures it and can be linked to `h_eps`. Vertices on a hem never buckle.
    ///
    /// The change of curvature is measured from the last frame outside of the dead band, at most 1/30 s ago.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3; the
    /// dead band is an addition; 0 is the paper's rule.
    pub struct BuckleDetectorParams {
        /// Dead band: absolute curvature that counts as noise.
        h_eps: f64 = 0.0, unit "1/m", range 0.0..=100_000.0;
    }
}
ports! {
    pub struct BuckleDetectorPorts / BuckleDetectorIo {
        in {
            /// Curvature of each vertex.
            curvature: Stream<Curvatures>,
            /// Noise of the resting cloth; its dead band replaces the parameter.
            h_eps: Option<Value<RestNoise>>,
        }
        out {
            /// Label and change of curvature of each vertex.
            buckles: Stream<Buckles>,
        }
    }
}

/// The node `BuckleDetector`.
pub struct BuckleDetectorNode {
    detector: buckle::BuckleDetector,
    /// Numbers of labels, outwards and inwards.
    counts: [u64; 2],
    max_per_frame: usize,
}

impl Node for BuckleDetectorNode {
    type Params = BuckleDetectorParams;
    type Ports = BuckleDetectorPorts;
    const NAME: &'static str = "BuckleDetector";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 10.0;

    fn shape(_: &BuckleDetectorParams, s: &mut Shape<'_, '_, BuckleDetectorPorts>) -> Result<(), Reject> {
        let curvature = s.input(BuckleDetectorPorts::curvature);
        s.output(BuckleDetectorPorts::buckles, curvature.rate, curvature.format);
        Ok(())
    }

    fn build(p: &BuckleDetectorParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let curvature = cx.input(BuckleDetectorPorts::curvature);
        let vertices = curvature.format.topology.vertex_count();
        let detector = buckle::BuckleDetector::new(vertices, curvature.rate.as_f64(), p.h_eps);
        Ok(Self { detector, counts: [0; 2], max_per_frame: 0 })
    }

    fn run(&mut self, mut io: BuckleDetectorIo<'_>) -> Result<(), Fault> {
        if let Some(noise) = io.h_eps {
            self.detector.set_dead_band(noise.h_eps);
        }
        let width = io.buckles.width().max(1);
        let frames = io.curvature.items().chunks_exact(width);
        for (frame, out) in frames.zip(io.buckles.items().chunks_exact_mut(width)) {
            self.detector.detect(frame, out);
            let count = |label| out.iter().filter(|b| b.label == label).count();
            let (outwards, inwards) = (count(1), count(-1));
            self.counts[0] += outwards as u64;
            self.counts[1] += inwards as u64;
            self.max_per_frame = self.max_per_frame.max(outwards + inwards);
        }
        Ok(())
    }

    fn finish(&mut self, _: BuckleDetectorIo<'_>) -> Result<Summary, Fault> {
        let [outwards, inwards] = self.counts;
        Ok(vec![
            ("outwards", outwards.into()),
            ("inwards", inwards.into()),
            ("in_a_frame_at_most", self.max_per_frame.into()),
        ])
    }

    fn retune(&mut self, new: &BuckleDetectorParams) -> Retune {
        self.detector.set_dead_band(new.h_eps);
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.detector.take_state(&old.detector);
        (self.counts, self.max_per_frame) = (old.counts, old.max_per_frame);
    }

    archive_state!(detector, counts, max_per_frame);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::AnyValue;
    use crate::core::standalone::{Feed, Standalone};
    use crate::core::time::{Rate, ticks};
    use crate::curvature::Curvature;
    use crate::mesh::{MeshFormat, Topology};

    #[test]
    fn a_linked_noise_replaces_the_dead_band() {
        let topology = Topology { rest: vec![[0.0; 3]], triangles: Vec::new() };
        let bent = |h| Curvature { h, valid: true, ..Curvature::default() };
        let frames: Vec<_> = [-1.0, 0.1, -0.1, 0.1, 1.0].map(bent).into();
        let standalone = || {
            Standalone::new::<BuckleDetectorNode>(BuckleDetectorParams { h_eps: 0.0 })
                .input(
                    BuckleDetectorPorts::curvature,
                    Rate::hz(60),
                    MeshFormat::moving(topology.clone()),
                    frames.clone(),
                )
                .window(ticks(0.01))
        };
        let count = |standalone: Standalone| {
            let found = standalone.run().unwrap().stream(BuckleDetectorPorts::buckles);
            found.iter().filter(|b| b.label != 0).map(|b| b.delta).collect::<Vec<_>>()
        };
        assert_eq!(count(standalone()).len(), 3);
        let noise = RestNoise { deviation: 0.1, h_eps: 0.3, frames: 9 };
        assert_eq!(count(standalone().feed(1, Feed::value(AnyValue::new(noise)))), [1.1]);
    }
}
