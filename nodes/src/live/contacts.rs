//! Contacts from outside.

use crate::contact::vector::{Vec3, norm};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::{Inbox, Message};
use crate::core::node::{Class, Node, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Tick, ticks};
use crate::rigid::ContactFrame;
use crate::{params, ports};
use serde_json::{Map, Value};

params! {
    /// Contacts of rigid bodies that come in while the graph plays: from OSC, or as JSON lines on standard input.
    ///
    /// Each frame of each contact is one message. A contact begins with its first message; it ends when the sender says so, or when it has
    /// been silent for `silence`: then a last frame without force says so, so that a stalled sender falls silent. Offline none comes.
    pub struct LiveContactsParams {
        /// The name under which they are sent: `/foley/contact/CHANNEL`.
        channel: Text;
        /// Time from one frame of the sender to the next, where it does not tell.
        frame: f64 = 0.0166666666667, unit "s", range 0.0001..=0.2;
        /// Time without a message after which a contact has ended: two frames, and what messages may be late.
        silence: f64 = 0.05, unit "s", range 0.001..=10.0;
        /// Contacts at a time; messages of more are left out.
        room: u16 = 64, unit "contacts", range 1..=1024_u16;
        /// How long to listen; None listens for ever.
        duration: Option<f64> = None, unit "s", range 0.0..=1.0e6_f64;
    }
}
ports! {
    /// Ports of `LiveContacts`.
    pub struct LiveContactsPorts / LiveContactsIo {
        in {}
        out {
            /// The contacts, one event each in every frame.
            contacts: Events<ContactFrame>,
        }
    }
}

/// One frame of a contact as it is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sent {
    /// Which contact.
    pub id: u64,
    /// Numbers of the bodies.
    pub bodies: [u32; 2],
    /// Where, m.
    pub point: [f64; 3],
    /// From a to b; any length but 0.
    pub normal: [f64; 3],
    /// Normal force, N.
    pub force: f64,
    /// Of b relative to a, m/s.
    pub velocity: [f64; 3],
    /// Speed at which they met, m/s.
    pub approach: Option<f64>,
    /// Effective mass, kg.
    pub mass: Option<f64>,
    /// Velocity of the contact point over a, m/s.
    pub travel: Option<[f64; 3]>,
    /// Time since the frame before, s.
    pub step: Option<f64>,
    /// The contact has ended.
    pub ends: bool,
}

/// Largest number that may be sent.
const MOST: f64 = 1e9;
/// Stands for a number that is not told.
const NONE: f64 = -1.0;

impl Sent {
    /// Whether every number can be.
    fn is_valid(&self) -> bool {
        let vectors = [self.point, self.normal, self.velocity, self.travel.unwrap_or_default()];
        let positive = [Some(self.force), self.approach, self.mass, self.step];
        vectors.iter().flatten().all(|x| x.abs() <= MOST)
            && positive.iter().flatten().all(|x| (0.0..=MOST).contains(x))
            && self.bodies[0] != self.bodies[1]
            && (self.ends || norm(self.normal) > 1e-6)
            && self.id < 1 << 53
    }

