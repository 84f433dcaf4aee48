//! The node around [`LodSelector`].

use super::lod_selector::{LEVELS, LodRules, LodSelector};
use crate::contact::vector::{norm, sub};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Item;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, In, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::Tick;
use crate::rigid::ContactState;
use crate::scrape::path::piece::PathPiece;
use crate::scrape::path::queue::Queue;
use crate::spatial::Poses;
use crate::{archive_state, params, ports};

/// Maximum number of queued parts of pieces on one level, per contact.
const WAITING: usize = 24;

params! {
    /// Selects a level of detail for each contact, by its distance from the listener and a budget of computing time.
    ///
    /// Up to the first of `distances` a contact goes to `full` (isophotes or the whole map), up to the second to `split` (features and
    /// noise), then to `noise`, then to `spectrum` (noise from a spectrum), and beyond the last to no output. Link each output to
    /// excitations of its kind; an output without a link costs nothing. A level changes when a distance is passed by `hysteresis`, with a
    /// crossfade of equal power over 50 ms.
    ///
    /// With a `budget` the farthest contacts go down one level, repeatedly, until the sum of `costs` fits, and up again when there is
    /// room, each at most twice a second. Costs are fixed figures, not measurements, so that results are reproducible on every machine.
    ///
    /// With a link to `contacts_at` each contact has the distance of its own point from the listener; contacts that ContactPath joins
    /// have that of the point received last. Otherwise all contacts have one distance: that of the stream `distance`, such as a
    /// LiveControl, or of the parameter.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4.2, with two
    /// levels; the figures are choices.
    pub struct LodSelectParams {
        /// Distances at which the next level begins, rising.
        distances: [f64; 4] = [5.0, 15.0, 40.0, 100.0], unit "m", range 0.0..=1_000_000.0;
        /// Fraction of a distance by which a contact has to pass it.
        hysteresis: f64 = 0.1, unit "", range 0.0..=0.5;
        /// Distance of all contacts without a link.
        distance: f64 = 0.0, unit "m", range 0.0..=1_000_000.0;
        /// Position of the listener without a link.
        listener: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Cost of a contact on each level, in microseconds for 1024 samples. At up to 1 m/s and 44.1 kHz a core of a server takes 10
        /// for a map, 10 to 17 for isophotes, 10 for features and 12 for noise, however that is stored (`cargo bench -p foley-nodes --
        /// scrape isophotes`); `full` counts as much as `split`, so that a level down never costs more.
        costs: [f64; 4] = [22.0, 22.0, 12.0, 12.0], unit "us", range 0.0..=1_000_000.0;
        /// Maximum cost of all contacts together, in microseconds for 1024 samples; None for no limit.
        budget: Option<f64> = None, unit "us", range 0.0..=1_000_000.0;
        /// Maximum number of simultaneous contacts.
        contacts: u16 = 256, unit "contacts", range 1..=4096_u16;
    }
}
ports! {
    pub struct LodSelectPorts / LodSelectIo {
        in {
            /// Paths of the contacts.
            paths: Events<PathPiece>,
            /// The contacts themselves, for their distance.
            contacts_at: Option<Events<ContactState>>,
            /// Poses of the listener, which replace the parameter.
            listener: Option<Stream<Poses>>,
            /// Distance of all contacts, m, which replaces the parameter.
            distance: Option<Stream<f32>>,
        }
        out {
            /// Paths at the finest level.
            full: Events<PathPiece>,
            /// Paths for features and noise.
            split: Events<PathPiece>,
            /// Paths for noise.
            noise: Events<PathPiece>,
            /// Paths for noise from a spectrum.
            spectrum: Events<PathPiece>,
        }
    }
}

/// The node `LodSelect`.
#[derive(Debug)]
pub struct LodSelect {
    params: LodSelectParams,
    selector: LodSelector,
    queues: [Queue; LEVELS],
    /// Last positions of contacts.
    positions: Vec<(u64, [f64; 3])>,
}

fn rules(p: &LodSelectParams) -> LodRules {
    LodRules { distances: p.distances, hysteresis: p.hysteresis, costs: p.costs, budget: p.budget }
}

impl LodSelect {
    fn see(&mut self, contact: &ContactState) {
        let frame = &contact.frame;
        // The path that sounds may be that of all contacts of two bodies.
        for number in [frame.contact, PathPiece::pair(frame.bodies)] {
            self.see_at(number, frame.point);
        }
    }

    fn see_at(&mut self, number: u64, point: [f64; 3]) {
        if let Some(position) = self.positions.iter_mut().find(|(c, _)| *c == number) {
            position.1 = point;
        } else {
            if self.positions.len() >= 2 * usize::from(self.params.contacts) {
                // The oldest is dropped.
                self.positions.remove(0);
            }
            self.positions.push((number, point));
        }
    }

    fn distance(&self, io: &LodSelectIo<'_>, tick: Tick, contact: u64) -> f64 {
        let position =
            self.positions.iter().find(|(c, _)| *c == contact).filter(|_| io.contacts_at.is_some());
        if let Some((_, position)) = position {
            let at = io.listener.as_ref().and_then(|poses| latest(poses, tick));
            let at = at.map_or(self.params.listener, |pose| pose.position.map(f64::from));
            return norm(sub(*position, at));
        }
        let metres = io.distance.as_ref().and_then(|distance| latest(distance, tick));
        metres.map_or(self.params.distance, |d| f64::from(d).max(0.0))
    }
}

