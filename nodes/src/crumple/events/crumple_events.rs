//! Grouping of buckling vertices into events, as a node.

use super::crumple::{Crumple, Weight};
use super::grouping::{self, CrumpleParams};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::{Events, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::crumple::buckling::Buckles;
use crate::mesh::MeshFormat;
use crate::{archive_state, params, ports};

params! {
    /// Groups the buckling vertices of a cloth into events with time, position, energy and direction.
    ///
    /// Neighbours that buckle to the same side in the same frame are one event, unless their materials differ.
    /// Materials come from the mesh (`material` of `MeshSequence`, `usemtl` of an OBJ). With one node per material,
    /// each material has its own events, bank and level. The energy of an event is the square of the sum of the changes
    /// of mean curvature of its vertices, each times its area unless `weight` is `None`. Most events are inaudible.
    /// `e_min` drops events below an energy, which `EnergyCalibration` can derive from a percentile or a rate.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3 and
    /// equation 4; area weights and merging over time are additions.
    pub struct CrumpleEventsParams {
        /// Weight of a vertex in energies.
        weight: Weight = Weight::Area;
        /// Energy below which events are dropped, in m^2, or in 1/m^2 without weights. It depends on mesh and motion,
        /// not on the material alone.
        e_min: f64 = 0.0, unit "m^2", range 0.0..=1e12;
        /// Maximum duration of an event over several frames; 0 does not join frames. 0.033 is good for 120 frames per
        /// second and more. It adds the same latency.
        merge_window: f64 = 0.0, unit "s", range 0.0..=1.0;
        /// Name of the only material with events; None for all materials.
        material: Option<Text> = None;
    }
}
ports! {
    pub struct CrumpleEventsPorts / CrumpleEventsIo {
        in {
            /// Buckling vertices.
            buckles: Stream<Buckles>,
        }
        out {
            /// The events.
            events: Events<Crumple>,
        }
    }
}

/// The node `CrumpleEvents`.
pub struct CrumpleEventsNode {
    events: grouping::CrumpleEvents,
    merge_frames: i64,
    /// Next frame to add.
    next: Option<i64>,
    /// Number of frames, if the stream ends.
    end: Option<i64>,
    count: u64,
    weakest: f64,
    strongest: f64,
}

/// Returns the number of frames after the first within the merge window.
fn merge_frames(p: &CrumpleEventsParams, rate: Rate) -> usize {
    (p.merge_window * rate.as_f64() + 1e-6).floor() as usize
}

/// Returns the index of the selected material, `None` if there is none.
fn selected_material(p: &CrumpleEventsParams, format: &MeshFormat) -> Result<Option<u16>, Reject> {
    let Some(Text(name)) = &p.material else { return Ok(None) };
    let names = format.materials.names();
    if let Some(index) = names.iter().position(|known| known == name) {
        return Ok(Some(index as u16));
    }
    let known: Vec<_> = names.iter().map(|n| if n.is_empty() { "(unnamed)" } else { n }).collect();
    let help = match known.len() {
        0 => "set `material` of MeshSequence, or remove `material` here".to_owned(),
        _ => format!("its materials are {}", known.join(", ")),
    };
    Err(Reject::new("F107", format!("the cloth has no material `{name}`")).at("material").help(help))
}

impl Node for CrumpleEventsNode {
    type Params = CrumpleEventsParams;
    type Ports = CrumpleEventsPorts;
    const NAME: &'static str = "CrumpleEvents";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 5.0;

    fn shape(p: &CrumpleEventsParams, s: &mut Shape<'_, '_, CrumpleEventsPorts>) -> Result<(), Reject> {
        let buckles = s.input(CrumpleEventsPorts::buckles);
        selected_material(p, &buckles.format)?;
        s.lookaround(CrumpleEventsPorts::buckles, 0, merge_frames(p, buckles.rate));
        Ok(())
    }

    fn build(p: &CrumpleEventsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let buckles = cx.input(CrumpleEventsPorts::buckles);
        let merge_frames = merge_frames(p, buckles.rate);
        let only = selected_material(p, &buckles.format)?;
        let params = CrumpleParams { weight: p.weight, merge_frames, e_min: p.e_min, only };
        let MeshFormat { topology, materials, .. } = &buckles.format;
        let events = grouping::CrumpleEvents::new(topology, &materials.of_vertices(topology), params)
            .map_err(|e| Fault::new("F105", e.to_string()).at("buckles"))?;
        Ok(Self {
            events,
            merge_frames: merge_frames as i64,
            next: None,
            end: buckles.items(),
            count: 0,
            weakest: f64::INFINITY,
            strongest: 0.0,
        })
    }

    fn run(&mut self, mut io: CrumpleEventsIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.buckles.first(), io.buckles.rate());
        let last = first + io.buckles.len() as i64;
        for frame in self.next.unwrap_or(first)..last + self.merge_frames {
            if self.end.is_none_or(|end| frame < end) {
                self.events.add_frame(frame, io.buckles.item((frame - first) as isize));
            } else {
                self.events.finish();
            }
        }
        self.next = Some(last + self.merge_frames);
        while let Some((frame, mut event)) = self.events.next_before(last) {
            event.interval = rate.tick(frame + 1) - rate.tick(frame);
            self.count += 1;
            self.weakest = self.weakest.min(event.energy);
            self.strongest = self.strongest.max(event.energy);
            io.events.push(rate.tick(frame), event);
        }
        Ok(())
    }

    fn finish(&mut self, _: CrumpleEventsIo<'_>) -> Result<Summary, Fault> {
        let mut summary: Summary =
            vec![("events", self.count.into()), ("dropped", self.events.dropped().into())];
        if self.count > 0 {
            summary.push(("weakest", self.weakest.into()));
            summary.push(("strongest", self.strongest.into()));
        }
        Ok(summary)
    }

    archive_state!(events, next, count, weakest, strongest);

    fn trial(rng: &mut Rng) -> (CrumpleEventsParams, MemoryFiles) {
        // One frame, or two, at the rates of trials: longer events rarely depend on their last frame.
        let merge_window = [0.0, 0.018, 0.03, 0.045][rng.below(4)];
        let e_min = [0.0, rng.between(0.0, 1e-6)][rng.below(2)];
        (
            CrumpleEventsParams { merge_window, e_min, material: None, ..CrumpleEventsParams::trial(rng) },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests;
