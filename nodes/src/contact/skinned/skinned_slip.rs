//! The node `SkinnedSlip`.

use std::sync::Arc;

use super::bending::{Bend, BendDetector};
use super::lag::Lag;
use crate::contact::item::Speeds;
use crate::contact::vector::Vec3;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick};
use crate::crumple::{Crumple, Weight, mesh_digest};
use crate::mesh::{Mesh, Topology, vertex_areas};
use crate::{archive_state, params, ports};

params! {
    /// Approximates sliding and crumpling of a garment that follows its skeleton and was not simulated.
    ///
    /// Skinned cloth neither slides nor snaps, so `ContactDetector` and `BuckleDetector` find nothing in it. This node attaches the
    /// cloth to each skinned vertex by a damped spring; the speed of its lag along the surface represents sliding over the body.
    /// A crumple is an event at which the edges of a part of the garment start to change their lengths fast, as at a bending joint;
    /// the next one follows after the rate has fallen to half the threshold. Both are plausible, not physical: calibrate the energies
    /// of such crumples by an `EnergyCalibration` of the same events alone.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012), whose cloth is simulated.
    pub struct SkinnedSlipParams {
        /// Frequency of the spring.
        frequency: f64 = 3.0, unit "Hz", range 0.1..=30.0;
        /// Damping ratio of the spring; at 1 it would not oscillate.
        damping: f64 = 0.5, unit "", range 0.01..=0.99;
        /// Speed of the lag above which a vertex slides.
        threshold: f32 = 0.02, unit "m/s", range 0.0..=100.0;
        /// Largest size of the parts whose mean strain is measured.
        region: f64 = 0.05, unit "m", range 0.001..=10.0;
        /// Rate of change of the mean strain above which a part crumples.
        bend_rate: f64 = 0.5, unit "1/s", range 0.001..=1000.0;
    }
}
ports! {
    pub struct SkinnedSlipPorts / SkinnedSlipIo {
        in {
            /// The skinned garment.
            mesh: Stream<Mesh>,
        }
        out {
            /// Sliding speed per vertex, once per frame.
            speeds: Stream<Speeds>,
            /// Parts that start to bend fast.
            crumples: Events<Crumple>,
        }
    }
}

/// The node `SkinnedSlip`.
pub struct SkinnedSlip {
    lag: Lag,
    bends: BendDetector,
    topology: Arc<Topology>,
    normals: Vec<Vec3>,
    found: Vec<Bend>,
    threshold: f32,
    digest: u32,
    fastest: f32,
    crumples: u64,
}

fn crumple(bend: &Bend, interval: Tick, mesh: u32) -> Crumple {
    Crumple {
        id: bend.id,
        sign: if bend.rate > 0.0 { 1 } else { -1 },
        energy: (bend.rate * bend.area).powi(2),
        weight: Weight::Area,
        vertices: bend.vertices,
        area: bend.area as f32,
        material: 0,
        position: bend.position,
        normal: [0.0; 3],
        interval,
        mesh,
        method: None,
        h_eps: 0.0,
    }
}

impl Node for SkinnedSlip {
    type Params = SkinnedSlipParams;
    type Ports = SkinnedSlipPorts;
    const NAME: &'static str = "SkinnedSlip";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 50.0;

    fn shape(_: &SkinnedSlipParams, s: &mut Shape<'_, '_, SkinnedSlipPorts>) -> Result<(), Reject> {
        let mesh = s.input(SkinnedSlipPorts::mesh);
        let topology = &mesh.format.topology;
        let areas: Arc<[f32]> = vertex_areas(&topology.rest, &topology.triangles).into();
        s.output(SkinnedSlipPorts::speeds, mesh.rate, areas);
        Ok(())
    }