/// The last item of a stream up to a time in the window, by its first element.
fn latest<T: Item>(stream: &In<'_, T>, tick: Tick) -> Option<T::Elem> {
    let at = stream.rate().first_at(tick + 1) - 1 - stream.first();
    let at = at.clamp(-(stream.behind() as i64), stream.len() as i64 - 1);
    (at >= -(stream.behind() as i64)).then(|| stream.item(at as isize).first().copied()).flatten()
}

impl Node for LodSelect {
    type Params = LodSelectParams;
    type Ports = LodSelectPorts;
    const NAME: &'static str = "LodSelect";
    const VERSION: u32 = 4;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 50.0;

    fn shape(p: &LodSelectParams, s: &mut Shape<'_, '_, LodSelectPorts>) -> Result<(), Reject> {
        if !p.distances.windows(2).all(|w| w[0] <= w[1]) {
            let message = format!("`distances` are {:?}, which do not rise", p.distances);
            let help = "give the ends of full, split, noise and spectrum in this order";
            return Err(Reject::new("F130", message).at("distances").help(help));
        }
        s.when_ended(LodSelectPorts::paths, Ends::Stop);
        s.lookaround(LodSelectPorts::listener, 1, 0);
        s.when_ended(LodSelectPorts::listener, Ends::Hold);
        s.lookaround(LodSelectPorts::distance, 1, 0);
        s.when_ended(LodSelectPorts::distance, Ends::Hold);
        Ok(())
    }

    fn build(p: &LodSelectParams, _: &Build<'_>) -> Result<Self, Fault> {
        let room = usize::from(p.contacts);
        Ok(Self {
            selector: LodSelector::new(rules(p), room),
            queues: [(); LEVELS].map(|()| Queue::new(WAITING * room)),
            positions: Vec::with_capacity(2 * room),
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: LodSelectIo<'_>) -> Result<(), Fault> {
        let (_, to) = io.paths.window();
        let mut read = 0;
        for k in 0..io.paths.events().len() {
            let Some((tick, piece)) = io.paths.events().get(k).copied() else { break };
            while let Some((_, contact)) =
                io.contacts_at.as_ref().and_then(|c| c.events().get(read)).filter(|(t, _)| *t <= tick)
            {
                self.see(contact);
                read += 1;
            }
            let distance = self.distance(&io, tick, piece.contact);
            self.give(&mut io, tick);
            self.selector.take(tick, &piece, distance, &mut self.queues);
        }
        for (_, contact) in io.contacts_at.iter().flat_map(|c| c.events().iter().skip(read)) {
            self.see(contact);
        }
        self.give(&mut io, to);
        Ok(())
    }

    fn finish(&mut self, _: LodSelectIo<'_>) -> Result<Summary, Fault> {
        let left_out = self.selector.left_out + self.queues.iter().map(|q| q.left_out).sum::<u64>();
        let mut summary: Summary =
            vec![("changes", self.selector.changes.into()), ("peak_cost_us", self.selector.peak.into())];
        if left_out > 0 {
            summary.push(("left_out", left_out.into()));
        }
        Ok(summary)
    }

    fn retune(&mut self, new: &LodSelectParams) -> Retune {
        if new.contacts != self.params.contacts {
            return Retune::Rebuild;
        }
        self.selector.set_rules(rules(new));
        self.params = new.clone();
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.selector.take_state(&old.selector);
        self.queues.iter_mut().zip(&old.queues).for_each(|(new, old)| new.take_state(old));
        if self.params.contacts == old.params.contacts {
            self.positions.clone_from(&old.positions);
        }
    }

    archive_state!(selector, each queues, positions);

    fn trial(rng: &mut Rng) -> (LodSelectParams, MemoryFiles) {
        let params = LodSelectParams::trial(rng);
        let mut far = 0.0;
        let distances = [(); 4].map(|()| {
            far += rng.between(0.1, 1.0);
            far
        });
        let (distance, budget) = (rng.between(0.0, 3.0), params.budget.map(|_| rng.between(10.0, 60.0)));
        let costs = [25.0, 20.0, 10.0, 8.0];
        let contacts = 2 + rng.below(5) as u16;
        let listener = [(); 3].map(|()| rng.between(-1.0, 1.0));
        (
            LodSelectParams { distances, distance, budget, costs, contacts, listener, ..params },
            MemoryFiles::default(),
        )
    }
}

impl LodSelect {
    fn give(&mut self, io: &mut LodSelectIo<'_>, until: Tick) {
        let [full, split, noise, spectrum] = &mut self.queues;
        full.give(until, |tick, piece| io.full.push(tick, piece));
        split.give(until, |tick, piece| io.split.push(tick, piece));
        noise.give(until, |tick, piece| io.noise.push(tick, piece));
        spectrum.give(until, |tick, piece| io.spectrum.push(tick, piece));
    }
}

#[cfg(test)]
mod tests;
