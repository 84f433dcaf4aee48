//! The node around [`Tracker`].

use super::force_filter::{ForceFilter, ForceRules, FrameForce, share, step};
use super::piece::PathPiece;
use super::queue::Queue;
use super::sample::{ContactSample, PathRules};
use super::tracker::{END_FADE, Tracker};
use crate::contact::vector::{Vec3, dot, sub, widen};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::silence::Silence;
use crate::core::time::{Tick, ticks};
use crate::core::unmatched::Unmatched;
use crate::rigid::{ContactFrame, ContactState, State};
use crate::spatial::pose::unit;
use crate::texture::Luma;
use crate::{archive_state, choices, params, ports};

/// Maximum number of queued pieces per contact.
const WAITING: usize = 32;

choices! {
    /// Body whose surface the path lies on.
    pub enum Side {
        /// The first body of the contact.
        A,
        /// The second body.
        B,
    }
}

choices! {
    /// Frame of reference of positions.
    pub enum Axes {
        /// The world: for surfaces at rest.
        World,
        /// The frame of the body, for moving surfaces; velocities then follow from the positions.
        Body,
    }
}

choices! {
    /// Interpolation between two frames.
    pub enum PathMode {
        /// A cubic through both, known one frame later.
        Hermite,
        /// Predicted at once from position and velocity, and corrected over the next frame.
        Extrapolate,
    }
}

choices! {
    /// Origin of velocities over the surface.
    pub enum Velocities {
        /// From the contacts, or from the last two positions if these have none.
        Given,
        /// From the positions before and after (Catmull and Rom); the path is known one frame later.
        Differences,
    }
}