    /// The numbers of an OSC message: id, a, b, place, normal, force, velocity, and as far as wanted approach, mass, travel over a and time
    /// since the frame before, -1 for what is not known. An id alone ends its contact.
    #[must_use]
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let whole = |k: usize| {
            let x = *numbers.get(k)?;
            (x.fract() == 0.0 && (0.0..9e15).contains(&x)).then_some(x)
        };
        let id = whole(0)? as u64;
        if numbers.len() == 1 {
            return Some(Self::end(id));
        }
        let vector = |k: usize| -> Option<Vec3> { numbers.get(k..k + 3)?.try_into().ok() };
        let maybe = |k: usize| numbers.get(k).copied().filter(|x| *x != NONE);
        if !(13..=19).contains(&numbers.len()) || (16..18).contains(&numbers.len()) {
            return None;
        }
        let sent = Self {
            id,
            bodies: [u32::try_from(whole(1)? as u64).ok()?, u32::try_from(whole(2)? as u64).ok()?],
            point: vector(3)?,
            normal: vector(6)?,
            force: *numbers.get(9)?,
            velocity: vector(10)?,
            approach: maybe(13),
            mass: maybe(14),
            travel: vector(15),
            step: maybe(18),
            ends: false,
        };
        sent.is_valid().then_some(sent)
    }

    fn end(id: u64) -> Self {
        let still = [0.0; 3];
        Self {
            id,
            bodies: [0, 1],
            point: still,
            normal: still,
            force: 0.0,
            velocity: still,
            approach: None,
            mass: None,
            travel: None,
            step: None,
            ends: true,
        }
    }

    /// One contact of a line of JSON: `id`, `a`, `b`, `point`, `normal`, `force` or `impulse`, `velocity`, and where they are known `approach`,
    /// `mass`, `travel_a` and `step`; or `id` and `"ends": true`.
    ///
    /// # Errors
    /// The key, what was found and what would be right.
    pub fn from_json(object: &Map<String, Value>) -> Result<Self, String> {
        const KEYS: [&str; 13] = [
            "id", "a", "b", "point", "normal", "force", "impulse", "velocity", "approach", "mass",
            "travel_a", "step", "ends",
        ];
        if let Some(key) = object.keys().find(|key| !KEYS.contains(&key.as_str())) {
            return Err(format!("there is no key `{key}`; known are {}", KEYS.join(", ")));
        }
        let wrong = |key: &str, need: &str| {
            let found = object.get(key).map_or("nothing".into(), Value::to_string);
            format!("`{key}` is {}; {need} needed", found.chars().take(40).collect::<String>())
        };
        let whole = |key: &str| {
            object.get(key).and_then(Value::as_u64).ok_or_else(|| wrong(key, "a whole number from 0 on is"))
        };
        let id = whole("id")?;
        if object.get("ends") == Some(&Value::Bool(true)) {
            return Ok(Self::end(id));
        }
        let maybe = |key: &str| match object.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => {
                let x = value.as_f64().filter(|x| (0.0..=MOST).contains(x));
                x.map(Some).ok_or_else(|| wrong(key, "a number from 0 on is"))
            }
        };
        let vector = |key: &str| {
            let list = object.get(key).and_then(Value::as_array);
            let list: Option<Vec<f64>> = list.and_then(|list| list.iter().map(Value::as_f64).collect());
            list.and_then(|list| Vec3::try_from(list).ok())
                .ok_or_else(|| wrong(key, "a list of three numbers is"))
        };
        let body = |key: &str| u32::try_from(whole(key)?).map_err(|_| wrong(key, "the number of a body is"));
        let step = maybe("step")?;
        let force = match (maybe("force")?, maybe("impulse")?, step.filter(|step| *step > 0.0)) {
            (Some(force), ..) => force,
            (None, Some(impulse), Some(step)) => impulse / step,
            (None, Some(_), None) => return Err("`impulse` needs `step`, the seconds of a frame".into()),
            _ => return Err(wrong("force", "newtons are")),
        };
        let sent = Self {
            id,
            bodies: [body("a")?, body("b")?],
            point: vector("point")?,
            normal: vector("normal")?,
            force,
            velocity: vector("velocity")?,
            approach: maybe("approach")?,
            mass: maybe("mass")?,
            travel: object.contains_key("travel_a").then(|| vector("travel_a")).transpose()?,
            step,
            ends: false,
        };
        let reason = "a contact needs two bodies, a normal that is not 0 and numbers below 1e9";
        if sent.is_valid() { Ok(sent) } else { Err(reason.into()) }
    }
}

