//! What kind of contact it is, and when it strikes.

use super::history::{History, Sample};
use super::item::{ContactFrame, ContactState, State};
use crate::choices;
use crate::contact::vector::{Vec3, dot, norm, scale, sub, widen};
use crate::core::time::{Tick, seconds, ticks};
use crate::impl_state;
use crate::modal::Impact;
use serde::{Deserialize, Serialize};

choices! {
    /// How amplitude follows from power.
    pub enum PowerLaw {
        /// As its root: sound has the energy of the contact.
        Sqrt,
        /// In proportion, as in the paper.
        Linear,
    }
}

choices! {
    /// Which of two bodies sounds when they strike each other.
    pub enum Struck {
        /// Either: one blow each.
        Both,
        /// Body a, the one with the smaller number.
        A,
        /// Body b.
        B,
    }
}

/// All numbers that contacts are judged by, in SI units.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Rules {
    /// Longest time between two frames.
    pub frame: f64,
    /// Where within its frame a force stands: 0 at its start, 1 at its end.
    pub moment: f64,
    /// Time over which force is averaged before it is judged.
    pub blend: f64,
    pub impact_force: f64,
    pub impact_memory: f64,
    pub impact_median: f64,
    pub impact_approach: f64,
    pub refractory: f64,
    pub restitution: f64,
    pub hardness: f64,
    pub struck: Struck,
    pub held: f64,
    pub held_frames: usize,
    pub steady_window: f64,
    pub steady_enter: f64,
    pub steady_leave: f64,
    pub rolling_slip: f64,
    pub rolling_share: f64,
    pub rolling_speed: f64,
    pub rolling_leave: f64,
    pub sliding_speed: f64,
    pub sliding_leave: f64,
    pub static_speed: f64,
    pub dwell: f64,
    pub friction: f64,
    pub rolling_resistance: f64,
    pub law: PowerLaw,
    pub power_ref: f64,
    /// Least and greatest gain, dB.
    pub range: [f64; 2],
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            frame: 1.0 / 60.0,
            moment: 0.5,
            blend: 1.0 / 60.0,
            impact_force: 0.5,
            impact_memory: 0.1,
            impact_median: 0.25,
            impact_approach: 0.05,
            refractory: 0.03,
            restitution: 0.5,
            hardness: 1.0,
            struck: Struck::Both,
            held: 0.05,
            held_frames: 3,
            steady_window: 0.1,
            steady_enter: 0.35,
            steady_leave: 0.6,
            rolling_slip: 0.02,
            rolling_share: 0.05,
            rolling_speed: 0.02,
            rolling_leave: 0.01,
            sliding_speed: 0.05,
            sliding_leave: 0.03,
            static_speed: 0.02,
            dwell: 0.1,
            friction: 0.4,
            rolling_resistance: 0.02,
            law: PowerLaw::Sqrt,
            power_ref: 1.0,
            range: [-60.0, 12.0],
        }
    }
}

impl Rules {
    /// How far behind the frames the results come: a frame is judged when the next one is there, or late, and may have struck
    /// half a frame before its end.
    #[must_use]
    pub fn latency(&self) -> Tick {
        2 * ticks(self.frame)
    }

    /// How long a frame waits for the next one.
    fn patience(&self) -> Tick {
        ticks(self.frame) * 3 / 2
    }

    /// How long a contact may be silent without being another one.
    fn silence(&self) -> Tick {
        ticks(self.frame) * 5 / 2
    }

    fn gain(&self, power: f64) -> f64 {
        if power <= 0.0 {
            return 0.0;
        }
        let ratio = power / self.power_ref;
        let gain = if self.law == PowerLaw::Sqrt { ratio.sqrt() } else { ratio };
        gain.clamp(10_f64.powf(self.range[0] / 20.0), 10_f64.powf(self.range[1] / 20.0))
    }
}

