//! Tracking of contacts: contact points of a frame are joined, and matched with the contacts of the previous frames.

use super::circulation::Circulation;
use super::poses::{Motion, Poses};
use super::row::{Row, friction_against};
use super::track::{Observation, Track};
use crate::choices;
use crate::contact::vector::{Vec3, add, dot, norm, scale, sub, widen};
use crate::core::time::{Tick, seconds, ticks};
use crate::rigid::item::ContactFrame;

choices! {
    /// Points that belong to one contact.
    pub enum Manifold {
        /// Points of two bodies whose normals differ by less than 30 degrees are one contact, at their mean weighted by force.
        Centroid,
        /// Every point is a separate contact.
        Points,
    }
}

/// Smallest cosine of the angle between normals of one contact, within a frame and from one frame to the next.
const MIN_COSINE_IN_FRAME: f64 = 0.866;
const MIN_COSINE_BETWEEN_FRAMES: f64 = 0.7;
/// Largest number of frames filled in for a gap.
const MAX_MISSING: f64 = 64.0;

/// Parameters of contact tracking.
#[derive(Clone, Debug)]
pub(super) struct TrackerParams {
    pub manifold: Manifold,
    /// Longest time for which a contact can be missing, s.
    pub hold: f64,
    /// Largest distance that a point moves in addition to its slip, m.
    pub jump: f64,
    /// Masses by body, kg; 0 for a body that does not move.
    pub masses: Vec<f64>,
}

/// The begin of a contact.
#[derive(Clone, Copy, Debug)]
struct Begin {
    /// Time from it to the end of the frame, s.
    age: f64,
    /// Speed of approach, m/s.
    approach: f64,
}

/// Converts rows to contacts, frame by frame.
pub(super) struct ContactTracker<'a> {
    params: TrackerParams,
    poses: &'a Poses,
    tracks: Vec<Track>,
    /// Length of the current frame.
    step: Tick,
    next_id: u64,
    frames: Vec<(Tick, ContactFrame)>,
    /// Number of frames filled in for missing ones.
    pub bridged: u64,
}

fn narrow(v: Vec3) -> [f32; 3] {
    v.map(|x| x as f32)
}

impl<'a> ContactTracker<'a> {
    pub fn new(params: TrackerParams, poses: &'a Poses) -> Self {
        Self { params, poses, tracks: Vec::new(), step: 1, next_id: 0, frames: Vec::new(), bridged: 0 }
    }

    /// Number of contacts so far.
    pub fn contact_count(&self) -> u64 {
        self.next_id
    }

    /// Force, velocity and motion of the bodies of a row.
    fn observe(&self, row: &Row, tick: Tick) -> Observation {
        let step = seconds(self.step);
        let pose = |k: usize, tick| self.poses.at(row.bodies[k], tick);
        let poses = [pose(0, tick), pose(1, tick)];
        let force = row.impulse.map(|j| j / step).or(row.force).unwrap_or(0.0);
        let material = [0, 1].map(|k| poses[k].unwrap_or_default().velocity_at(row.point));
        let velocity = row.velocity.unwrap_or_else(|| sub(material[1], material[0]));
        let mut row = *row;
        if let Some(impulse) = row.friction_impulse {
            row.friction = friction_against(velocity, row.normal, impulse / step);
        }
        let is_derived = row.approach.is_none() && poses.iter().any(Option::is_some);
        if is_derived {
            // Speed of approach in the previous frame: an engine logs the velocity after the impact. The point is where it is on the bodies now.
            let before = |k: usize| pose(k, tick - self.step).unwrap_or_default();
            let [a, b] = [0, 1].map(|k| {
                let position = poses[k].unwrap_or_default().position;
                Motion { position, ..before(k) }.velocity_at(row.point)
            });
            row.approach = Some((-dot(sub(b, a), row.normal)).max(0.0));
        }
        let mut motion = poses.map(Option::unwrap_or_default);
        if poses[1].is_none() {
            // A body of unknown pose does not rotate.
            motion[1].velocity = add(material[0], velocity);
        }
        Observation { row, force, velocity, motion, extent: 0.0, is_derived }
    }

