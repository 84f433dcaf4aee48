//! From rows of points to contacts that last.

use super::item::ContactFrame;
use super::poses::{Motion, Poses};
use super::row::{Row, against};
use crate::choices;
use crate::contact::vector::{Vec3, add, dot, norm, scale, sub};
use crate::core::time::{Tick, seconds, ticks};

choices! {
    /// What one contact is.
    pub enum Manifold {
        /// All points of two bodies whose normals agree within 30 degrees are one contact, at their mean weighted by force.
        Centroid,
        /// Every point is a contact of its own.
        Points,
    }
}

/// Cosine of the angle by which normals of one contact may differ: within a frame, and from one frame to the next.
const SAME_FACE: f64 = 0.866;
const SAME_CONTACT: f64 = 0.7;
/// Time constant of the speed over a surface, s.
const TRAVEL: f64 = 0.02;
/// Most frames that stand in for missing ones, whatever the step.
const MOST_MISSING: f64 = 64.0;
/// Time for which a contact counts as wide, s.
const WIDTH: f64 = 0.25;

/// How points become contacts.
#[derive(Clone, Debug)]
pub(super) struct Joining {
    pub manifold: Manifold,
    /// Longest time for which a contact may be missing, s.
    pub hold: f64,
    /// How far a point may go beyond what its slip explains, m.
    pub jump: f64,
    /// Masses by body, kg; 0 for a body that does not move.
    pub masses: Vec<f64>,
}

/// One contact in one frame, before it has a number.
#[derive(Clone, Copy, Debug)]
struct Measured {
    row: Row,
    force: f64,
    velocity: Vec3,
    motion: [Motion; 2],
    /// Largest distance between its points.
    extent: f64,
}

/// A contact that lasts.
#[derive(Clone, Debug)]
struct Lasting {
    id: u64,
    given: Option<u64>,
    pair: [u32; 2],
    last: Tick,
    /// Its latest frame among all.
    index: usize,
    point: Vec3,
    normal: Vec3,
    /// Place of the contact, steadied.
    anchor: Vec3,
    /// How far its points lie apart.
    width: f64,
    /// Time for which nothing has shown it.
    wide_for: f64,
    travel: Option<[Vec3; 2]>,
}

/// Joins rows to contacts, frame by frame.
pub(super) struct Joiner<'a> {
    how: Joining,
    poses: &'a Poses,
    lasting: Vec<Lasting>,
    /// How long the frame that is taken lasts.
    step: Tick,
    next: u64,
    frames: Vec<(Tick, ContactFrame)>,
    /// Frames in which a contact was missing.
    pub bridged: u64,
}

fn narrow(v: Vec3) -> [f32; 3] {
    v.map(|x| x as f32)
}

impl<'a> Joiner<'a> {
    pub fn new(how: Joining, poses: &'a Poses) -> Self {
        Self { how, poses, lasting: Vec::new(), step: 1, next: 0, frames: Vec::new(), bridged: 0 }
    }

    /// Contacts so far.
    pub fn contacts(&self) -> u64 {
        self.next
    }

    /// Force, velocity and motion of the bodies of a row.
    fn measured(&self, row: &Row, tick: Tick) -> Measured {
        let step = seconds(self.step);
        let pose = |k: usize, tick| self.poses.at(row.bodies[k], tick);
        let poses = [pose(0, tick), pose(1, tick)];
        let force = row.impulse.map(|j| j / step).or(row.force).unwrap_or(0.0);
        let material = [0, 1].map(|k| poses[k].unwrap_or_default().at(row.point));
        let velocity = row.velocity.unwrap_or_else(|| sub(material[1], material[0]));
        let mut row = *row;
        if let Some(drag) = row.drag {
            row.friction = against(velocity, row.normal, drag / step);
        }
        if row.approach.is_none() && poses.iter().any(Option::is_some) {
            // How fast they came together just before: an engine tells what has become of it.
            let before = tick - self.step;
            let [a, b] = [0, 1].map(|k| pose(k, before).unwrap_or_default().at(row.point));
            row.approach = Some((-dot(sub(b, a), row.normal)).max(0.0));
        }
        let mut motion = poses.map(Option::unwrap_or_default);
        if poses[1].is_none() {
            // Without its pose the body is one that only shifts.
            motion[1].velocity = add(material[0], velocity);
        }
        Measured { row, force, velocity, motion, extent: 0.0 }
    }

    /// Joins points that belong together.
    fn gathered(&self, points: Vec<Measured>) -> Vec<Measured> {
        if self.how.manifold == Manifold::Points {
            return points;
        }
        let mut groups: Vec<Vec<Measured>> = Vec::new();
        for point in points {
            let same = |group: &&mut Vec<Measured>| {
                group.first().is_some_and(|one| dot(one.row.normal, point.row.normal) > SAME_FACE)
            };
            match groups.iter_mut().find(same) {
                Some(group) => group.push(point),
                None => groups.push(vec![point]),
            }
        }
        groups.iter().filter_map(|group| centroid(group)).collect()
    }