/// What is known of one contact.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Known {
    contact: u64,
    latest: ContactFrame,
    history: History,
    begun: Tick,
    last: Tick,
    state: State,
    steady: bool,
    changed: Option<Tick>,
    struck: Option<Tick>,
    /// The latest frame waits for the next one before it is judged.
    waits: bool,
    place: Vec3,
    /// Speed over the surface of a, where it has to be found from places.
    travel: Option<Vec3>,
}

/// Tells blows from contacts that last.
///
/// # Complexity
/// Per frame of a contact linear in the frames of the last quarter second, of which at most 64 are kept; no allocation.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.2: impacts are
/// peaks of force and of relative speed, rolling is continuous contact without relative speed. All numbers are choices of this project, as
/// are the powers of sliding and rolling: force times velocity, as the paper has it, vanishes for both.
#[derive(Debug)]
pub struct Classifier {
    rules: Rules,
    known: Vec<Known>,
    most: usize,
    /// Blows that are found, with the contact that struck; in the order of time.
    impacts: Vec<(Tick, u64, Impact)>,
    /// Blows so far.
    pub struck: u64,
    /// Frames that were no numbers.
    pub wrong: u64,
    /// Contacts and blows beyond what there is room for.
    pub dropped: u64,
    /// Frames per state.
    pub frames: [u64; 5],
}
impl_state!(Classifier { known, impacts, struck, wrong, dropped, frames });

/// Blows that can wait to be given.
const ROOM: usize = 1024;

/// Slip along the surface, m/s.
fn slip(frame: &ContactFrame) -> (Vec3, f64) {
    let (v, n) = (widen(frame.velocity), widen(frame.normal));
    let along = dot(v, n);
    (sub(v, scale(n, along)), along)
}

impl Classifier {
    /// A classifier of at most so many contacts at a time.
    #[must_use]
    pub fn new(rules: Rules, most: usize) -> Self {
        Self {
            rules,
            known: Vec::with_capacity(most),
            most,
            impacts: Vec::with_capacity(ROOM),
            struck: 0,
            wrong: 0,
            dropped: 0,
            frames: [0; 5],
        }
    }

    /// Other rules from the next frame on.
    pub fn set_rules(&mut self, rules: &Rules) {
        self.rules.clone_from(rules);
    }

    /// Goes on with the contacts of another one; allocates nothing.
    pub fn take_state(&mut self, old: &Self) {
        self.known.clear();
        self.known.extend(old.known.iter().take(self.most).copied());
        self.impacts.clear();
        self.impacts.extend_from_slice(&old.impacts);
        (self.struck, self.wrong, self.dropped, self.frames) =
            (old.struck, old.wrong, old.dropped, old.frames);
    }

    /// Takes the next frame of a contact; frames come in the order of time. `None` for one that is not finite.
    pub fn take(&mut self, tick: Tick, frame: &ContactFrame) -> Option<ContactState> {
        let numbers = [frame.force, frame.approach.unwrap_or(0.0), frame.mass.unwrap_or(0.0)];
        let vectors =
            frame.normal.iter().chain(&frame.velocity).chain(frame.travel.iter().flatten().flatten());
        let vectors = vectors.chain(frame.friction.iter().flatten());
        if !numbers.iter().chain(vectors).all(|x| x.is_finite()) || !frame.point.iter().all(|x| x.is_finite())
        {
            self.wrong += 1;
            return None;
        }
        // What is due is judged now, so that nothing hangs on how time is cut into windows.
        self.pass(tick);
        let place = self.known.iter().position(|k| k.contact == frame.contact);
        let mut known = match place.map(|k| self.known.swap_remove(k)) {
            Some(known) if !frame.begins => known,
            old => {
                if let Some(mut old) = old.filter(|old| old.waits) {
                    self.judge(&mut old, None);
                }
                Known::new(tick, frame)
            }
        };
        let state = self.advance(&mut known, tick, frame);
        if frame.ends {
            self.judge(&mut known, None);
            return Some(state);
        }
        if self.known.len() >= self.most {
            self.make_room();
        }
        if self.known.len() < self.most {
            self.known.push(known);
        }
        Some(state)
    }

