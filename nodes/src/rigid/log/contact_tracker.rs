//! Tracking of contacts: contact points of a frame are joined, and matched with the contacts of the previous frames.

use super::circulation::{Circulation, travel};
use super::poses::{Motion, Poses};
use super::row::{Row, friction_against};
use crate::choices;
use crate::contact::vector::{Vec3, add, cross, dot, norm, rotate_back, scale, sub, widen};
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
/// Time constant of the velocity over a surface and of the decay of the extent, s.
const SMOOTHING: f64 = 0.02;
/// Largest number of frames filled in for a gap.
const MAX_MISSING: f64 = 64.0;
/// Time for which a contact retains its extent without an observation of it, s.
const EXTENT_HOLD: f64 = 1.0;

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

/// One contact in one frame, before it is matched.
#[derive(Clone, Copy, Debug)]
struct Observation {
    row: Row,
    force: f64,
    velocity: Vec3,
    motion: [Motion; 2],
    /// Largest distance between its points, m.
    extent: f64,
}

/// A contact that continues from frame to frame.
#[derive(Clone, Debug)]
struct Track {
    id: u64,
    /// Number of the contact in the log.
    log_id: Option<u64>,
    pair: [u32; 2],
    last_tick: Tick,
    /// Index of its latest frame.
    frame_index: usize,
    /// True if the time at which the contact began is known from the poses.
    has_age: bool,
    point: Vec3,
    normal: Vec3,
    /// Smoothed position of the contact.
    anchor: Vec3,
    /// Distance between its points, m.
    extent: f64,
    /// Time since the extent was observed, s.
    extent_age: f64,
    /// Velocities over the surfaces of a and b.
    travel: Option<[Vec3; 2]>,
    /// Velocities of the material of a and b at the contact.
    material: [Vec3; 2],
    /// Chords of the contact point on a and on b.
    circulation: [Circulation; 2],
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
        if row.approach.is_none() && poses.iter().any(Option::is_some) {
            // Speed of approach in the previous frame: an engine logs the velocity after the impact.
            let before = tick - self.step;
            let [a, b] = [0, 1].map(|k| pose(k, before).unwrap_or_default().velocity_at(row.point));
            row.approach = Some((-dot(sub(b, a), row.normal)).max(0.0));
        }
        let mut motion = poses.map(Option::unwrap_or_default);
        if poses[1].is_none() {
            // A body of unknown pose does not rotate.
            motion[1].velocity = add(material[0], velocity);
        }
        Observation { row, force, velocity, motion, extent: 0.0 }
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
        };
        track.observe_chords(new, 0.0);
        self.next_id += 1;
        let mut frame = self.contact_frame(&track, new, self.step);
        let approach = row_approach(new);
        if let Some(age) = self.age(new, tick, approach) {
            frame.depth = Some((approach * age) as f32);
            track.has_age = true;
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
        track.advance(new, seconds(gap), self.params.jump);
        track.last_tick = tick;
        let frame = self.contact_frame(&track, new, step);
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

    /// Time since a contact that begins in this frame began, s, from the centres of the bodies at both ends of the frame; `None`
    /// unless the poses have rows there, if the depth is more accurate, or if the speeds of the centres hardly change.
    ///
    /// Until the contact the distance of the centres changes at the speed before the frame and its acceleration, after it at the
    /// speed at the end of the frame.
    fn age(&self, new: &Observation, tick: Tick, approach: f64) -> Option<f64> {
        /// Largest acceleration of free motion, m/s^2.
        const MAX_ACCELERATION: f64 = 30.0;
        if !new.row.bodies.iter().any(|body| self.poses.has(*body)) {
            return None;
        }
        let step = seconds(self.step);
        let along = |tick: Tick| -> Option<[f64; 2]> {
            let relative = |k: usize| {
                let body = new.row.bodies[k];
                let row = self.poses.row_at(body, tick).map(|m| (m.position, m.velocity));
                if self.poses.has(body) { row } else { Some(([0.0; 3], [0.0; 3])) }
            };
            let ((x, v), (y, w)) = (relative(0)?, relative(1)?);
            Some([dot(sub(y, x), new.row.normal), dot(sub(w, v), new.row.normal)])
        };
        let ([x0, v0], [x1, v1]) = (along(tick - self.step)?, along(tick)?);
        let earlier = along(tick - 2 * self.step);
        let acceleration = earlier.map_or(0.0, |[_, v]| (v0 - v) / step);
        let acceleration = if acceleration.abs() <= MAX_ACCELERATION { acceleration } else { 0.0 };
        let [on_a, on_b] = new.motion.map(|motion| motion.velocity_at(new.row.point));
        if approach > 0.0 && dot(sub(on_b, on_a), new.row.normal) < -0.5 * approach {
            // The bodies have hardly slowed down: the contact began at the end of the frame.
            return new.row.depth.is_none().then_some(0.0);
        }
        let jump = v1 - v0 - acceleration * step;
        if jump < 0.5 * approach || approach <= 0.0 {
            return None;
        }
        let before = (v1 * step - 0.5 * acceleration * step * step - (x1 - x0)) / jump;
        Some((step - before).clamp(0.0, step))
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

impl Track {
    /// Moves the contact to a new observation.
    ///
    /// An engine logs a few points of a touching face, different ones from frame to frame, so that their mean jumps although
    /// nothing moves. The contact therefore moves with the moving body, and is pulled to the observed point only as far as their
    /// distance exceeds the extent of the contact. A single point, as of a ball, has an extent of 0.
    fn advance(&mut self, new: &Observation, time: f64, jump: f64) {
        self.observe_chords(new, time);
        let material = new.motion.map(|motion| motion.velocity_at(new.row.point));
        let last_material = std::mem::replace(&mut self.material, material);
        if let Some(travel) = self.circulating_travel(new, time) {
            self.travel = Some(travel);
            (self.anchor, self.point, self.normal) = (new.row.point, new.row.point, new.row.normal);
            self.extent *= (-time / SMOOTHING).exp();
            return;
        }
        let body_velocity = if norm(material[0]) > norm(material[1]) { material[0] } else { material[1] };
        let jumped = norm(sub(new.row.point, add(self.point, scale(body_velocity, time))));
        let jumped = if jumped > jump + 2.0 * norm(new.velocity) * time { jumped } else { 0.0 };
        let observed_extent = new.extent.max(jumped);
        if observed_extent >= 0.7 * self.extent {
            self.extent_age = 0.0;
        }
        self.extent = self.extent.max(observed_extent);
        let moved = add(self.anchor, scale(body_velocity, time));
        let pulled = |extent: f64| {
            let offset = sub(new.row.point, moved);
            let distance = norm(offset);
            add(moved, scale(offset, if distance > extent { 1.0 - extent / distance } else { 0.0 }))
        };
        let velocity = scale(sub(pulled(self.extent), self.anchor), 1.0 / time);
        let part = 1.0 - (-time / SMOOTHING).exp();
        let over = |k: usize| {
            // The velocity of the point is a mean over the frame, and so is that of the material.
            let travel = sub(velocity, scale(add(material[k], last_material[k]), 0.5));
            sub(travel, scale(new.row.normal, dot(travel, new.row.normal)))
        };
        self.travel = Some(match self.travel {
            None => [over(0), over(1)],
            Some(old) => [0, 1].map(|k| add(old[k], scale(sub(over(k), old[k]), part))),
        });
        // A contact without recent jumps is not a face: its extent decays, which moves the anchor but is no travel.
        self.extent_age += time;
        if self.extent_age > EXTENT_HOLD {
            self.extent *= (-time / SMOOTHING).exp();
        }
        let anchor = pulled(self.extent);
        self.anchor = anchor;
        self.point = new.row.point;
        self.normal = new.row.normal;
    }

    /// Adds the chords since the previous frame.
    fn observe_chords(&mut self, new: &Observation, time: f64) {
        let local = new.motion.map(|motion| motion.to_local(new.row.point));
        for k in [0, 1] {
            let rate = norm(self.turn(new, k, time));
            let outward = scale(new.row.normal, if k == 0 { 1.0 } else { -1.0 });
            let normal = rotate_back(new.motion[k].rotation, outward);
            self.circulation[k].observe([local[k], normal, local[1 - k]], rate, time);
        }
    }

    /// Rate of a body's turn under the normal, rad/s: its angular velocity times the normal, without the rate of the normal itself.
    ///
    /// The normal turns with the other body, or as observed from frame to frame, whichever is less.
    fn turn(&self, new: &Observation, side: usize, time: f64) -> Vec3 {
        let normal = new.row.normal;
        let with_other = cross(new.motion[1 - side].angular_velocity, normal);
        let observed = scale(sub(normal, self.normal), 1.0 / time.max(1e-6));
        let rate = if norm(with_other) <= norm(observed) { with_other } else { observed };
        sub(cross(new.motion[side].angular_velocity, normal), rate)
    }

    /// Velocities over the surfaces of a contact point that circulates.
    fn circulating_travel(&self, new: &Observation, time: f64) -> Option<[Vec3; 2]> {
        let radius = [0, 1].map(|k| self.circulation[k].radius());
        let side = if radius[1].is_some() { 1 } else { 0 };
        let along = |v: Vec3| sub(v, scale(new.row.normal, dot(v, new.row.normal)));
        Some(travel(side, radius[side]?, along(self.turn(new, side, time)), along(new.velocity)))
    }
}
