//! Impacts of cloth that becomes taut, as a node.

use super::tightness::{Snap, TautParams, Tightness};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick};
use crate::mesh::{Mesh, vertex_areas};
use crate::modal::{Body, Impact};
use crate::{archive_state, params, ports};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

params! {
    /// Finds parts of a flag or a whipped sheet that are pulled tight, and makes an impact of each.
    ///
    /// The stretch of a part is that of the affine map nearest to it, which leaves out wrinkles. A part is slack when its stretch
    /// has fallen `band` below `taut`, and snaps when the stretch returns to `taut` with at least `strain_rate`. The impulse of the
    /// impact is the momentum that the part loses along its normal: `density` times area times the change of speed. `ImpactForce`
    /// makes forces of the impacts, and a `ModalBank` with the modes of `MembraneModes` rings under them. Its sound is added to the
    /// target, so that recordings make it realistic.
    ///
    /// Cloth that hangs flat has a stretch a little below 1, because fine waves stay in it: with `taut` 1 only cloth that is really
    /// stretched snaps. The latency is two frames: the lost speed is known only after the following frame.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012), whose cloth slides and crumples only; the stretch is that of Müller,
    /// Heidelberger, Teschner and Gross, "Meshless deformations based on shape matching" (SIGGRAPH 2005), section 3.4.
    pub struct TensionImpactParams {
        /// Maximum size of a part.
        region: f64 = 0.3, unit "m", range 0.001..=1000.0;
        /// Ratio of length to rest length at which a part becomes taut.
        taut: f64 = 0.99, unit "", range 0.1..=10.0;
        /// Decrease of the stretch below `taut` after which a part is slack.
        band: f64 = 0.03, unit "", range 0.0..=1.0;
        /// Minimum strain rate of an impact.
        strain_rate: f64 = 0.1, unit "1/s", range 0.0..=100_000.0;
        /// Mass of the cloth per area: 0.05 is silk, 0.15 a cotton sheet, 0.3 denim.
        density: f64 = 0.15, unit "kg/m^2", range 0.001..=100.0;
        /// Stiffness relative to steel on stone; a stiff contact is short.
        hardness: f32 = 1.0, unit "", range 0.000001..=1000.0_f32;
        /// Object number of the impacts.
        object: u32 = 0, unit "", range 0..=4_294_967_295_u32;
    }
}
ports! {
    pub struct TensionImpactPorts / TensionImpactIo {
        in {
            /// The cloth.
            mesh: Stream<Mesh>,
        }
        out {
            /// One impact for each part that becomes taut, at its centroid.
            impacts: Events<Impact>,
        }
    }
}

/// Look-ahead in frames from the last frame in which a part was slack.
const AHEAD: usize = 2;

/// The node over [`Tightness`].
pub struct TensionImpact {
    tightness: Tightness,
    params: TensionImpactParams,
    /// Next frame to process.
    next: Option<i64>,
    /// Impacts after the windows so far.
    waiting: VecDeque<(Tick, Impact)>,
    snaps: Vec<Snap>,
    /// Number of frames, if the animation ends.
    end: Option<i64>,
    figures: Figures,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Figures {
    impacts: u64,
    strongest: f32,
    fastest: f64,
}

impl TensionImpact {
    fn impact(&self, snap: &Snap) -> Impact {
        let p = &self.params;
        let body = Body { mass: p.density * snap.area, restitution: 0.0 };
        let (hardness, object, position) = (p.hardness, p.object, snap.position);
        Impact { hardness, object, position, ..Impact::from_velocity(snap.lost_speed, body) }
    }

    /// Processes a frame and inserts its impacts in order of time.
    fn process(&mut self, frame: i64, positions: &[[f32; 3]], rate: Rate) -> Result<(), Fault> {
        self.snaps.clear();
        let snaps = &mut self.snaps;
        self.tightness.process(positions, |snap| snaps.push(snap)).map_err(|vertex| {
            let message = format!("a position near vertex {vertex} of frame {frame} is no number");
            Fault::new("F105", message).at("mesh").when(rate.tick(frame))
        })?;
        for k in 0..self.snaps.len() {
            let Some(snap) = self.snaps.get(k).copied().filter(|snap| snap.lost_speed > 0.0) else {
                continue;
            };
            let before = frame - AHEAD as i64;
            let (from, to) = (rate.tick(before), rate.tick(before + 1));
            let tick = from + ((to - from) as f64 * snap.fraction) as Tick;
            let impact = self.impact(&snap);
            self.figures.impacts += 1;
            self.figures.strongest = self.figures.strongest.max(impact.impulse);
            self.figures.fastest = self.figures.fastest.max(snap.rate);
            let index = self.waiting.partition_point(|(known, _)| *known <= tick);
            self.waiting.insert(index, (tick, impact));
        }
        Ok(())
    }
}

impl Node for TensionImpact {
    type Params = TensionImpactParams;
    type Ports = TensionImpactPorts;
    const NAME: &'static str = "TensionImpact";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 30.0;

    fn shape(_: &TensionImpactParams, s: &mut Shape<'_, '_, TensionImpactPorts>) -> Result<(), Reject> {
        s.lookaround(TensionImpactPorts::mesh, 0, AHEAD);
        Ok(())
    }