    /// Joins points that belong to one contact.
    fn join(&self, points: Vec<Observation>) -> Vec<Observation> {
        if self.params.manifold == Manifold::Points {
            return points;
        }
        let mut groups: Vec<Vec<Observation>> = Vec::new();
        for point in points {
            let same_face = |group: &&mut Vec<Observation>| {
                group
                    .first()
                    .is_some_and(|first| dot(first.row.normal, point.row.normal) > MIN_COSINE_IN_FRAME)
            };
            match groups.iter_mut().find(same_face) {
                Some(group) => group.push(point),
                None => groups.push(vec![point]),
            }
        }
        groups.iter().filter_map(|group| centroid(group)).collect()
    }

    /// Adds the rows of one frame of length `step`.
    pub fn push_frame(&mut self, rows: &[Row], step: Tick) {
        self.step = step.max(1);
        let Some(tick) = rows.first().map(|row| ticks(row.time)) else { return };
        let mut points: Vec<Observation> = rows.iter().map(|row| self.observe(row, tick)).collect();
        points.sort_by_key(|point| point.row.bodies);
        let oldest = tick - ticks(self.params.hold).max(2 * self.step) - self.step / 2;
        self.end_tracks(oldest);
        while let Some(pair) = points.first().map(|point| point.row.bodies) {
            let rest = points.split_off(points.partition_point(|point| point.row.bodies <= pair));
            let contacts = self.join(std::mem::replace(&mut points, rest));
            self.match_contacts(tick, pair, &contacts);
        }
    }

    /// Ends contacts whose last frame is before a time.
    fn end_tracks(&mut self, oldest: Tick) {
        let frames = &mut self.frames;
        self.tracks.retain(|track| {
            let continues = track.last_tick >= oldest;
            if let Some((_, frame)) = frames.get_mut(track.frame_index).filter(|_| !continues) {
                frame.ends = true;
                // Bodies that approach and have no contact in the next frame: the row is of an instant within the frame.
                let approaches = dot(widen(frame.velocity), widen(frame.normal)) < 0.0;
                frame.depth = frame.depth.filter(|_| !(frame.begins && approaches) || track.has_age);
            }
            continues
        });
    }

    /// Distance of an observation from a track, smallest for the best match; `None` if they cannot match.
    fn distance(&self, track: &Track, new: &Observation, tick: Tick) -> Option<f64> {
        if track.last_tick == tick {
            return None;
        }
        let distance = norm(sub(new.row.point, track.point));
        if self.params.manifold == Manifold::Centroid {
            return (dot(track.normal, new.row.normal) > MIN_COSINE_BETWEEN_FRAMES).then_some(distance);
        }
        if new.row.id.is_some() || track.log_id.is_some() {
            return (new.row.id == track.log_id).then_some(0.0);
        }
        let slip = norm(new.velocity) * seconds(tick - track.last_tick);
        (distance <= self.params.jump + 2.0 * slip).then_some(distance)
    }

    /// Continues the nearest tracks of a pair of bodies with its contacts, and starts tracks for the others.
    fn match_contacts(&mut self, tick: Tick, pair: [u32; 2], contacts: &[Observation]) {
        let mut candidates: Vec<(f64, usize, usize)> = Vec::new();
        for (k, track) in self.tracks.iter().enumerate().filter(|(_, track)| track.pair == pair) {
            let distance = |new: &Observation| self.distance(track, new, tick);
            candidates
                .extend(contacts.iter().enumerate().filter_map(|(j, new)| Some((distance(new)?, k, j))));
        }
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut matches = vec![None; contacts.len()];
        let mut matched_tracks = Vec::new();
        for (_, k, j) in candidates {
            if matches[j].is_none() && !matched_tracks.contains(&k) {
                matches[j] = Some(k);
                matched_tracks.push(k);
            }
        }
        for (new, track) in contacts.iter().zip(matches) {
            match track {
                Some(k) => self.continue_track(k, tick, new),
                None => self.start_track(tick, pair, new),
            }
        }
    }