/// A frame of a contact as a message.
#[must_use]
pub fn contact_to_message(sent: &Sent) -> Option<Message> {
    if !sent.is_valid() {
        return None;
    }
    let ([px, py, pz], [nx, ny, nz], [vx, vy, vz]) = (sent.point, sent.normal, sent.velocity);
    let [tx, ty, tz] = sent.travel.unwrap_or_default();
    let told = |x: Option<f64>| x.unwrap_or(NONE);
    Message::new(&[
        sent.id as f64,
        sent.bodies[0].into(),
        sent.bodies[1].into(),
        px,
        py,
        pz,
        nx,
        ny,
        nz,
        sent.force,
        vx,
        vy,
        vz,
        told(sent.approach),
        told(sent.mass),
        tx,
        ty,
        tz,
        told(sent.step),
        f64::from(u8::from(sent.travel.is_some())),
        f64::from(u8::from(sent.ends)),
    ])
}

/// The frame of a message; `None` where it is none.
#[must_use]
pub fn contact_from_message(message: &Message) -> Option<Sent> {
    let (numbers, flags) = message.numbers().split_at_checked(19)?;
    let [travels, ends] = *flags else { return None };
    if ends > 0.0 {
        return Some(Sent::end(*numbers.first()? as u64));
    }
    let sent = Sent::from_numbers(numbers)?;
    Some(Sent { travel: sent.travel.filter(|_| travels > 0.0), ..sent })
}

/// Turns what is sent into contacts that begin and end.
#[derive(Debug)]
pub struct Gathering {
    /// Time of a frame that does not tell it.
    pub frame: Tick,
    /// Time after which a contact has ended.
    pub silence: Tick,
    most: usize,
    held: Vec<(Tick, ContactFrame)>,
    /// Messages of contacts beyond what there is room for.
    pub left_out: u64,
}

impl Gathering {
    /// At most so many contacts at a time.
    #[must_use]
    pub fn new(frame: Tick, silence: Tick, most: usize) -> Self {
        Self { frame, silence, most, held: Vec::with_capacity(most), left_out: 0 }
    }

    /// Takes one message, and gives its frame.
    pub fn take(&mut self, tick: Tick, sent: &Sent) -> Option<ContactFrame> {
        let place = self.held.iter().position(|(_, frame)| frame.contact == sent.id);
        if sent.ends {
            let (_, frame) = self.held.swap_remove(place?);
            return Some(Self::ended(frame));
        }
        let old = place.and_then(|k| self.held.get(k)).copied();
        // Who tells how long its frames are is not disturbed by when messages arrive.
        let passed = old.map_or(self.frame, |(last, _)| (tick - last).max(self.frame / 4).max(1));
        let interval = sent.step.filter(|s| *s > 0.0).map_or(passed, |s| ticks(s.min(1.0)).max(1));
        let sign = if sent.bodies[0] > sent.bodies[1] { -1.0 } else { 1.0 };
        let turned = |v: Vec3| v.map(|x| (x * sign) as f32);
        let over_a = sent.travel.map(|v| v.map(|x| x as f32));
        // Over b the contact goes as over a, but for the slip.
        let over_b = sent.travel.map(|v| [0, 1, 2].map(|k| (v[k] - sent.velocity[k]) as f32));
        let length = norm(sent.normal);
        let mut frame = ContactFrame {
            contact: sent.id,
            bodies: sent.bodies,
            interval,
            point: sent.point,
            local: [sent.point; 2],
            normal: turned(sent.normal.map(|x| x / length)),
            force: sent.force as f32,
            friction: None,
            velocity: turned(sent.velocity),
            travel: [over_a, over_b],
            approach: sent.approach.map(|v| v as f32),
            mass: sent.mass.map(|m| m as f32),
            begins: old.is_none(),
            ends: false,
        };
        if sign < 0.0 {
            frame.bodies.swap(0, 1);
            frame.travel.swap(0, 1);
        }
        if let Some(held) = place.and_then(|k| self.held.get_mut(k)) {
            *held = (tick, frame);
        } else if self.held.len() < self.most {
            self.held.push((tick, frame));
        } else {
            self.left_out += 1;
            return None;
        }
        Some(frame)
    }