    fn build(p: &TensionImpactParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let mesh = cx.input(TensionImpactPorts::mesh);
        let topology = &mesh.format.topology;
        let areas = vertex_areas(&topology.rest, &topology.triangles);
        let params = TautParams { size: p.region, taut: p.taut, band: p.band, rate: p.strain_rate };
        Ok(Self {
            tightness: Tightness::new(topology, &areas, params, mesh.rate.as_f64()),
            params: p.clone(),
            next: None,
            waiting: VecDeque::new(),
            snaps: Vec::new(),
            end: mesh.items(),
            figures: Figures::default(),
        })
    }

    fn run(&mut self, mut io: TensionImpactIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.mesh.first(), io.mesh.rate());
        let last = (first + io.mesh.len() as i64 + AHEAD as i64).min(self.end.unwrap_or(i64::MAX));
        for frame in self.next.unwrap_or(first)..last {
            self.process(frame, io.mesh.item((frame - first) as isize), rate)?;
        }
        self.next = Some(last.max(self.next.unwrap_or(first)));
        let (_, to) = io.impacts.window();
        while let Some((tick, impact)) = self.waiting.pop_front_if(|(tick, _)| *tick < to) {
            io.impacts.push(tick, impact);
        }
        Ok(())
    }

    fn finish(&mut self, _: TensionImpactIo<'_>) -> Result<Summary, Fault> {
        let Figures { impacts, strongest, fastest } = self.figures;
        Ok(vec![
            ("impacts", impacts.into()),
            ("parts", self.tightness.parts().into()),
            ("strongest_n_s", strongest.into()),
            ("fastest_strain_per_s", fastest.into()),
        ])
    }

    archive_state!(tightness, next, waiting, end, figures);

    fn trial(rng: &mut Rng) -> (TensionImpactParams, MemoryFiles) {
        // Sheets of trials are 0.1 m wide and tremble by a centimetre.
        let params = TensionImpactParams {
            region: rng.between(0.03, 0.2),
            taut: rng.between(0.95, 1.05),
            band: rng.between(0.0, 0.05),
            strain_rate: rng.between(0.0, 1.0),
            ..TensionImpactParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::{seconds, ticks};
    use crate::mesh::MeshFormat;
    use crate::mesh::generate::{FlatSheet, Synthetic};

    fn params() -> TensionImpactParams {
        let p = TensionImpactParams::read(&|_| None).unwrap();
        TensionImpactParams { region: 10.0, taut: 1.0, density: 0.2, ..p }
    }

    /// Impacts of a sheet of 0.8 m by 0.5 m that flies at a speed until it becomes taut at a time.
    fn impacts(p: TensionImpactParams, speed: f64, taut: f64, window: f64) -> Vec<(Tick, Impact)> {
        let sheet = FlatSheet { vertices: [9, 6], size: [0.8, 0.5], velocity: [0.0; 3] }.topology();
        let frames: Vec<[f32; 3]> = (0..50)
            .flat_map(|k| {
                let t = f64::from(k) / 50.0;
                let stretch = (1.0 + t - taut).clamp(0.9, 1.02) as f32;
                let z = (speed * t.min(taut)) as f32;
                sheet.rest.iter().map(move |p| [stretch * p[0], 1.05 * p[1], z]).collect::<Vec<_>>()
            })
            .collect();
        let standalone = Standalone::new::<TensionImpact>(p).input(
            TensionImpactPorts::mesh,
            Rate::hz(50),
            MeshFormat::moving(sheet),
            frames,
        );
        standalone.window(ticks(window)).run().unwrap().events(TensionImpactPorts::impacts)
    }

    #[test]
    fn a_sheet_that_becomes_taut_makes_one_impact_of_mass_times_speed() {
        let found = impacts(params(), 4.0, 0.413, 1.0);
        assert_eq!(found.len(), 1, "{found:?}");
        let (tick, impact) = found[0];
        assert!((seconds(tick) - 0.413).abs() < 1e-5, "{}", seconds(tick));
        // 0.2 kg/m^2 on 0.4 m^2.
        let mass = 0.2 * 0.4;
        assert!((f64::from(impact.impulse) / (mass * 4.0) - 1.0).abs() < 1e-4, "{impact:?}");
        assert!((f64::from(impact.energy) / (0.5 * mass * 16.0) - 1.0).abs() < 1e-3, "{impact:?}");
        assert!((impact.position[2] - 4.0 * 0.413).abs() < 1e-5 && impact.is_valid());
    }

    #[test]
    fn windows_of_any_size_give_the_same_impacts() {
        let p = TensionImpactParams { region: 0.2, ..params() };
        let whole = impacts(p.clone(), 3.0, 0.317, 9.0);
        assert!(whole.len() == 12 && whole.is_sorted_by_key(|(tick, _)| *tick), "{}", whole.len());
        for window in [0.001, 0.02, 0.037, 0.3] {
            assert_eq!(impacts(p.clone(), 3.0, 0.317, window), whole, "{window}");
        }
    }

    #[test]
    fn a_stretched_sheet_at_rest_makes_no_impact() {
        assert_eq!(impacts(params(), 0.0, 0.4, 1.0), []);
    }
}