    /// Drops the contact that has been silent for the longest time.
    fn make_room(&mut self) {
        let oldest = self.known.iter().enumerate().min_by_key(|(_, known)| (known.last, known.contact));
        if let Some(k) = oldest.map(|(k, _)| k) {
            self.known.swap_remove(k);
            self.dropped += 1;
        }
    }

    /// Says that all frames before a time have been taken.
    pub fn pass(&mut self, now: Tick) {
        let (patience, silence) = (self.rules.patience(), self.rules.silence());
        let mut k = 0;
        while let Some((waits, last)) = self.known.get(k).map(|known| (known.waits, known.last)) {
            if waits && last + patience < now {
                self.judge_at(k);
            }
            if last + silence < now {
                self.known.swap_remove(k);
            } else {
                k += 1;
            }
        }
    }

    /// Judges the latest frame of a contact as one that none follows.
    fn judge_at(&mut self, k: usize) {
        let Some(mut known) = self.known.get(k).copied() else { return };
        self.judge(&mut known, None);
        if let Some(place) = self.known.get_mut(k) {
            *place = known;
        }
    }

    /// The next blow before a time.
    pub fn next_impact(&mut self, before: Tick) -> Option<(Tick, Impact)> {
        let (tick, _, impact) = *self.impacts.first().filter(|(tick, ..)| *tick < before)?;
        self.impacts.remove(0);
        Some((tick, impact))
    }

    fn advance(&mut self, known: &mut Known, tick: Tick, frame: &ContactFrame) -> ContactState {
        let step = seconds(frame.interval).clamp(1e-6, 1.0);
        let (slipping, along) = slip(frame);
        let sliding = norm(slipping);
        let rolling = known.travelled(frame, step);
        let mass = frame.mass.filter(|m| *m > 0.0).map(f64::from);
        // An engine that does not tell how fast bodies met has their speed after the blow.
        let approach = match (frame.approach, frame.begins) {
            (Some(v), _) => f64::from(v).max(0.0),
            (None, false) => (-along).max(0.0),
            (None, true) => {
                let impulse = f64::from(frame.force) * step;
                let met = mass.map_or(0.0, |m| impulse / (m * (1.0 + self.rules.restitution)));
                along.abs().max(met)
            }
        };
        let sample = Sample {
            tick,
            step,
            force: f64::from(frame.force).max(0.0),
            mean: 0.0,
            approach,
            normal: approach.max(along.abs()),
            speed: norm(widen(frame.velocity)).max(approach),
            along: sliding.max(rolling),
        };
        known.history.push(sample);
        let mean = known.history.mean_force(self.rules.blend);
        known.history.set_mean(mean);
        if known.waits {
            self.judge(known, Some(Sample { mean, ..sample }));
        }
        known.latest = *frame;
        known.last = tick;
        known.waits = true;
        let variation = self.settle(known, tick, sliding, rolling);
        let before =
            known.history.least_force(0, self.rules.impact_memory).filter(|_| !self.young(known, tick));
        ContactState {
            variation: variation.unwrap_or_default().map(|x| x as f32),
            prominence: (mean - before.unwrap_or_default().1) as f32,
            median: known.history.median_force(0, self.rules.impact_median).unwrap_or(0.0) as f32,
            ..self.state(known, frame, slipping, rolling)
        }
    }

    /// Whether a contact is so young that nothing pressed within the memory.
    fn young(&self, known: &Known, tick: Tick) -> bool {
        tick - known.begun < ticks(self.rules.impact_memory)
    }