params! {
    /// Follows contacts over a surface and outputs their paths as polynomials, which can be evaluated at any sample.
    ///
    /// A point `p` of a contact lies on the surface at `((p - origin) u, (p - origin) v)`, with `u` and `v` normalized. Between two
    /// frames the path is a cubic through positions and velocities; forces are linear and never below 0. A piece is known one frame after
    /// it begins (two with `Differences`, at once with `Extrapolate`): a constant latency that the plan shows.
    ///
    /// A contact begins within 2 ms. A contact has jumped if it is further from its predicted position than `teleport` pixels and than
    /// twice its travel in a frame: the old path continues and fades out in 2 ms while a new one fades in. The same happens when a
    /// number is used again for a new contact. A contact without new frames continues straight for two frames and then fades out in 5 ms;
    /// so does one that ends with a force above 0.
    ///
    /// Frames may come at any rate and unevenly; `frame` is the longest expected interval. Kinds of contact with an amplitude of 0 are
    /// followed, but silent.
    ///
    /// The force is averaged twice over the last `force_smooth` seconds, one frame of 60 Hz: solvers alternate between too much and too
    /// little force, and the sound must not depend on the rate of the log. The mean is causal and adds no latency; with frames of 1/60 s
    /// or longer it has no effect. What exceeds `force_limit` (`unsteady_limit` while a contact is unsteady) times the larger of the median
    /// over `force_median` seconds and the weight is an impact, which ImpactForce makes audible, and is left out. The weight is that of the effective mass; if none is known, that of
    /// the mass that the first impact had. The summary has the share of the friction work (friction coefficient times force times slip
    /// times time) in frames that sound, `friction_work_heard`, and the share of the smoothed work in these that was left out as part of
    /// impacts, `friction_work_of_impacts`.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008), section 4: contacts at the
    /// rate of the physics, forces at that of the sound. The interpolation between both is a choice.
    pub struct ContactPathParams {
        /// Body whose surface the path lies on.
        surface: Side = Side::A;
        /// Number of the first body; None for all.
        a: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Number of the second body; None for all.
        b: Option<u32> = None, unit "", range 0..=4_294_967_295_u32;
        /// Frame of reference of positions.
        frame_of: Axes = Axes::World;
        /// Origin of the surface.
        origin: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Direction of its first axis.
        u: [f64; 3] = [1.0, 0.0, 0.0], unit "", range -100_000.0..=100_000.0;
        /// Direction of its second axis.
        v: [f64; 3] = [0.0, 1.0, 0.0], unit "", range -100_000.0..=100_000.0;
        /// Also follows the position on the surface of the other body, in the frame of that body along the same directions.
        both: bool = false;
        /// Amplitude of sliding contacts.
        sliding: f32 = 1.0, unit "", range 0.0..=1000.0_f32;
        /// Amplitude of rolling contacts.
        rolling: f32 = 1.0, unit "", range 0.0..=1000.0_f32;
        /// Amplitude of contacts between rolling and sliding.
        mixed: f32 = 1.0, unit "", range 0.0..=1000.0_f32;
        /// Amplitude of contacts that neither slide, roll nor rest.
        unsteady: f32 = 1.0, unit "", range 0.0..=1000.0_f32;
        /// Interpolation between two frames.
        mode: PathMode = PathMode::Hermite;
        /// Origin of velocities over the surface.
        velocities: Velocities = Velocities::Given;
        /// Makes a path straight where the velocities are too large for its length.
        guard: bool = true;
        /// Joins all contacts of two bodies into one at the centre of their forces: points that an engine moves within one
        /// contact patch sound like noise.
        join: bool = false;
        /// Time constant of a low-pass over the positions against such noise; 0 for none, 0.02 for rough engines.
        smooth: f64 = 0.0, unit "s", range 0.0..=1.0;
        /// Time over which the force is averaged; 0 for none.
        force_smooth: f64 = 0.0166666666667, unit "s", range 0.0..=1.0;
        /// Time of the median to which the force is compared; 0 for no limit.
        force_median: f64 = 0.1, unit "s", range 0.0..=1.0;
        /// Largest force over the larger of median and weight.
        force_limit: f64 = 2.0, unit "", range 1.0..=1_000_000.0;
        /// The same while a contact is unsteady.
        unsteady_limit: f64 = 1.0, unit "", range 1.0..=1_000_000.0;
        /// Distance from the predicted position beyond which a contact has jumped, in pixels of the map.
        teleport: f64 = 8.0, unit "px", range 0.01..=1_000_000.0;
        /// Pixels per metre of that map without a linked image.
        density: f64 = 512.0, unit "px/m", range 0.1..=1_000_000.0;
        /// Longest interval between two frames of the physics; ContactLog reports it as `longest_frame_ms`.
        frame: f64 = 1.0 / 60.0, unit "s", range 0.0005..=0.5;
        /// Number of the object that is excited.
        object: u32 = 0, unit "", range 0..=4_294_967_295_u32;
        /// Maximum number of simultaneous contacts.
        most: u16 = 256, unit "contacts", range 1..=4096_u16;
    }
}
ports! {
    pub struct ContactPathPorts / ContactPathIo {
        in {
            /// Contacts with their kinds.
            contacts: Events<ContactState>,
            /// Image of the surface, whose pixel size replaces `density`.
            image: Option<Value<Luma>>,
        }
        out {
            /// Paths of the contacts over the surface.
            paths: Events<PathPiece>,
        }
    }
}

/// The node `ContactPath`.
#[derive(Debug)]
pub struct ContactPath {
    params: ContactPathParams,
    axes: [Vec3; 2],
    tracker: Tracker,
    queue: Queue,
    /// Contacts of one pair at one time, while they are being joined.
    pairs: Vec<(ContactSample, FrameForce, f64)>,
    forces: ForceFilter,
    /// Frames of contacts of each kind.
    kinds: [u64; State::ALL.len()],
    /// Contacts of other pairs.
    others: Unmatched<[u32; 2]>,
    /// All contacts before this time have been processed.
    processed: Tick,
    /// Pixels per metre of the linked image.
    density: Option<f64>,
}

fn rules(p: &ContactPathParams, density: Option<f64>) -> PathRules {
    PathRules {
        frame: ticks(p.frame),
        look_ahead: p.mode == PathMode::Hermite,
        differences: p.velocities == Velocities::Differences || p.frame_of == Axes::Body,
        guard: p.guard,
        teleport: p.teleport / density.unwrap_or(p.density),
        object: p.object,
        smooth: p.smooth,
    }
}