    fn start_track(&mut self, tick: Tick, pair: [u32; 2], new: &Observation) {
        let log_id = new.row.id.filter(|_| self.params.manifold == Manifold::Points);
        let mut track = Track {
            id: log_id.unwrap_or(self.next_id),
            log_id,
            pair,
            last_tick: tick,
            frame_index: 0,
            has_age: false,
            point: new.row.point,
            normal: new.row.normal,
            anchor: new.row.point,
            extent: new.extent,
            extent_age: 0.0,
            travel: None,
            material: new.motion.map(|motion| motion.velocity_at(new.row.point)),
            circulation: [Circulation::default(); 2],
            local: [[[0.0; 3]; 2]; 2],
            is_on_curve: false,
        };
        track.observe_chords(new, 0.0);
        self.next_id += 1;
        let mut frame = self.contact_frame(&track, new, self.step);
        if let Some(depth) = self.logged_depth(new, self.step, tick) {
            frame.depth = Some(depth as f32);
            track.has_age = true;
        } else if let Some(begin) = self.begin(new, tick) {
            frame.depth = Some((begin.approach * begin.age) as f32);
            frame.approach = frame.approach.map(|_| begin.approach as f32);
            track.has_age = true;
        } else if let Some(depth) = self.landing_depth(new, self.step, tick) {
            frame.depth = Some(depth as f32);
            track.has_age = true;
        } else if let (Some(depth @ 0.0..), true) = (new.row.depth, self.has_poses(new) && !new.is_derived) {
            // The log has more frames than the poses.
            let approach = row_approach(new);
            let age = contact_age(depth, approach, dot(new.velocity, new.row.normal));
            frame.depth = age.map(|age| (age * approach) as f32);
        }
        track.frame_index = self.frames.len();
        self.frames.push((tick, ContactFrame { begins: true, ..frame }));
        self.tracks.push(track);
    }

    fn continue_track(&mut self, k: usize, tick: Tick, new: &Observation) {
        let Some(mut track) = self.tracks.get(k).cloned() else { return };
        let gap = tick - track.last_tick;
        let missing = (gap as f64 / self.step as f64).round().clamp(1.0, MAX_MISSING) as i64 - 1;
        let step = gap / (missing + 1);
        let last_material = track.material;
        track.advance(new, seconds(gap), self.params.jump);
        track.last_tick = tick;
        let mut frame = self.contact_frame(&track, new, step);
        if new.is_derived && track.is_on_curve {
            // A point of a rim that rolls descends before it is the contact: the speed is that of the contact of the previous frame.
            let before = sub(last_material[1], last_material[0]);
            frame.approach = Some((-dot(before, new.row.normal)).max(0.0) as f32);
        }
        // That of a contact that goes on says nothing about a landing.
        let depth = self.logged_depth(new, step, tick).or_else(|| self.landing_depth(new, step, tick));
        frame.depth = depth.map(|depth| depth as f32);
        // The force is 0 in missing frames, and the contact moves evenly: at rest it would jump after them.
        if let Some((at, old)) = self.frames.get(track.frame_index).copied() {
            for n in 1..=missing {
                let share = n as f64 / (missing + 1) as f64;
                let between = |a: Vec3, b: Vec3| add(a, scale(sub(b, a), share));
                let frame = ContactFrame {
                    point: between(old.point, frame.point),
                    local: [0, 1].map(|k| between(old.local[k], frame.local[k])),
                    force: 0.0,
                    friction: old.friction.map(|_| [0.0; 3]),
                    approach: old.approach.map(|_| 0.0),
                    depth: None,
                    interval: step,
                    begins: false,
                    ..old
                };
                self.frames.push((at + n * step, frame));
                self.bridged += 1;
            }
        }
        track.frame_index = self.frames.len();
        self.frames.push((tick, frame));
        if let Some(slot) = self.tracks.get_mut(k) {
            *slot = track;
        }
    }

