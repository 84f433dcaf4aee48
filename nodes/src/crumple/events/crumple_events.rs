//! The node around [`CrumpleEvents`](super::CrumpleEvents).

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
    /// Joins the vertices of a cloth that snap together to events: where, when, how strongly and to which side.
    ///
    /// Neighbours that snap to the same side in the same frame are one event, unless a border of materials lies between them. Materials come
    /// with the mesh (`MeshSequence`, parameter `material`, and `usemtl` of an OBJ); with one such node per material each has its own
    /// events, and so its own bank and level. The energy of an event is the square of the sum of their changes of
    /// mean curvature, each times its area unless `weight` is `None`. Of many events most are too weak to be heard: `e_min` drops
    /// them by a number, `EnergyCalibration` finds that number from a share or a rate.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3 and equation 4; area
    /// weights and merging over time are additions.
    pub struct CrumpleEventsParams {
        /// What energies are a sum over.
        weight: Weight = Weight::Area;
        /// Energy below which an event is dropped, in m^2, or in 1/m^2 without weights. No constant of a material: it depends on mesh and motion.
        e_min: f64 = 0.0, unit "m^2", range 0.0..=1e12;
        /// How long one snap may last over several frames; 0 leaves every frame on its own, 0.033 is good for 120 frames a second and more. Adds as
        /// much latency.
        merge_window: f64 = 0.0, unit "s", range 0.0..=1.0;
        /// Name of the material whose events are given; None gives those of all.
        material: Option<Text> = None;
    }
}
ports! {
    pub struct CrumpleEventsPorts / CrumpleEventsIo {
        in {
            /// Vertices that snap.
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
    merge: i64,
    /// Next frame to take.
    next: Option<i64>,
    /// The last frame, where there is one.
    end: Option<i64>,
    given: u64,
    weakest: f64,
    strongest: f64,
}

/// Frames after the first within a merge window.
fn merge_frames(p: &CrumpleEventsParams, rate: Rate) -> usize {
    (p.merge_window * rate.as_f64() + 1e-6).floor() as usize
}

/// The material that is asked for, by its place among those of the cloth.
fn only(p: &CrumpleEventsParams, format: &MeshFormat) -> Result<Option<u16>, Reject> {
    let Some(Text(name)) = &p.material else { return Ok(None) };
    let names = format.materials.names();
    if let Some(place) = names.iter().position(|known| known == name) {
        return Ok(Some(place as u16));
    }
    let known: Vec<_> = names.iter().map(|n| if n.is_empty() { "(unnamed)" } else { n }).collect();
    let help = match known.len() {
        0 => "give the cloth one by `material` of MeshSequence, or leave `material` out".to_owned(),
        _ => format!("it is of {}", known.join(", ")),
    };
    Err(Reject::new("F107", format!("nothing of the cloth is of the material `{name}`"))
        .at("material")
        .help(help))
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
        only(p, &buckles.format)?;
        s.lookaround(CrumpleEventsPorts::buckles, 0, merge_frames(p, buckles.rate));
        Ok(())
    }

    fn build(p: &CrumpleEventsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let buckles = cx.input(CrumpleEventsPorts::buckles);
        let merge_frames = merge_frames(p, buckles.rate);
        let only = only(p, &buckles.format)?;
        let params = CrumpleParams { weight: p.weight, merge_frames, e_min: p.e_min, only };
        let MeshFormat { topology, materials, .. } = &buckles.format;
        let events = grouping::CrumpleEvents::new(topology, &materials.of_vertices(topology), params)
            .map_err(|e| Fault::new("F105", e.to_string()).at("buckles"))?;
        Ok(Self {
            events,
            merge: merge_frames as i64,
            next: None,
            end: buckles.items(),
            given: 0,
            weakest: f64::INFINITY,
            strongest: 0.0,
        })
    }

    fn run(&mut self, mut io: CrumpleEventsIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.buckles.first(), io.buckles.rate());
        let last = first + io.buckles.len() as i64;
        for frame in self.next.unwrap_or(first)..last + self.merge {
            if self.end.is_none_or(|end| frame < end) {
                self.events.take(frame, io.buckles.item((frame - first) as isize));
            } else {
                self.events.finish();
            }
        }
        self.next = Some(last + self.merge);
        while let Some((frame, mut event)) = self.events.next_before(last) {
            event.interval = rate.tick(frame + 1) - rate.tick(frame);
            self.given += 1;
            self.weakest = self.weakest.min(event.energy);
            self.strongest = self.strongest.max(event.energy);
            io.events.push(rate.tick(frame), event);
        }
        Ok(())
    }

    fn finish(&mut self, _: CrumpleEventsIo<'_>) -> Result<Summary, Fault> {
        let mut told: Summary =
            vec![("events", self.given.into()), ("dropped", self.events.dropped().into())];
        if self.given > 0 {
            told.push(("weakest", self.weakest.into()));
            told.push(("strongest", self.strongest.into()));
        }
        Ok(told)
    }

    archive_state!(events, next, given, weakest, strongest);

    fn trial(rng: &mut Rng) -> (CrumpleEventsParams, MemoryFiles) {
        // One frame, or two, at the rates of trials: events that last longer hardly ever hang on their last frame.
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