fn force_rules(p: &ContactPathParams) -> ForceRules {
    ForceRules {
        smooth: p.force_smooth,
        median: p.force_median,
        limit: p.force_limit,
        unsteady_limit: p.unsteady_limit,
    }
}

fn axes(p: &ContactPathParams) -> Result<[Vec3; 2], Reject> {
    let refuse = |field: &str, message: String| {
        let help = "give two directions in the surface, such as u: [1, 0, 0] and v: [0, 1, 0]";
        Reject::new("F129", message).at(field).help(help)
    };
    let unit_of =
        |name: &str, v: Vec3| unit(v).ok_or_else(|| refuse(name, format!("`{name}` is {v:?}: no direction")));
    let (u, v) = (unit_of("u", p.u)?, unit_of("v", p.v)?);
    if dot(u, v).abs() > 0.999 {
        return Err(refuse("v", format!("`u` {:?} and `v` {:?} point the same way", p.u, p.v)));
    }
    Ok([u, v])
}

/// Quantities of a contact that its force depends on.
fn frame_force(contact: &ContactState) -> FrameForce {
    let frame = &contact.frame;
    let along: f32 = frame.velocity.iter().zip(frame.normal).map(|(v, n)| v * n).sum();
    let approach = f64::from(frame.approach.unwrap_or(along.abs()));
    let slip = f64::from(contact.sliding);
    let known = |x: f64| if x.is_finite() { x.max(0.0) } else { 0.0 };
    FrameForce {
        step: step(frame.interval),
        approach: known(approach),
        slip: known(slip),
        unsteady: contact.state == State::Unsteady,
    }
}

impl ContactPath {
    fn takes(&self, frame: &ContactFrame) -> bool {
        let p = &self.params;
        p.a.is_none_or(|a| a == frame.bodies[0]) && p.b.is_none_or(|b| b == frame.bodies[1])
    }

    fn on_plane(&self, point: Vec3) -> [f64; 2] {
        self.axes.map(|axis| dot(sub(point, self.params.origin), axis))
    }

    fn weight(&self, state: State) -> f32 {
        match state {
            State::Unsteady => self.params.unsteady,
            State::Static => 0.0,
            State::Sliding => self.params.sliding,
            State::Rolling => self.params.rolling,
            State::Mixed => self.params.mixed,
        }
    }

    fn sample(&self, tick: Tick, contact: &ContactState) -> ContactSample {
        let (p, frame) = (&self.params, &contact.frame);
        let side = usize::from(p.surface == Side::B);
        let velocity = match p.frame_of {
            Axes::World if p.velocities == Velocities::Given => frame.travel[side],
            _ => None,
        };
        ContactSample {
            contact: frame.contact,
            tick,
            position: self.on_plane(if p.frame_of == Axes::World { frame.point } else { frame.local[side] }),
            velocity: velocity.map(|v| self.axes.map(|axis| dot(widen(v), axis))),
            other: p.both.then(|| self.axes.map(|axis| dot(frame.local[1 - side], axis))),
            force: frame.force.max(0.0),
            gain: self.weight(contact.state),
            mass: frame.mass.filter(|m| m.is_finite() && *m > 0.0),
            begins: frame.begins,
            ends: frame.ends,
        }
    }