    fn contact_frame(&self, track: &Track, new: &Observation, interval: Tick) -> ContactFrame {
        let row = &new.row;
        let travel = |k: usize| row.travel[k].or(track.travel.map(|travel| travel[k]));
        ContactFrame {
            contact: track.id,
            bodies: row.bodies,
            interval,
            point: track.anchor,
            local: [0, 1].map(|k| match self.poses.at(row.bodies[k], track.last_tick) {
                Some(pose) => pose.to_local(track.anchor),
                None => track.anchor,
            }),
            normal: narrow(row.normal),
            force: new.force as f32,
            friction: row.friction.map(narrow),
            velocity: narrow(new.velocity),
            travel: [travel(0).map(narrow), travel(1).map(narrow)],
            approach: row.approach.map(|v| v as f32),
            depth: row.depth.map(|d| d as f32),
            mass: row.mass.or_else(|| self.mass(row.bodies)).map(|m| m as f32),
            begins: false,
            ends: false,
        }
    }

    /// Returns true if the poses have a body of the contact.
    fn has_poses(&self, new: &Observation) -> bool {
        new.row.bodies.iter().any(|body| self.poses.has(*body))
    }

    /// Motion of a body in the row of a time, or at rest if the poses do not have the body; `None` if they have no row there.
    fn row_or_rest(&self, body: u32, tick: Tick) -> Option<Motion> {
        if self.poses.has(body) { self.poses.row_at(body, tick) } else { Some(Motion::default()) }
    }

    /// When and how fast the bodies met, for a contact that begins in this frame, from the centres of the bodies at both ends of the frame;
    /// `None` unless the poses have rows there, if the depth is more accurate, or if the speeds of the centres hardly change.
    ///
    /// Until the contact the distance of the centres changes at the speed before the frame and the acceleration of free motion, after it at
    /// the speed at the end of the frame. That acceleration is what the mean force of the frame leaves of the change of speed, or that of the
    /// frame before where the log has forces of instants.
    fn begin(&self, new: &Observation, tick: Tick) -> Option<Begin> {
        /// Largest acceleration of free motion, m/s^2.
        const MAX_ACCELERATION: f64 = 30.0;
        /// Smallest change of speed, m/s.
        const MIN_JUMP: f64 = 1e-3;
        if !self.has_poses(new) {
            return None;
        }
        let (step, normal) = (seconds(self.step), new.row.normal);
        let approach = row_approach(new);
        let motion = |k: usize, tick: Tick| self.row_or_rest(new.row.bodies[k], tick);
        let along = |tick: Tick| -> Option<[f64; 2]> {
            let (a, b) = (motion(0, tick)?, motion(1, tick)?);
            Some([dot(sub(b.position, a.position), normal), dot(sub(b.velocity, a.velocity), normal)])
        };
        let ([x0, v0], [x1, v1]) = (along(tick - self.step)?, along(tick)?);
        let is_free = |a: &f64| a.abs() <= MAX_ACCELERATION;
        let mass = new.row.mass.or_else(|| self.mass(new.row.bodies));
        let from_force = mass.map(|mass| (v1 - v0) / step - new.force / mass);
        let earlier = || along(tick - 2 * self.step).map(|[_, v]| (v0 - v) / step).filter(is_free);
        let acceleration = from_force.filter(is_free).or_else(earlier).unwrap_or(0.0);
        // The speed of approach at a time since the previous frame, where the bodies are then.
        let approach_at = |since: f64| {
            if !new.is_derived {
                return Some(approach);
            }
            let velocity = |k: usize| {
                let (before, now) = (motion(k, tick - self.step)?, motion(k, tick)?);
                let then = add(before.position, scale(before.velocity, since));
                // Logs have the point of the contact itself, or that of the end of the frame: it belongs to the centre that is nearer along the surface.
                let distance = |centre: Vec3| {
                    let offset = sub(new.row.point, centre);
                    norm(sub(offset, scale(normal, dot(offset, normal))))
                };
                let is_of_contact = distance(then) <= distance(now.position);
                let position = if is_of_contact { then } else { now.position };
                Some(Motion { position, ..before }.velocity_at(new.row.point))
            };
            let relative = sub(velocity(1)?, velocity(0)?);
            Some((-dot(relative, normal) - acceleration * since).max(0.0))
        };
        let [on_a, on_b] = new.motion.map(|motion| motion.velocity_at(new.row.point));
        if approach > 0.0 && dot(sub(on_b, on_a), normal) < -0.5 * approach {
            // The bodies have hardly slowed down: the contact began at the end of the frame.
            let begin = Begin { age: 0.0, approach: approach_at(step)? };
            return new.row.depth.is_none().then_some(begin);
        }
        let jump = v1 - v0 - acceleration * step;
        if jump < MIN_JUMP {
            return None;
        }
        let before = (v1 * step - 0.5 * acceleration * step * step - (x1 - x0)) / jump;
        let before = before.clamp(0.0, step);
        let begin = Begin { age: step - before, approach: approach_at(before)? };
        // Bodies that rebound change their speed by more than that at which they met.
        (begin.approach > 0.0 && jump >= 0.5 * begin.approach).then_some(begin)
    }