    fn build(p: &SkinnedSlipParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let mesh = cx.input(SkinnedSlipPorts::mesh);
        let (topology, rate) = (mesh.format.topology, mesh.rate.as_f64());
        let areas = vertex_areas(&topology.rest, &topology.triangles);
        let n = topology.vertex_count();
        Ok(Self {
            lag: Lag::new(n, rate, p.frequency, p.damping),
            bends: BendDetector::new(&topology, &areas, p.region, p.bend_rate, rate),
            normals: vec![[0.0; 3]; n],
            found: Vec::new(),
            threshold: p.threshold,
            digest: mesh_digest(&topology),
            topology,
            fastest: 0.0,
            crumples: 0,
        })
    }

    fn run(&mut self, mut io: SkinnedSlipIo<'_>) -> Result<(), Fault> {
        let (width, rate): (usize, Rate) = (io.mesh.width().max(1), io.mesh.rate());
        let frames = io.mesh.items().chunks_exact(width).zip(io.speeds.items().chunks_exact_mut(width));
        for (frame, (positions, out)) in (io.mesh.first()..).zip(frames) {
            self.lag.advance(positions);
            self.lag.slip(&self.topology.triangles, &mut self.normals, out);
            for speed in out {
                *speed = if *speed > self.threshold { *speed } else { 0.0 };
                self.fastest = self.fastest.max(*speed);
            }
            let found = &mut self.found;
            found.clear();
            self.bends.advance(positions, |bend| found.push(bend));
            self.crumples += self.found.len() as u64;
            for bend in &self.found {
                let interval = rate.tick(frame + 1) - rate.tick(frame);
                io.crumples.push(rate.tick(frame), crumple(bend, interval, self.digest));
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: SkinnedSlipIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("fastest", self.fastest.into()), ("crumples", self.crumples.into())])
    }

    archive_state!(lag, bends, fastest, crumples);

    fn trial(rng: &mut Rng) -> (SkinnedSlipParams, MemoryFiles) {
        let params = SkinnedSlipParams {
            threshold: rng.between(0.0, 0.1) as f32,
            region: rng.between(0.02, 0.2),
            ..SkinnedSlipParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;
    use crate::mesh::MeshFormat;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    #[test]
    fn a_sleeve_that_stops_keeps_sliding_and_its_joint_crumples_in_windows_of_any_length() {
        let sheet = FlatSheet { vertices: [5, 4], size: [0.4, 0.3], velocity: [0.0; 3] }.topology();
        let rate = Rate::hz(60);
        // It moves for half a second, is compressed as it stops, and rests.
        let frames = (0..90).flat_map(|k| {
            let (x, by) = ((k.min(30) as f32) / 60.0, 1.0 - 0.02 * (k.clamp(30, 36) - 30) as f32);
            sheet.rest.iter().map(move |p| [x + by * p[0], p[1], p[2]]).collect::<Vec<_>>()
        });
        let frames: Vec<[f32; 3]> = frames.collect();
        let run = |window: f64| {
            let p = SkinnedSlipParams { region: 0.2, ..SkinnedSlipParams::read(&|_| None).unwrap() };
            let standalone = Standalone::new::<SkinnedSlip>(p)
                .input(SkinnedSlipPorts::mesh, rate, MeshFormat::moving(sheet.clone()), frames.clone())
                .window(ticks(window));
            let run = standalone.run().unwrap();
            (run.stream(SkinnedSlipPorts::speeds), run.events(SkinnedSlipPorts::crumples))
        };
        let (speeds, crumples) = run(1.0);
        assert!(speeds[..30 * 20].iter().all(|s| *s == 0.0), "constant velocity is silent");
        assert!(speeds[31 * 20..40 * 20].iter().any(|s| *s > 0.3));
        assert!(speeds[85 * 20..].iter().all(|s| *s < 0.05));
        assert!(!crumples.is_empty() && crumples.iter().all(|(t, c)| *t == rate.tick(31) && c.energy > 0.0));
        for window in [1.0 / 60.0, 0.037, 9.0] {
            assert!(run(window) == (speeds.clone(), crumples.clone()), "{window}");
        }
    }
}