    /// The state of a contact after its latest frame; tells how much force and speed vary, where that is known.
    fn settle(&mut self, known: &mut Known, tick: Tick, sliding: f64, rolling: f64) -> Option<[f64; 2]> {
        let rules = &self.rules;
        let held = tick - known.begun >= ticks(rules.held) && known.history.count >= rules.held_frames;
        let limit = if known.steady { rules.steady_leave } else { rules.steady_enter };
        // What hardly moves or presses is steady, whatever its noise.
        let least = [rules.impact_force, rules.static_speed];
        let variation = known.history.variation(rules.steady_window, least);
        known.steady = held && variation.is_some_and(|v| v.iter().all(|v| *v < limit));
        let next = if known.steady { self.kind(known.state, sliding, rolling) } else { State::Unsteady };
        let settled = known.changed.is_none_or(|at| tick - at >= ticks(self.rules.dwell));
        if next != known.state && settled {
            known.state = next;
            known.changed = Some(tick);
        }
        if let Some(count) = self.frames.get_mut(known.state as usize) {
            *count += 1;
        }
        variation
    }

    /// What kind of steady contact these speeds make, after a state.
    fn kind(&self, before: State, sliding: f64, rolling: f64) -> State {
        let rules = &self.rules;
        let most = rules.rolling_slip.max(rules.rolling_share * rolling);
        let rolls = match before {
            State::Rolling => sliding <= 2.0 * most && rolling >= rules.rolling_leave,
            _ => sliding <= most && rolling >= rules.rolling_speed,
        };
        let slides = match before {
            State::Sliding => sliding >= rules.sliding_leave,
            _ => sliding >= rules.sliding_speed,
        };
        let rests = sliding < rules.static_speed && rolling < rules.static_speed;
        match before {
            State::Rolling if rolls => State::Rolling,
            State::Sliding if slides => State::Sliding,
            _ if rests => State::Static,
            _ if rolls => State::Rolling,
            _ if slides => State::Sliding,
            State::Unsteady | State::Static => State::Mixed,
            other => other,
        }
    }

    fn state(&self, known: &Known, frame: &ContactFrame, slipping: Vec3, rolling: f64) -> ContactState {
        let sliding = norm(slipping);
        let share = if sliding > 0.0 { (sliding / rolling.max(sliding)).min(1.0) } else { 0.0 };
        let slip = match known.state {
            State::Sliding => 1.0,
            State::Rolling | State::Static => 0.0,
            State::Mixed | State::Unsteady => share,
        };
        let force = f64::from(frame.force);
        let rubbing =
            frame.friction.map_or(self.rules.friction * force * sliding, |f| dot(widen(f), slipping).abs());
        let turning = self.rules.rolling_resistance * force * rolling;
        let power = if known.state == State::Static { 0.0 } else { slip * rubbing + (1.0 - slip) * turning };
        let sounds = matches!(known.state, State::Sliding | State::Rolling | State::Mixed);
        ContactState {
            frame: *frame,
            state: known.state,
            slip: slip as f32,
            power: power as f32,
            gain: if sounds { self.rules.gain(power) as f32 } else { 0.0 },
            sliding: sliding as f32,
            rolling: rolling as f32,
            variation: [0.0; 2],
            prominence: 0.0,
            median: 0.0,
        }
    }

