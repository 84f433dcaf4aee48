//! The node around [`Tightness`].

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
    /// Finds where a flag or a whipped sheet is caught: parts of the cloth that were slack and are pulled taut are blows.
    ///
    /// A part is slack where its stretch, the length of what is nearest to it without wrinkles over its length at rest, has fallen
    /// `band` below `taut`; it is caught where the stretch comes back to `taut` with at least `strain_rate`. The blow has the momentum that the
    /// part loses along its normal: `density` times area times the change of its speed. `ImpactForce` makes forces of the blows,
    /// `MembraneModes` says what rings under them in a `ModalBank`, and that sound is added to the target, so that recordings
    /// give it their realism.
    ///
    /// Cloth that hangs flat measures a little less than its rest pose, for fine waves stay in it: with `taut` 1 only what is truly stretched is
    /// caught. The latency is two frames: what a part loses shows in the frames after.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012), whose cloth slides and crumples only; the stretch is that of Müller,
    /// Heidelberger, Teschner and Gross, "Meshless deformations based on shape matching" (SIGGRAPH 2005), section 3.4.
    pub struct TensionImpactParams {
        /// Largest size of the parts that are caught as one.
        region: f64 = 0.3, unit "m", range 0.001..=1000.0;
        /// Length over length at rest from which on a part is taut.
        taut: f64 = 0.99, unit "", range 0.1..=10.0;
        /// How far the stretch falls below `taut` before a part is slack.
        band: f64 = 0.03, unit "", range 0.0..=1.0;
        /// Least strain per second of a blow.
        strain_rate: f64 = 0.1, unit "1/s", range 0.0..=100_000.0;
        /// Mass of the cloth per area: 0.05 is silk, 0.15 a cotton sheet, 0.3 denim.
        density: f64 = 0.15, unit "kg/m^2", range 0.001..=100.0;
        /// Stiffness relative to steel on stone, which makes a blow short.
        hardness: f32 = 1.0, unit "", range 0.000001..=1000.0_f32;
        /// Number that the blows have as their object.
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
            /// One blow for each part that is caught, at its middle.
            impacts: Events<Impact>,
        }
    }
}

/// Frames that have to be known after the one before which a part was slack.
const AHEAD: usize = 2;

/// The node over [`Tightness`].
pub struct TensionImpact {
    tightness: Tightness,
    params: TensionImpactParams,
    /// Next frame to take.
    next: Option<i64>,
    /// Blows that fall after the windows so far.
    waiting: VecDeque<(Tick, Impact)>,
    snaps: Vec<Snap>,
    /// Frames in the take, where it ends.
    end: Option<i64>,
    told: Told,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Told {
    impacts: u64,
    strongest: f32,
    fastest: f64,
}

impl TensionImpact {
    fn strike(&self, snap: &Snap) -> Impact {
        let p = &self.params;
        let body = Body { mass: p.density * snap.area, restitution: 0.0 };
        let (hardness, object, position) = (p.hardness, p.object, snap.position);
        Impact { hardness, object, position, ..Impact::from_velocity(snap.lost, body) }
    }

    /// Takes a frame; `first` is the number of the first one ever taken.
    fn take(&mut self, frame: i64, places: &[[f32; 3]], rate: Rate) -> Result<(), Fault> {
        self.snaps.clear();
        let snaps = &mut self.snaps;
        self.tightness.take(places, |snap| snaps.push(snap)).map_err(|vertex| {
            let message = format!("a position near vertex {vertex} of frame {frame} is no number");
            Fault::new("F105", message).at("mesh").when(rate.tick(frame))
        })?;
        for k in 0..self.snaps.len() {
            let Some(snap) = self.snaps.get(k).copied().filter(|snap| snap.lost > 0.0) else { continue };
            let before = frame - AHEAD as i64;
            let (from, to) = (rate.tick(before), rate.tick(before + 1));
            let tick = from + ((to - from) as f64 * snap.within) as Tick;
            let impact = self.strike(&snap);
            self.told.impacts += 1;
            self.told.strongest = self.told.strongest.max(impact.impulse);
            self.told.fastest = self.told.fastest.max(snap.rate);
            let place = self.waiting.partition_point(|(known, _)| *known <= tick);
            self.waiting.insert(place, (tick, impact));
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
            told: Told::default(),
        })
    }

    fn run(&mut self, mut io: TensionImpactIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.mesh.first(), io.mesh.rate());
        let last = (first + io.mesh.len() as i64 + AHEAD as i64).min(self.end.unwrap_or(i64::MAX));
        for frame in self.next.unwrap_or(first)..last {
            self.take(frame, io.mesh.item((frame - first) as isize), rate)?;
        }
        self.next = Some(last.max(self.next.unwrap_or(first)));
        let (_, to) = io.impacts.window();
        while let Some((tick, impact)) = self.waiting.pop_front_if(|(tick, _)| *tick < to) {
            io.impacts.push(tick, impact);
        }
        Ok(())
    }

    fn finish(&mut self, _: TensionImpactIo<'_>) -> Result<Summary, Fault> {
        let Told { impacts, strongest, fastest } = self.told;
        Ok(vec![
            ("impacts", impacts.into()),
            ("parts", self.tightness.parts().into()),
            ("strongest_n_s", strongest.into()),
            ("fastest_strain_per_s", fastest.into()),
        ])
    }

    archive_state!(tightness, next, waiting, end, told);

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

    /// Blows of a sheet of 0.8 m by 0.5 m that flies with a speed until it is caught at a time.
    fn blows(p: TensionImpactParams, speed: f64, caught: f64, window: f64) -> Vec<(Tick, Impact)> {
        let sheet = FlatSheet { vertices: [9, 6], size: [0.8, 0.5], velocity: [0.0; 3] }.topology();
        let frames: Vec<[f32; 3]> = (0..50)
            .flat_map(|k| {
                let t = f64::from(k) / 50.0;
                let stretch = (1.0 + t - caught).clamp(0.9, 1.02) as f32;
                let z = (speed * t.min(caught)) as f32;
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
    fn a_caught_sheet_is_one_blow_with_its_mass_times_its_speed() {
        let found = blows(params(), 4.0, 0.413, 1.0);
        assert_eq!(found.len(), 1, "{found:?}");
        let (tick, blow) = found[0];
        assert!((seconds(tick) - 0.413).abs() < 1e-5, "{}", seconds(tick));
        // 0.2 kg/m^2 on 0.4 m^2.
        let mass = 0.2 * 0.4;
        assert!((f64::from(blow.impulse) / (mass * 4.0) - 1.0).abs() < 1e-4, "{blow:?}");
        assert!((f64::from(blow.energy) / (0.5 * mass * 16.0) - 1.0).abs() < 1e-3, "{blow:?}");
        assert!((blow.position[2] - 4.0 * 0.413).abs() < 1e-5 && blow.is_valid());
    }

    #[test]
    fn windows_of_any_size_give_the_same_blows_at_the_same_times() {
        let p = TensionImpactParams { region: 0.2, ..params() };
        let whole = blows(p.clone(), 3.0, 0.317, 9.0);
        assert!(whole.len() == 12 && whole.is_sorted_by_key(|(tick, _)| *tick), "{}", whole.len());
        for window in [0.001, 0.02, 0.037, 0.3] {
            assert_eq!(blows(p.clone(), 3.0, 0.317, window), whole, "{window}");
        }
    }

    #[test]
    fn a_sheet_that_is_stretched_at_rest_strikes_nothing() {
        assert_eq!(blows(params(), 0.0, 0.4, 1.0), []);
    }
}