    /// Merges a contact into the one of its pair.
    fn gather(&mut self, sample: ContactSample, frame: FrameForce, bodies: [u32; 2]) {
        let contact = PathPiece::pair(bodies);
        let sample = ContactSample { contact, ..sample };
        let weight = f64::from(sample.force) + 1e-9;
        let found = self.pairs.iter_mut().find(|(pair, ..)| pair.contact == contact);
        let Some((pair, pair_frame, total)) = found else {
            if self.pairs.len() < usize::from(self.params.most) {
                self.pairs.push((sample, frame, weight));
            } else {
                self.tracker.left_out += 1;
            }
            return;
        };
        if sample.ends != pair.ends {
            // Contacts that end do not count among those that last.
            if pair.ends {
                (*pair, *pair_frame, *total) = (sample, frame, weight);
            }
            pair.begins = false;
            return;
        }
        let share = weight / (*total + weight);
        let mix = |a: [f64; 2], b: [f64; 2]| std::array::from_fn(|k| a[k] + share * (b[k] - a[k]));
        pair.position = mix(pair.position, sample.position);
        pair.velocity = pair.velocity.zip(sample.velocity).map(|(a, b)| mix(a, b));
        pair.other = pair.other.zip(sample.other).map(|(a, b)| mix(a, b));
        pair.gain += share as f32 * (sample.gain - pair.gain);
        pair.force += sample.force;
        pair_frame.slip += share * (frame.slip - pair_frame.slip);
        pair_frame.approach = pair_frame.approach.max(frame.approach);
        pair_frame.unsteady |= frame.unsteady;
        pair.begins &= sample.begins;
        *total += weight;
    }

    /// Passes a contact on with the force that presses on its path.
    fn follow(&mut self, sample: ContactSample, frame: &FrameForce) {
        let force = self.forces.take(&sample, frame);
        self.tracker.frame(&ContactSample { force, ..sample }, &mut self.queue);
    }

    /// Processes the contacts of one time.
    fn take(&mut self, contacts: &[(Tick, ContactState)]) {
        let usable = |c: &ContactState| {
            let numbers = c.frame.point.iter().chain(c.frame.local.iter().flatten());
            c.frame.force.is_finite() && numbers.into_iter().all(|x| x.is_finite())
        };
        for (tick, contact) in contacts {
            if !self.takes(&contact.frame) {
                self.others.add(contact.frame.bodies);
                continue;
            }
            if !usable(contact) {
                continue;
            }
            if let Some(kind) = State::ALL.iter().position(|state| *state == contact.state) {
                self.kinds[kind] += 1;
            }
            self.tracker.due(*tick, &mut self.queue);
            let (sample, frame) = (self.sample(*tick, contact), frame_force(contact));
            if self.params.join {
                self.gather(sample, frame, contact.frame.bodies);
            } else {
                self.follow(sample, &frame);
            }
        }
        while let Some((sample, frame, _)) = self.pairs.pop() {
            self.follow(sample, &frame);
        }
    }
}

impl Node for ContactPath {
    type Params = ContactPathParams;
    type Ports = ContactPathPorts;
    const NAME: &'static str = "ContactPath";
    const VERSION: u32 = 5;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 50.0;

    fn shape(p: &ContactPathParams, s: &mut Shape<'_, '_, ContactPathPorts>) -> Result<(), Reject> {
        axes(p)?;
        let rules = rules(p, None);
        s.lookaround(ContactPathPorts::contacts, 0, rules.latency() as usize);
        s.tail(rules.stall() + rules.latency() + 2 * ticks(END_FADE));
        Ok(())
    }

    fn build(p: &ContactPathParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let room = usize::from(p.most);
        // Where pixels are longer along one axis than along the other, the mean of both.
        let density = cx.optional_value(ContactPathPorts::image).map(|image| {
            let [x, y] = image.surface.density;
            (x * y).sqrt()
        });
        let density = density.filter(|d| d.is_finite() && *d > 0.0);
        Ok(Self {
            axes: axes(p)?,
            tracker: Tracker::new(rules(p, density), room),
            queue: Queue::new(WAITING * room),
            pairs: Vec::with_capacity(room),
            forces: ForceFilter::new(force_rules(p), room),
            kinds: [0; State::ALL.len()],
            others: Unmatched::default(),
            params: p.clone(),
            processed: Tick::MIN,
            density,
        })
    }