    /// Decides whether the frame that waits is a blow, knowing the one after it, or that there is none.
    fn judge(&mut self, known: &mut Known, next: Option<Sample>) {
        known.waits = false;
        let age = usize::from(next.is_some());
        let Some(here) = known.history.back(age) else { return };
        let before = known.history.back(age + 1);
        let rules = &self.rules;
        let first = before.is_none();
        let (f_before, f_next) = (before.map_or(0.0, |s| s.force), next.map_or(0.0, |s| s.force));
        let recent = known.struck.is_some_and(|at| here.tick - at < ticks(rules.refractory));
        let approach = here.approach.max(before.map_or(0.0, |s| s.approach));
        if recent || approach < rules.impact_approach || here.force <= 0.0 {
            return;
        }
        // Before the contact began nothing pressed.
        let least =
            known.history.least_force(age, rules.impact_memory).filter(|_| !self.young(known, here.tick));
        let (least, least_mean) = least.unwrap_or_default();
        if !first {
            let median = known.history.median_force(age, rules.impact_median).unwrap_or(0.0);
            let peak = here.force > f_before && here.force >= f_next;
            let mean = here.mean.max(next.map_or(0.0, |s| s.mean));
            let stands_out = mean - least_mean >= rules.impact_force.max(median);
            if !peak || !stands_out || !known.history.speed_peaks(age) {
                return;
            }
        }
        let curve = f_before - 2.0 * here.force + f_next;
        let vertex = if curve < 0.0 { (0.5 * (f_before - f_next) / curve).clamp(-0.5, 0.5) } else { 0.0 };
        let late = (rules.moment - 1.0 + vertex).clamp(-1.0, 0.5) * here.step;
        let earliest = here.tick - ticks(rules.frame) / 2;
        let at = (here.tick + ticks(late)).max(earliest).max(0);
        // Neighbours that still press much belong to the same blow.
        let part =
            |s: Sample| if s.force >= 0.25 * here.force { (s.force - least).max(0.0) * s.step } else { 0.0 };
        let impulse = (here.force - least) * here.step + before.map_or(0.0, part) + next.map_or(0.0, part);
        known.struck = Some(here.tick);
        let blow = self.blow(&known.latest, impulse, approach);
        self.strike(at, known.contact, blow, known.latest.bodies);
    }

    fn blow(&self, frame: &ContactFrame, impulse: f64, approach: f64) -> Impact {
        let bounce = 1.0 + self.rules.restitution;
        let told = frame.mass.filter(|m| *m > 0.0).map(f64::from);
        let mass = told.unwrap_or(impulse / (approach * bounce));
        Impact {
            impulse: impulse as f32,
            energy: (0.5 * mass * approach * approach) as f32,
            hardness: self.rules.hardness as f32,
            duration: 0.0,
            object: 0,
            point: 0,
            position: frame.point.map(|x| x as f32),
        }
    }

    fn strike(&mut self, at: Tick, contact: u64, blow: Impact, bodies: [u32; 2]) {
        let struck: &[u32] = match self.rules.struck {
            Struck::Both => &bodies,
            Struck::A => &bodies[..1],
            Struck::B => &bodies[1..],
        };
        self.struck += 1;
        for object in struck {
            if self.impacts.len() == ROOM {
                self.dropped += 1;
                return;
            }
            let impact = Impact { object: *object, ..blow };
            let key = (at, contact, *object);
            let place = self.impacts.partition_point(|(t, c, i)| (*t, *c, i.object) <= key);
            self.impacts.insert(place, (at, contact, impact));
        }
    }
}

impl Known {
    fn new(tick: Tick, frame: &ContactFrame) -> Self {
        Self {
            contact: frame.contact,
            latest: *frame,
            history: History::new(),
            begun: tick,
            last: tick,
            state: State::Unsteady,
            steady: false,
            changed: None,
            struck: None,
            waits: false,
            place: frame.local[0],
            travel: None,
        }
    }

    /// Speed of the contact point over the surface of a: told, or found from its places.
    fn travelled(&mut self, frame: &ContactFrame, step: f64) -> f64 {
        const SMOOTH: f64 = 0.02;
        if let Some(travel) = frame.travel[0] {
            return norm(widen(travel));
        }
        if self.history.count > 0 {
            let now = scale(sub(frame.local[0], self.place), 1.0 / step);
            let part = 1.0 - (-step / SMOOTH).exp();
            let old = self.travel.unwrap_or(now);
            self.travel = Some([0, 1, 2].map(|k| old[k] + part * (now[k] - old[k])));
        }
        self.place = frame.local[0];
        self.travel.map_or(0.0, norm)
    }
}

#[cfg(test)]
#[path = "classify_tests.rs"]
mod tests;