    /// The next contact that has been silent for too long before a time: when it ended, and its last frame.
    pub fn next_ended(&mut self, before: Tick) -> Option<(Tick, ContactFrame)> {
        let oldest = self.held.iter().enumerate().min_by_key(|(_, (last, frame))| (*last, frame.contact));
        let (k, at) = oldest.map(|(k, (last, _))| (k, last + self.silence)).filter(|(_, at)| *at < before)?;
        let (_, frame) = self.held.swap_remove(k);
        Some((at, Self::ended(frame)))
    }

    fn ended(frame: ContactFrame) -> ContactFrame {
        ContactFrame { force: 0.0, approach: frame.approach.map(|_| 0.0), begins: false, ends: true, ..frame }
    }
}

/// The node `LiveContacts`.
pub struct LiveContacts {
    inbox: Option<Box<dyn Inbox>>,
    gathering: Gathering,
    frames: u64,
}

impl Node for LiveContacts {
    type Params = LiveContactsParams;
    type Ports = LiveContactsPorts;
    const NAME: &'static str = "LiveContacts";
    const CLASS: Class = Class::Audio;

    fn shape(p: &LiveContactsParams, s: &mut Shape<'_, '_, LiveContactsPorts>) -> Result<(), Reject> {
        s.ends(p.duration.map(ticks));
        Ok(())
    }

    fn build(p: &LiveContactsParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let silence = ticks(p.silence).max(2 * ticks(p.frame));
        let gathering = Gathering::new(ticks(p.frame), silence, p.room.into());
        Ok(Self { inbox: cx.inputs.open(&p.channel.0), gathering, frames: 0 })
    }

    fn run(&mut self, mut io: LiveContactsIo<'_>) -> Result<(), Fault> {
        let (_, to) = io.contacts.window();
        while let Some((tick, message)) = self.inbox.as_mut().and_then(|inbox| inbox.next(to)) {
            while let Some((at, frame)) = self.gathering.next_ended(tick) {
                io.contacts.push(at, frame);
            }
            let frame = contact_from_message(&message).and_then(|sent| self.gathering.take(tick, &sent));
            if let Some(frame) = frame {
                self.frames += 1;
                io.contacts.push(tick, frame);
            }
        }
        while let Some((at, frame)) = self.gathering.next_ended(to) {
            io.contacts.push(at, frame);
        }
        Ok(())
    }

