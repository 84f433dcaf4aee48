//! Supports at fixed points of an object.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick, ticks};
use crate::rigid::ContactFrame;
use crate::{params, ports};

params! {
    /// Contacts at rest at given points of an object: a table below it, or fingers that hold it.
    ///
    /// Each point is one contact of body 0 with the object, from `start` to `stop`, at 60 frames per second.
    pub struct SupportContactsParams {
        /// Positions of the supports on the object.
        points: Vec<[f64; 3]>, unit "m", range -1_000_000.0..=1_000_000.0;
        /// Normal force of each support, or of all.
        forces: Vec<f64> = vec![1.0], unit "N", range 0.0..=1.0e6_f64;
        /// Time at which the supports begin.
        start: f64 = 0.0, unit "s", range 0.0..=86_400.0;
        /// Time at which they end.
        stop: f64, unit "s", range 0.0..=86_400.0;
        /// Number of the object.
        body: u32 = 1, unit "", range 1..=4_294_967_295_u32;
    }
}
ports! {
    pub struct SupportContactsPorts / SupportContactsIo {
        in {}
        out {
            /// The contacts, one event per support and frame.
            contacts: Events<ContactFrame>,
        }
    }
}

/// Frames per second.
const FRAMES: Rate = Rate::hz(60);

/// The node `SupportContacts`.
#[derive(Debug)]
pub struct SupportContacts {
    params: SupportContactsParams,
}

fn check(p: &SupportContactsParams) -> Result<(), Reject> {
    let (points, forces) = (p.points.len(), p.forces.len());
    if points == 0 {
        return Err(Reject::new("F078", "there is no support").at("points"));
    }
    if forces != 1 && forces != points {
        let message = format!("{forces} forces for {points} supports; one, or one for each, is needed");
        return Err(Reject::new("F078", message).at("forces"));
    }
    if p.stop < p.start {
        let message = format!("the supports end at {} s, before they begin at {} s", p.stop, p.start);
        return Err(Reject::new("F078", message).at("stop"));
    }
    Ok(())
}

impl SupportContacts {
    fn frame(&self, support: usize, begins: bool, ends: bool) -> ContactFrame {
        let p = &self.params;
        let (point, force) = (p.points[support], p.forces[support.min(p.forces.len() - 1)]);
        ContactFrame {
            contact: support as u64,
            bodies: [0, p.body],
            interval: FRAMES.span(1),
            point,
            local: [point; 2],
            normal: [0.0, 0.0, 1.0],
            force: if ends { 0.0 } else { force as f32 },
            friction: None,
            velocity: [0.0; 3],
            travel: [None; 2],
            approach: None,
            depth: None,
            mass: None,
            begins,
            ends,
        }
    }
}

impl Node for SupportContacts {
    type Params = SupportContactsParams;
    type Ports = SupportContactsPorts;
    const NAME: &'static str = "SupportContacts";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Audio;

    fn shape(p: &SupportContactsParams, s: &mut Shape<'_, '_, SupportContactsPorts>) -> Result<(), Reject> {
        check(p)?;
        s.ends(Some(ticks(p.stop) + 1));
        Ok(())
    }

    fn build(p: &SupportContactsParams, _: &Build<'_>) -> Result<Self, Fault> {
        check(p)?;
        Ok(Self { params: p.clone() })
    }

    fn run(&mut self, mut io: SupportContactsIo<'_>) -> Result<(), Fault> {
        let (from, to) = io.contacts.window();
        let (start, stop): (Tick, Tick) = (ticks(self.params.start), ticks(self.params.stop));
        let supports = 0..self.params.points.len();
        let mut frame = FRAMES.first_at(from.max(start) - start).max(0);
        loop {
            let tick = start + FRAMES.tick(frame);
            if tick >= to.min(stop) {
                break;
            }
            for support in supports.clone() {
                io.contacts.push(tick, self.frame(support, frame == 0, false));
            }
            frame += 1;
        }
        if (from..to).contains(&stop) && stop > start {
            for support in supports {
                io.contacts.push(stop, self.frame(support, false, true));
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: SupportContactsIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("supports", self.params.points.len().into())])
    }

    fn trial(rng: &mut Rng) -> (SupportContactsParams, MemoryFiles) {
        let count = 1 + rng.below(3);
        let start = rng.between(0.0, 0.2);
        let params = SupportContactsParams {
            points: (0..count).map(|_| [0.0; 3].map(|_| rng.between(0.0, 0.1))).collect(),
            forces: (0..if rng.below(2) == 0 { 1 } else { count }).map(|_| rng.between(0.0, 5.0)).collect(),
            start,
            stop: start + rng.between(0.0, 0.5),
            body: 1 + rng.below(2) as u32,
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    fn params() -> SupportContactsParams {
        SupportContactsParams {
            points: vec![[0.0; 3], [0.1, 0.0, 0.0]],
            forces: vec![2.0, 3.0],
            start: 0.1,
            stop: 0.3,
            body: 1,
        }
    }

    #[test]
    fn supports_begin_stay_and_end() {
        let run = |window: Tick| {
            let standalone = Standalone::new::<SupportContacts>(params()).window(window);
            standalone.run().unwrap().events(SupportContactsPorts::contacts)
        };
        let events = run(ticks(0.05));
        // 12 frames of 1/60 s, and the end.
        assert_eq!(events.len(), 2 * 13);
        assert!(events[..2].iter().all(|(tick, f)| *tick == ticks(0.1) && f.begins));
        assert!(events[24..].iter().all(|(tick, f)| *tick == ticks(0.3) && f.ends && f.force == 0.0));
        assert_eq!((events[0].1.force, events[1].1.force, events[1].1.local[1]), (2.0, 3.0, [0.1, 0.0, 0.0]));
        for window in [ticks(0.001), 1_000_003, ticks(5.0)] {
            assert_eq!(run(window), events);
        }
    }

    #[test]
    fn lists_and_times_that_do_not_fit_are_refused() {
        let refused = |p| Standalone::new::<SupportContacts>(p).shape().unwrap_err().message;
        assert!(refused(SupportContactsParams { points: vec![], ..params() }).contains("no support"));
        let forces = SupportContactsParams { forces: vec![1.0; 3], ..params() };
        assert!(refused(forces).contains("3 forces for 2 supports"));
        assert!(refused(SupportContactsParams { stop: 0.05, ..params() }).contains("before they begin"));
    }
}