    fn run(&mut self, mut io: ContactPathIo<'_>) -> Result<(), Fault> {
        let (_, to) = io.paths.window();
        let events = io.contacts.events();
        let mut fresh = &events[events.partition_point(|(tick, _)| *tick < self.processed)..];
        let latency = rules(&self.params, None).latency();
        while let Some((tick, _)) = fresh.first() {
            // Nothing that starts before that is changed any more: the queue stays short in windows of any length.
            self.queue.give(to.min(tick - latency), |tick, piece| io.paths.push(tick, piece));
            let (now, later) = fresh.split_at(fresh.partition_point(|(t, _)| t <= tick));
            self.take(now);
            fresh = later;
        }
        self.processed = to + latency;
        self.tracker.due(self.processed, &mut self.queue);
        self.queue.give(to, |tick, piece| io.paths.push(tick, piece));
        Ok(())
    }

    fn finish(&mut self, _: ContactPathIo<'_>) -> Result<Summary, Fault> {
        let t = &self.tracker;
        let mut summary: Summary = vec![("pieces", t.pieces.into()), ("jumps", t.jumps.into())];
        let left_out = t.left_out + self.queue.left_out;
        let others = [("late_frames", t.late), ("stalls", t.stalls), ("left_out", left_out)];
        summary.extend(others.into_iter().filter(|(_, n)| *n > 0).map(|(name, n)| (name, n.into())));
        let work = self.forces.work;
        if work.all > 0.0 {
            summary.push(("friction_work_heard", share(work.heard, work.all).into()));
            summary.push(("friction_work_of_impacts", (1.0 - share(work.limited, work.smoothed)).into()));
        }
        let warning = self.forces.jitter.warning(self.params.force_smooth);
        summary.extend(warning.map(|text| ("warning", text.into())));
        Ok(summary)
    }

    fn silence(&self) -> Option<Silence> {
        let (p, others) = (&self.params, self.others);
        if self.kinds.iter().all(|count| *count == 0) {
            let wanted = p.a.is_some() || p.b.is_some();
            return (wanted && !others.is_empty()).then_some(Silence::NoPair { a: p.a, b: p.b, others });
        }
        let kinds = State::ALL.into_iter().zip(self.kinds);
        if kinds.clone().any(|(state, count)| count > 0 && self.weight(state) > 0.0) {
            return None;
        }
        let kinds = kinds.map(|(state, count)| (state.word(), count, state != State::Static));
        Some(Silence::Unheard(kinds.collect()))
    }

    fn retune(&mut self, new: &ContactPathParams) -> Retune {
        let latency = |p: &ContactPathParams| rules(p, None).latency();
        let same = latency(new) == latency(&self.params) && new.most == self.params.most;
        match axes(new) {
            Ok(axes) if same && (new.frame_of, new.join) == (self.params.frame_of, self.params.join) => {
                self.axes = axes;
                self.tracker.set_rules(rules(new, self.density));
                self.forces.set_rules(force_rules(new));
                self.params = new.clone();
                Retune::Done
            }
            _ => Retune::Rebuild,
        }
    }

    fn adopt(&mut self, old: &mut Self) {
        self.tracker.take_state(&old.tracker);
        self.forces.take_state(&old.forces);
        (self.kinds, self.others) = (old.kinds, old.others);
        self.queue.take_state(&old.queue);
        if rules(&old.params, None).latency() == rules(&self.params, None).latency() {
            self.processed = old.processed;
        }
    }

    archive_state!(tracker, queue, pairs, forces, kinds, others, processed);

    fn trial(rng: &mut Rng) -> (ContactPathParams, MemoryFiles) {
        let params = ContactPathParams::trial(rng);
        let (a, b) = (params.a.map(|_| 0), params.b.map(|_| rng.below(3) as u32));
        let frame = [1.0 / 30.0, 1.0 / 60.0, 1.0 / 240.0][rng.below(3)];
        let teleport = rng.between(5.0, 1000.0);
        let u = [1.0, rng.between(-0.4, 0.4), 0.3];
        let v = [rng.between(-0.4, 0.4), 1.0, 0.1];
        let most = 1 + rng.below(6) as u16;
        (ContactPathParams { a, b, frame, teleport, u, v, most, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