    /// Takes the rows of one frame that lasts `step`.
    pub fn frame(&mut self, rows: &[Row], step: Tick) {
        self.step = step.max(1);
        let Some(tick) = rows.first().map(|row| ticks(row.time)) else { return };
        let mut measured: Vec<Measured> = rows.iter().map(|row| self.measured(row, tick)).collect();
        measured.sort_by_key(|m| m.row.bodies);
        let oldest = tick - ticks(self.how.hold).max(2 * self.step) - self.step / 2;
        self.finish(oldest);
        while let Some(pair) = measured.first().map(|m| m.row.bodies) {
            let rest = measured.split_off(measured.partition_point(|m| m.row.bodies <= pair));
            let contacts = self.gathered(std::mem::replace(&mut measured, rest));
            self.pair(tick, pair, &contacts);
        }
    }

    /// Ends contacts that were last seen before a time.
    fn finish(&mut self, oldest: Tick) {
        let frames = &mut self.frames;
        self.lasting.retain(|contact| {
            let goes_on = contact.last >= oldest;
            if let Some((_, frame)) = frames.get_mut(contact.index).filter(|_| !goes_on) {
                frame.ends = true;
            }
            goes_on
        });
    }

    /// How well a measured contact continues a lasting one: smaller is better; `None` where it does not.
    fn distance(&self, old: &Lasting, new: &Measured, tick: Tick) -> Option<f64> {
        if old.last == tick {
            return None;
        }
        let far = norm(sub(new.row.point, old.point));
        if self.how.manifold == Manifold::Centroid {
            return (dot(old.normal, new.row.normal) > SAME_CONTACT).then_some(far);
        }
        if new.row.id.is_some() || old.given.is_some() {
            return (new.row.id == old.given).then_some(0.0);
        }
        let slip = norm(new.velocity) * seconds(tick - old.last);
        (far <= self.how.jump + 2.0 * slip).then_some(far)
    }

    fn pair(&mut self, tick: Tick, pair: [u32; 2], contacts: &[Measured]) {
        let mut matches: Vec<(f64, usize, usize)> = Vec::new();
        for (k, old) in self.lasting.iter().enumerate().filter(|(_, old)| old.pair == pair) {
            let far = |new: &Measured| self.distance(old, new, tick);
            matches.extend(contacts.iter().enumerate().filter_map(|(j, new)| Some((far(new)?, k, j))));
        }
        matches.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut taken = vec![None; contacts.len()];
        let mut used = Vec::new();
        for (_, k, j) in matches {
            if taken[j].is_none() && !used.contains(&k) {
                taken[j] = Some(k);
                used.push(k);
            }
        }
        for (new, old) in contacts.iter().zip(taken) {
            match old {
                Some(k) => self.goes_on(k, tick, new),
                None => self.begins(tick, pair, new),
            }
        }
    }

    fn begins(&mut self, tick: Tick, pair: [u32; 2], new: &Measured) {
        let given = new.row.id.filter(|_| self.how.manifold == Manifold::Points);
        let mut contact = Lasting {
            id: given.unwrap_or(self.next),
            given,
            pair,
            last: tick,
            index: 0,
            point: new.row.point,
            normal: new.row.normal,
            anchor: new.row.point,
            width: new.extent,
            wide_for: 0.0,
            travel: None,
        };
        self.next += 1;
        let frame = self.contact_frame(&contact, new, self.step);
        contact.index = self.frames.len();
        self.frames.push((tick, ContactFrame { begins: true, ..frame }));
        self.lasting.push(contact);
    }

    fn goes_on(&mut self, k: usize, tick: Tick, new: &Measured) {
        let Some(mut contact) = self.lasting.get(k).cloned() else { return };
        let gap = tick - contact.last;
        let missing = (gap as f64 / self.step as f64).round().clamp(1.0, MOST_MISSING) as i64 - 1;
        let step = gap / (missing + 1);
        // What was missing for a frame or two did not press.
        if let Some((at, old)) = self.frames.get(contact.index).copied() {
            for n in 1..=missing {
                let frame = ContactFrame {
                    force: 0.0,
                    friction: old.friction.map(|_| [0.0; 3]),
                    approach: old.approach.map(|_| 0.0),
                    interval: step,
                    begins: false,
                    ..old
                };
                self.frames.push((at + n * step, frame));
                self.bridged += 1;
            }
        }
        contact.advance(new, seconds(gap), self.how.jump);
        contact.last = tick;
        let frame = self.contact_frame(&contact, new, step);
        contact.index = self.frames.len();
        self.frames.push((tick, frame));
        if let Some(place) = self.lasting.get_mut(k) {
            *place = contact;
        }
    }