    fn finish(&mut self, _: LiveContactsIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("frames", self.frames.into()), ("left_out", self.gathering.left_out.into())])
    }

    fn trial(rng: &mut Rng) -> (LiveContactsParams, MemoryFiles) {
        let params = LiveContactsParams::trial(rng);
        let duration = params.duration.map(|_| rng.between(0.0, 0.5));
        (LiveContactsParams { duration, room: 1 + rng.below(64) as u16, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NUMBERS: [f64; 19] =
        [3.0, 0.0, 2.0, 1.0, -2.0, 0.5, 0.0, 0.0, 1.0, 9.5, 0.3, 0.0, -0.1, 0.2, -1.0, 0.4, 0.0, 0.0, 0.01];

    #[test]
    fn a_contact_survives_its_message() {
        let sent = Sent::from_numbers(&NUMBERS).unwrap();
        assert_eq!((sent.approach, sent.mass, sent.travel), (Some(0.2), None, Some([0.4, 0.0, 0.0])));
        let short = Sent::from_numbers(&NUMBERS[..13]).unwrap();
        for sent in [sent, short, Sent::end(7)] {
            assert_eq!(contact_from_message(&contact_to_message(&sent).unwrap()), Some(sent));
        }
        assert_eq!(contact_from_message(&Message::new(&[1.0]).unwrap()), None);
    }

    #[test]
    fn what_can_be_no_contact_is_none() {
        for (place, number) in [(0, -1.0), (0, 0.5), (2, 0.0), (8, 0.0), (9, -3.0), (3, 1e30), (13, -2.0)] {
            let mut numbers = NUMBERS;
            numbers[place] = number;
            assert_eq!(Sent::from_numbers(&numbers), None, "{number} at {place}");
        }
        for place in 0..NUMBERS.len() {
            for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut numbers = NUMBERS;
                numbers[place] = number;
                assert_eq!(Sent::from_numbers(&numbers), None, "{number} at {place}");
            }
        }
        for len in [0, 2, 12, 16, 17] {
            assert_eq!(Sent::from_numbers(&NUMBERS[..len]), None, "{len} numbers");
        }
    }

    #[test]
    fn a_line_says_the_same_as_a_packet() {
        let line = |text: &str| Sent::from_json(&serde_json::from_str(text).unwrap());
        let text = "{\"id\": 3, \"a\": 0, \"b\": 2, \"point\": [1,-2,0.5], \"normal\": [0,0,1], \"impulse\": 0.095, \
            \"velocity\": [0.3,0,-0.1], \"approach\": 0.2, \"travel_a\": [0.4,0,0], \"step\": 0.01}";
        assert_eq!(line(text).unwrap(), Sent::from_numbers(&NUMBERS).unwrap());
        assert_eq!(line("{\"id\": 3, \"ends\": true}").unwrap(), Sent::end(3));
        for (from, to, part) in [
            ("[0,0,1]", "[0,0]", "`normal` is [0,0]; a list of three numbers is needed"),
            ("\"a\": 0", "\"a\": \"floor\"", "`a` is \"floor\"; a whole number"),
            (", \"step\": 0.01", "", "`impulse` needs `step`"),
            ("\"impulse\": 0.095, ", "", "`force` is nothing; newtons are needed"),
            ("approach", "speed", "there is no key `speed`"),
        ] {
            let e = line(&text.replace(from, to)).unwrap_err();
            assert!(e.contains(part), "{e}");
        }
    }

    #[test]
    fn contacts_begin_go_on_and_end_by_word_or_by_silence() {
        let mut gathering = Gathering::new(ticks(0.01), ticks(0.05), 2);
        let sent = |id| Sent { id, step: None, ..Sent::from_numbers(&NUMBERS).unwrap() };
        let first = gathering.take(0, &sent(1)).unwrap();
        assert!(first.begins && !first.ends && first.interval == ticks(0.01));
        let next = gathering.take(ticks(0.02), &sent(1)).unwrap();
        assert!(!next.begins && next.interval == ticks(0.02));
        assert!(gathering.take(ticks(0.02), &sent(2)).unwrap().begins);
        assert!(gathering.take(ticks(0.02), &sent(3)).is_none() && gathering.left_out == 1);
        let ended = gathering.take(ticks(0.03), &Sent::end(2)).unwrap();
        assert!(ended.ends && ended.force == 0.0 && ended.bodies == [0, 2]);
        assert!(gathering.take(ticks(0.03), &Sent::end(2)).is_none());
        assert_eq!(gathering.next_ended(ticks(0.07)), None);
        let (at, stalled) = gathering.next_ended(ticks(0.071)).unwrap();
        assert!(at == ticks(0.07) && stalled.ends && stalled.contact == 1);
        assert!(gathering.take(ticks(0.08), &sent(1)).unwrap().begins, "it may come again");
    }

    #[test]
    fn body_a_is_the_one_with_the_smaller_number() {
        let mut gathering = Gathering::new(ticks(0.01), ticks(0.05), 2);
        let sent = Sent { bodies: [2, 0], ..Sent::from_numbers(&NUMBERS).unwrap() };
        let frame = gathering.take(0, &sent).unwrap();
        assert_eq!(
            (frame.bodies, frame.normal, frame.velocity),
            ([0, 2], [-0.0, -0.0, -1.0], [-0.3, -0.0, 0.1])
        );
        assert_eq!(frame.travel[1], Some([0.4, 0.0, 0.0]));
    }
}
