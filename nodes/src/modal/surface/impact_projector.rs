//! Impacts anywhere on an object, as impacts on contact points that move.

use super::mode_shapes::ModeShapes;
use super::surface_index::SurfaceIndex;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::ports::{Events, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::silence::Silence;
use crate::core::unmatched::Unmatched;
use crate::modal::impact::event::Impact;
use crate::{archive_state, params, ports};
use std::sync::Arc;

params! {
    /// Projects impacts onto the surface of an object, and gives each the next of several contact points.
    ///
    /// The position of an impact on the object moves to the nearest point of the surface; the impulse acts along the inward normal
    /// there. Link the output to an `ImpactForce` of as many `points`, and to `positions` of the `ModalBank`, which moves the contact
    /// point of each impact to its position. An impact is correct if fewer than `points` others follow it within its contact.
    ///
    /// An impact farther from the surface than `max_off_surface` is left out, and the summary counts it with the largest distance:
    /// such a log has other units than the shape, or no poses.
    ///
    /// # Source
    /// Sterling et al. (IEEE TVCG 25(5), 2019), section 3.1: the impulse on a mode is its shape at the point times the impulse.
    pub struct ImpactProjectorParams {
        /// Number of the object whose impacts are read; None reads all.
        object: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Contact points that take turns.
        points: u16 = 16, unit "points", range 1..=64_u16;
        /// Maximum distance of an impact from the surface, relative to the size of the object.
        max_off_surface: f64 = 0.05, unit "", range 0.0..=1000.0;
        /// Position of the origin of the shape in the frame of the object.
        origin: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -1_000_000.0..=1_000_000.0;
    }
}
ports! {
    pub struct ImpactProjectorPorts / ImpactProjectorIo {
        in {
            /// The impacts.
            impacts: Events<Impact>,
            /// The surface of the object.
            shapes: Value<ModeShapes>,
        }
        out {
            /// The impacts on this object: `local` is a point of its surface, and `point` the contact point.
            projected: Events<Impact>,
        }
    }
}

/// The node `ImpactProjector`.
#[derive(Debug)]
pub struct ImpactProjector {
    params: ImpactProjectorParams,
    shapes: Arc<ModeShapes>,
    index: SurfaceIndex,
    extent: f64,
    /// Impacts so far.
    count: u64,
    /// Impacts too far from the surface, and the largest distance, m.
    far: (u64, f64),
    /// Impacts on other objects.
    others: Unmatched<u32>,
}

impl ImpactProjector {
    fn project(&mut self, impact: &Impact) -> Option<Impact> {
        let p = &self.params;
        let position = [0, 1, 2].map(|k| f64::from(impact.local[k]) - p.origin[k]);
        let surface = self.shapes.surface();
        let (contact, distance) = self.index.nearest(surface, position)?;
        if distance > p.max_off_surface * self.extent {
            self.far = (self.far.0 + 1, self.far.1.max(distance));
            return None;
        }
        let point = (self.count % u64::from(p.points)) as u32;
        self.count += 1;
        Some(Impact { local: contact.position(surface).map(|x| x as f32), point, ..*impact })
    }
}

impl Node for ImpactProjector {
    type Params = ImpactProjectorParams;
    type Ports = ImpactProjectorPorts;
    const NAME: &'static str = "ImpactProjector";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 1000.0;

    fn shape(_: &ImpactProjectorParams, s: &mut Shape<'_, '_, ImpactProjectorPorts>) -> Result<(), Reject> {
        match s.value(ImpactProjectorPorts::shapes) {
            Some(shapes) => shapes.validate().map_err(|e| Reject::new("F078", e).at("shapes")),
            None => Ok(()),
        }
    }

    fn build(p: &ImpactProjectorParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let shapes = cx.value(ImpactProjectorPorts::shapes);
        shapes.validate().map_err(|e| Fault::new("F078", e).at("shapes"))?;
        let (index, extent) = (SurfaceIndex::new(shapes.surface()), shapes.surface().extent());
        Ok(Self {
            params: p.clone(),
            shapes,
            index,
            extent,
            count: 0,
            far: (0, 0.0),
            others: Unmatched::default(),
        })
    }

    fn run(&mut self, mut io: ImpactProjectorIo<'_>) -> Result<(), Fault> {
        let object = self.params.object;
        for (tick, impact) in io.impacts.events() {
            if object.is_some_and(|object| object != impact.object) {
                self.others.add(impact.object);
                continue;
            }
            if let Some(projected) = impact.is_valid().then(|| self.project(impact)).flatten() {
                io.projected.push(*tick, projected);
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: ImpactProjectorIo<'_>) -> Result<Summary, Fault> {
        let mut summary: Summary = vec![("impacts", self.count.into())];
        let (far, distance) = self.far;
        if far > 0 {
            let limit = self.params.max_off_surface * self.extent;
            summary.push(("left_out_off_the_surface", far.into()));
            let text = format!(
                "{far} impacts are up to {distance:.3} m from the surface, more than {limit:.3} m: have the log and the shape the same unit and frame?"
            );
            summary.push(("warning", text.into()));
        }
        Ok(summary)
    }

    fn silence(&self) -> Option<Silence> {
        let none = self.count == 0 && self.far.0 == 0;
        Silence::no_object("impact", self.params.object, self.others).filter(|_| none)
    }

    fn retune(&mut self, new: &ImpactProjectorParams) -> Retune {
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        (self.count, self.far, self.others) = (old.count, old.far, old.others);
    }

    archive_state!(count, far, others);

    fn trial(rng: &mut Rng) -> (ImpactProjectorParams, MemoryFiles) {
        let params = ImpactProjectorParams {
            object: [None, Some(1)][rng.below(2)],
            points: 1 + rng.below(5) as u16,
            max_off_surface: rng.between(0.0, 1.0),
            origin: [0.0; 3].map(|_| rng.between(-0.02, 0.02)),
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Data;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;
    use crate::modal::Body;

    #[test]
    fn impacts_move_to_the_surface_and_take_turns() {
        let shapes = ModeShapes::trial(&mut Rng::new(2));
        let hit = Impact::from_velocity(1.0, Body { mass: 0.1, restitution: 0.5 });
        let at = |local: [f32; 3], object| Impact { local, object, ..hit };
        // Below the face z = 0; on another object; far away; not a number.
        let impacts = vec![
            (1, at([0.02, 0.03, -0.001], 1)),
            (2, at([0.02, 0.03, -0.001], 2)),
            (3, at([0.02, 0.03, -1.0], 1)),
            (4, at([f32::NAN, 0.0, 0.0], 1)),
            (5, at([0.03, 0.02, -0.002], 1)),
            (6, at([0.03, 0.02, -0.002], 1)),
        ];
        let params = ImpactProjectorParams {
            object: Some(1),
            points: 2,
            ..ImpactProjectorParams::read(&|_| None).unwrap()
        };
        let standalone = Standalone::new::<ImpactProjector>(params)
            .events(ImpactProjectorPorts::impacts, impacts, ticks(0.1))
            .value(ImpactProjectorPorts::shapes, shapes);
        let run = standalone.run().unwrap();
        let found = run.events(ImpactProjectorPorts::projected);
        let points: Vec<(i64, u32)> = found.iter().map(|(tick, impact)| (*tick, impact.point)).collect();
        assert_eq!(points, [(1, 0), (5, 1), (6, 0)]);
        let [x, y, z] = found[0].1.local;
        assert!((x - 0.02).abs() < 1e-6 && (y - 0.03).abs() < 1e-6 && z.abs() < 1e-6);
        assert_eq!(run.summary[0].1.to_string(), "3");
        assert!(run.summary.iter().any(|(_, text)| text.to_string().contains("1.000 m from the surface")));
    }
}