    fn contact_frame(&self, contact: &Lasting, new: &Measured, interval: Tick) -> ContactFrame {
        let row = &new.row;
        let told = |k: usize| row.travel[k].or(contact.travel.map(|travel| travel[k]));
        ContactFrame {
            contact: contact.id,
            bodies: row.bodies,
            interval,
            point: contact.anchor,
            local: [0, 1].map(|k| match self.poses.at(row.bodies[k], contact.last) {
                Some(pose) => pose.local(contact.anchor),
                None => contact.anchor,
            }),
            normal: narrow(row.normal),
            force: new.force as f32,
            friction: row.friction.map(narrow),
            velocity: narrow(new.velocity),
            travel: [told(0).map(narrow), told(1).map(narrow)],
            approach: row.approach.map(|v| v as f32),
            mass: row.mass.or_else(|| self.mass(row.bodies)).map(|m| m as f32),
            begins: false,
            ends: false,
        }
    }

    /// Effective mass of a pair: `1 / (1/m1 + 1/m2)`.
    fn mass(&self, bodies: [u32; 2]) -> Option<f64> {
        let one = |k: usize| self.how.masses.get(bodies[k] as usize).copied();
        let (a, b) = (one(0)?, one(1)?);
        let inverse = |m: f64| if m > 0.0 { 1.0 / m } else { 0.0 };
        let sum = inverse(a) + inverse(b);
        (sum > 0.0).then(|| 1.0 / sum)
    }

    /// All frames in the order of time.
    pub fn close(mut self) -> Vec<(Tick, ContactFrame)> {
        self.finish(Tick::MAX);
        self.frames.sort_by_key(|(tick, frame)| (*tick, frame.contact));
        self.frames
    }
}

/// The mean of points, weighted by force.
fn centroid(group: &[Measured]) -> Option<Measured> {
    let first = group.first()?;
    if group.len() == 1 {
        return Some(*first);
    }
    let force: f64 = group.iter().map(|m| m.force).sum();
    // Points that do not press count alike.
    let weight = |m: &Measured| if force > 1e-12 { m.force / force } else { 1.0 / group.len() as f64 };
    let mean = |of: &dyn Fn(&Measured) -> Vec3| {
        group.iter().fold([0.0; 3], |sum, m| add(sum, scale(of(m), weight(m))))
    };
    let sum = |of: &dyn Fn(&Row) -> Option<f64>| group.iter().filter_map(|m| of(&m.row)).reduce(|a, b| a + b);
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
        ..first.row
    };
    Some(Measured { row, force, velocity: mean(&|m| m.velocity), extent: 2.0 * extent, ..*first })
}

impl Lasting {
    /// Moves on to a new measurement.
    ///
    /// An engine tells a few points of a face that touches, now these, now those, so that their mean hops although nothing does.
    /// Therefore the contact is taken along by the body that moves, and a string as long as the points lie apart draws it to
    /// where they are. A single point, as of a ball, has a string of length 0.
    fn advance(&mut self, new: &Measured, time: f64, jump: f64) {
        let material = new.motion.map(|motion| motion.at(new.row.point));
        let carried = if norm(material[0]) > norm(material[1]) { material[0] } else { material[1] };
        let hop = norm(sub(new.row.point, add(self.point, scale(carried, time))));
        let hop = if hop > jump + 2.0 * norm(new.velocity) * time { hop } else { 0.0 };
        let now = new.extent.max(hop);
        if now >= 0.7 * self.width {
            self.wide_for = 0.0;
        }
        self.width = self.width.max(now);
        let moved = add(self.anchor, scale(carried, time));
        let drawn = |width: f64| {
            let off = sub(new.row.point, moved);
            let far = norm(off);
            add(moved, scale(off, if far > width { 1.0 - width / far } else { 0.0 }))
        };
        let speed = scale(sub(drawn(self.width), self.anchor), 1.0 / time);
        let part = 1.0 - (-time / TRAVEL).exp();
        let over = |k: usize| {
            let travel = sub(speed, material[k]);
            sub(travel, scale(new.row.normal, dot(travel, new.row.normal)))
        };
        self.travel = Some(match self.travel {
            None => [over(0), over(1)],
            Some(old) => [0, 1].map(|k| add(old[k], scale(sub(over(k), old[k]), part))),
        });
        // A contact that has not hopped for a while was no face: the string shortens, and that is no way of the contact.
        self.wide_for += time;
        if self.wide_for > WIDTH {
            self.width *= (-time / TRAVEL).exp();
        }
        let anchor = drawn(self.width);
        self.anchor = anchor;
        self.point = new.row.point;
        self.normal = new.row.normal;
    }
}