    /// Depth that a landing within a frame would have at its end, at the speed of approach: its time times that speed. `None` if the
    /// poses have no rows at both ends of the frame, if a body rotates far in it, or if the speed at the point hardly changes.
    ///
    /// As in [`begin`](Self::begin), for the material at the point of contact in place of the centres of the bodies: an edge that
    /// lands stops, and the body goes on.
    fn landing_depth(&self, new: &Observation, step: Tick, tick: Tick) -> Option<f64> {
        /// Largest rotation within the frame, rad: the path of the point is nearly straight.
        const MAX_ROTATION: f64 = 0.5;
        /// Smallest speed of approach, m/s.
        const MIN_APPROACH: f64 = 0.02;
        let (seconds, normal, approach) = (seconds(step), new.row.normal, row_approach(new));
        if approach < MIN_APPROACH {
            return None;
        }
        let motion = |k: usize, tick: Tick| self.row_or_rest(new.row.bodies[k], tick);
        // Where the material is that is at the point at the end of the frame, and its velocity.
        let material = |k: usize, tick_then: Tick| {
            let (now, then) = (motion(k, tick)?, motion(k, tick_then)?);
            let point = then.to_world(now.to_local(new.row.point));
            let is_straight = norm(then.angular_velocity) * seconds <= MAX_ROTATION;
            is_straight.then(|| (point, then.velocity_at(point)))
        };
        let along = |tick: Tick| {
            let ((on_a, v_a), (on_b, v_b)) = (material(0, tick)?, material(1, tick)?);
            Some([dot(sub(on_b, on_a), normal), dot(sub(v_b, v_a), normal)])
        };
        let ([x0, v0], [x1, v1]) = (along(tick - step)?, along(tick)?);
        let jump = v1 - v0;
        (jump >= 0.5 * approach).then(|| {
            let before = ((v1 * seconds - (x1 - x0)) / jump).clamp(0.0, seconds);
            approach * (seconds - before)
        })
    }

    /// Depth that a landing within a frame would have at its end, at the speed of approach, from the depth and the speed in the log. `None`
    /// if the bodies rebound, if the landing would be before the frame, or if the poses have no rows or other speeds at its end: the row of
    /// a contact that is over by then is of an instant within the frame.
    fn logged_depth(&self, new: &Observation, step: Tick, tick: Tick) -> Option<f64> {
        /// Smallest speed of approach, m/s.
        const MIN_APPROACH: f64 = 0.02;
        /// Smallest part of the speed of approach at the end of the frame, and largest difference between row and poses.
        const LEFT: f64 = 0.1;
        let (approach, depth) = (new.row.approach.filter(|_| !new.is_derived)?, new.row.depth?);
        let velocity = |k: usize| Some(self.row_or_rest(new.row.bodies[k], tick)?.velocity_at(new.row.point));
        let separation = dot(new.velocity, new.row.normal);
        let by_poses = dot(sub(velocity(1)?, velocity(0)?), new.row.normal);
        let approaches = approach >= MIN_APPROACH && separation.max(by_poses) <= -LEFT * approach;
        let is_at_end = (separation - by_poses).abs() <= LEFT * approach;
        let age = contact_age(depth, approach, separation)?;
        (approaches && is_at_end && age > 0.0 && age <= seconds(step)).then_some(approach * age)
    }

    /// Effective mass of a pair: `1 / (1/m1 + 1/m2)`.
    fn mass(&self, bodies: [u32; 2]) -> Option<f64> {
        let mass = |k: usize| self.params.masses.get(bodies[k] as usize).copied();
        let (a, b) = (mass(0)?, mass(1)?);
        let inverse = |m: f64| if m > 0.0 { 1.0 / m } else { 0.0 };
        let sum = inverse(a) + inverse(b);
        (sum > 0.0).then(|| 1.0 / sum)
    }

    /// Ends all contacts and returns all frames in the order of time.
    pub fn finish(mut self) -> Vec<(Tick, ContactFrame)> {
        self.end_tracks(Tick::MAX);
        self.frames.sort_by_key(|(tick, frame)| (*tick, frame.contact));
        self.frames
    }
}

/// Speed of approach of an observation, m/s, 0 if unknown.
fn row_approach(new: &Observation) -> f64 {
    new.row.approach.unwrap_or_else(|| (-dot(new.velocity, new.row.normal)).max(0.0))
}

/// Time since bodies met at a speed of approach, s, with the depth and the speed of separation that they have now: those of a mass on a
/// spring. `None` without an approach, and after most of a rebound, whose depth says nothing about its begin.
fn contact_age(depth: f64, approach: f64, separation: f64) -> Option<f64> {
    /// Part of the speed of approach; bodies with a restitution of a half have nearly parted then.
    const REBOUND: f64 = 0.4;
    let phase = (-separation / approach).clamp(-1.0, 1.0).acos();
    let share = if phase > 1e-3 { phase / phase.sin() } else { 1.0 };
    (approach > 0.0 && separation <= REBOUND * approach).then(|| depth / approach * share)
}

/// Mean of points, weighted by force.
fn centroid(group: &[Observation]) -> Option<Observation> {
    let first = group.first()?;
    if group.len() == 1 {
        return Some(*first);
    }
    let force: f64 = group.iter().map(|m| m.force).sum();
    // Without force all points have the same weight.
    let weight = |m: &Observation| if force > 1e-12 { m.force / force } else { 1.0 / group.len() as f64 };
    let mean = |value: &dyn Fn(&Observation) -> Vec3| {
        group.iter().fold([0.0; 3], |sum, m| add(sum, scale(value(m), weight(m))))
    };
    let sum =
        |value: &dyn Fn(&Row) -> Option<f64>| group.iter().filter_map(|m| value(&m.row)).reduce(|a, b| a + b);
    let normal = mean(&|m| m.row.normal);
    let point = mean(&|m| m.row.point);
    let friction = group.iter().filter_map(|m| m.row.friction).reduce(add);
    let extent = group.iter().map(|m| norm(sub(m.row.point, point))).fold(0.0, f64::max);
    let row = Row {
        point,
        normal: scale(normal, 1.0 / norm(normal).max(1e-9)),
        force: sum(&|r| r.force),
        impulse: sum(&|r| r.impulse),
        friction,
        velocity: None,
        approach: group.iter().filter_map(|m| m.row.approach).reduce(f64::max),
        depth: group.iter().filter_map(|m| m.row.depth).reduce(f64::max),
        ..first.row
    };
    Some(Observation { row, force, velocity: mean(&|m| m.velocity), extent: 2.0 * extent, ..*first })
}
