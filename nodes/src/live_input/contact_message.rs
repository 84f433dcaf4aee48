//! Messages of contacts: from OSC numbers or JSON, to and from [`Message`].

use serde_json::{Map, Value};

use crate::contact::vector::{Vec3, norm};
use crate::core::input::{Message, MessageKind};

/// One frame of a contact in a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactMessage {
    /// Identifier of the contact.
    pub id: u64,
    /// Bodies a and b.
    pub bodies: [u32; 2],
    /// Position, m.
    pub point: [f64; 3],
    /// Normal from a to b, of any length except 0.
    pub normal: [f64; 3],
    /// Normal force, N.
    pub force: f64,
    /// Velocity of b relative to a, m/s.
    pub velocity: [f64; 3],
    /// Approach speed at the begin of the contact, m/s.
    pub approach: Option<f64>,
    /// Depth of penetration, m, negative for a gap.
    pub depth: Option<f64>,
    /// Effective mass, kg.
    pub mass: Option<f64>,
    /// Velocity of the contact point over the surface of a, m/s.
    pub travel: Option<[f64; 3]>,
    /// Time since the previous frame, s.
    pub step: Option<f64>,
    /// True if the contact has ended.
    pub ends: bool,
}

/// Largest magnitude of a number in a message.
const MAX_NUMBER: f64 = 1e9;
/// Placeholder for an unknown number.
const UNKNOWN: f64 = -1.0;

impl ContactMessage {
    /// Returns true if all numbers are valid.
    fn is_valid(&self) -> bool {
        let vectors = [self.point, self.normal, self.velocity, self.travel.unwrap_or_default()];
        let positive = [Some(self.force), self.approach, self.mass, self.step];
        vectors.iter().flatten().chain(&self.depth).all(|x| x.abs() <= MAX_NUMBER)
            && positive.iter().flatten().all(|x| (0.0..=MAX_NUMBER).contains(x))
            && self.bodies[0] != self.bodies[1]
            && (self.ends || norm(self.normal) > 1e-6)
            && self.id < 1 << 53
    }

    /// Parses the numbers of an OSC message: id, a, b, position, normal, force and velocity, optionally followed by approach,
    /// mass, travel over a, time since the previous frame and depth; -1 stands for an unknown number. An id alone ends its
    /// contact. Returns `None` for invalid numbers.
    #[must_use]
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let integer = |k: usize| {
            let x = *numbers.get(k)?;
            (x.fract() == 0.0 && (0.0..9e15).contains(&x)).then_some(x)
        };
        let id = integer(0)? as u64;
        if numbers.len() == 1 {
            return Some(Self::end(id));
        }
        let vector = |k: usize| -> Option<Vec3> { numbers.get(k..k + 3)?.try_into().ok() };
        let optional = |k: usize| numbers.get(k).copied().filter(|x| *x != UNKNOWN);
        if !(13..=20).contains(&numbers.len()) || (16..18).contains(&numbers.len()) {
            return None;
        }
        let message = Self {
            id,
            bodies: [u32::try_from(integer(1)? as u64).ok()?, u32::try_from(integer(2)? as u64).ok()?],
            point: vector(3)?,
            normal: vector(6)?,
            force: *numbers.get(9)?,
            velocity: vector(10)?,
            approach: optional(13),
            mass: optional(14),
            travel: vector(15),
            step: optional(18),
            depth: optional(19),
            ends: false,
        };
        message.is_valid().then_some(message)
    }

    /// The message that ends a contact.
    pub(super) fn end(id: u64) -> Self {
        let zero = [0.0; 3];
        Self {
            id,
            bodies: [0, 1],
            point: zero,
            normal: zero,
            force: 0.0,
            velocity: zero,
            approach: None,
            depth: None,
            mass: None,
            travel: None,
            step: None,
            ends: true,
        }
    }

    /// Parses one contact of a line of JSON: `id`, `a`, `b`, `point`, `normal`, `force` or `impulse`, `velocity`, and optionally
    /// `approach`, `depth`, `mass`, `travel_a` and `step`; or `id` and `"ends": true`.
    ///
    /// # Errors
    /// The key, the value found and what is needed.
    pub fn from_json(object: &Map<String, Value>) -> Result<Self, String> {
        const KEYS: [&str; 14] = [
            "id", "a", "b", "point", "normal", "force", "impulse", "velocity", "approach", "depth", "mass",
            "travel_a", "step", "ends",
        ];
        if let Some(key) = object.keys().find(|key| !KEYS.contains(&key.as_str())) {
            return Err(format!("there is no key `{key}`; the keys are {}", KEYS.join(", ")));
        }
        let error = |key: &str, expected: &str| {
            let found = object.get(key).map_or("missing".into(), Value::to_string);
            format!("`{key}` is {}; {expected} needed", found.chars().take(40).collect::<String>())
        };
        let integer = |key: &str| {
            object.get(key).and_then(Value::as_u64).ok_or_else(|| error(key, "a whole number from 0 on is"))
        };
        let id = integer("id")?;
        if object.get("ends") == Some(&Value::Bool(true)) {
            return Ok(Self::end(id));
        }
        let optional = |key: &str| match object.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => {
                let x = value.as_f64().filter(|x| (0.0..=MAX_NUMBER).contains(x));
                x.map(Some).ok_or_else(|| error(key, "a number from 0 on is"))
            }
        };
        let vector = |key: &str| {
            let list = object.get(key).and_then(Value::as_array);
            let list: Option<Vec<f64>> = list.and_then(|list| list.iter().map(Value::as_f64).collect());
            list.and_then(|list| Vec3::try_from(list).ok())
                .ok_or_else(|| error(key, "a list of three numbers is"))
        };
        let body =
            |key: &str| u32::try_from(integer(key)?).map_err(|_| error(key, "the number of a body is"));
        let step = optional("step")?;
        let force = match (optional("force")?, optional("impulse")?, step.filter(|step| *step > 0.0)) {
            (Some(force), ..) => force,
            (None, Some(impulse), Some(step)) => impulse / step,
            (None, Some(_), None) => return Err("`impulse` needs `step`, the seconds of a frame".into()),
            _ => return Err(error("force", "newtons are")),
        };
        let message = Self {
            id,
            bodies: [body("a")?, body("b")?],
            point: vector("point")?,
            normal: vector("normal")?,
            force,
            velocity: vector("velocity")?,
            approach: optional("approach")?,
            depth: match object.get("depth") {
                None | Some(Value::Null) => None,
                Some(value) => Some(value.as_f64().ok_or_else(|| error("depth", "a number is"))?),
            },
            mass: optional("mass")?,
            travel: object.contains_key("travel_a").then(|| vector("travel_a")).transpose()?,
            step,
            ends: false,
        };
        let reason = "a contact needs two different bodies, a normal that is not 0 and numbers up to 1e9";
        if message.is_valid() { Ok(message) } else { Err(reason.into()) }
    }
}

/// Encodes a contact message; returns `None` if it is not valid.
#[must_use]
pub fn contact_to_message(contact: &ContactMessage) -> Option<Message> {
    if !contact.is_valid() {
        return None;
    }
    let ([px, py, pz], [nx, ny, nz], [vx, vy, vz]) = (contact.point, contact.normal, contact.velocity);
    let [tx, ty, tz] = contact.travel.unwrap_or_default();
    let or_unknown = |x: Option<f64>| x.unwrap_or(UNKNOWN);
    let numbers = [
        contact.id as f64,
        contact.bodies[0].into(),
        contact.bodies[1].into(),
        px,
        py,
        pz,
        nx,
        ny,
        nz,
        contact.force,
        vx,
        vy,
        vz,
        or_unknown(contact.approach),
        or_unknown(contact.mass),
        tx,
        ty,
        tz,
        or_unknown(contact.step),
        or_unknown(contact.depth),
        f64::from(u8::from(contact.travel.is_some())),
        f64::from(u8::from(contact.ends)),
    ];
    Message::new(MessageKind::Contact, &numbers)
}

/// Decodes a contact message; returns `None` for any other message.
#[must_use]
pub fn contact_from_message(message: &Message) -> Option<ContactMessage> {
    if message.kind() != MessageKind::Contact {
        return None;
    }
    let (numbers, flags) = message.numbers().split_at_checked(20)?;
    let [has_travel, ends] = *flags else { return None };
    if ends > 0.0 {
        return Some(ContactMessage::end(*numbers.first()? as u64));
    }
    let contact = ContactMessage::from_numbers(numbers)?;
    Some(ContactMessage { travel: contact.travel.filter(|_| has_travel > 0.0), ..contact })
}

#[cfg(test)]
mod tests {
    use super::*;

    const NUMBERS: [f64; 19] =
        [3.0, 0.0, 2.0, 1.0, -2.0, 0.5, 0.0, 0.0, 1.0, 9.5, 0.3, 0.0, -0.1, 0.2, -1.0, 0.4, 0.0, 0.0, 0.01];

    #[test]
    fn encoding_and_decoding_a_contact_changes_nothing() {
        let full = ContactMessage::from_numbers(&NUMBERS).unwrap();
        assert_eq!((full.approach, full.mass, full.travel), (Some(0.2), None, Some([0.4, 0.0, 0.0])));
        let short = ContactMessage::from_numbers(&NUMBERS[..13]).unwrap();
        for contact in [full, short, ContactMessage::end(7)] {
            assert_eq!(contact_from_message(&contact_to_message(&contact).unwrap()), Some(contact));
        }
        let deep = ContactMessage::from_numbers(&[&NUMBERS[..], &[-0.002]].concat()).unwrap();
        assert_eq!((full.depth, deep.depth), (None, Some(-0.002)));
        assert_eq!(contact_from_message(&contact_to_message(&deep).unwrap()), Some(deep));
        assert_eq!(ContactMessage::from_numbers(&[&NUMBERS[..], &[f64::NAN]].concat()), None);
        assert_eq!(contact_from_message(&Message::new(MessageKind::Contact, &[1.0]).unwrap()), None);
    }

    #[test]
    fn invalid_numbers_are_rejected() {
        for (index, number) in [(0, -1.0), (0, 0.5), (2, 0.0), (8, 0.0), (9, -3.0), (3, 1e30), (13, -2.0)] {
            let mut numbers = NUMBERS;
            numbers[index] = number;
            assert_eq!(ContactMessage::from_numbers(&numbers), None, "{number} at {index}");
        }
        for index in 0..NUMBERS.len() {
            for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut numbers = NUMBERS;
                numbers[index] = number;
                assert_eq!(ContactMessage::from_numbers(&numbers), None, "{number} at {index}");
            }
        }
        for len in [0, 2, 12, 16, 17] {
            assert_eq!(ContactMessage::from_numbers(&NUMBERS[..len]), None, "{len} numbers");
        }
    }

    #[test]
    fn json_and_osc_describe_the_same_contact() {
        let line = |text: &str| ContactMessage::from_json(&serde_json::from_str(text).unwrap());
        let text = "{\"id\": 3, \"a\": 0, \"b\": 2, \"point\": [1,-2,0.5], \"normal\": [0,0,1], \"impulse\": 0.095, \
            \"velocity\": [0.3,0,-0.1], \"approach\": 0.2, \"travel_a\": [0.4,0,0], \"step\": 0.01}";
        assert_eq!(line(text).unwrap(), ContactMessage::from_numbers(&NUMBERS).unwrap());
        assert_eq!(line("{\"id\": 3, \"ends\": true}").unwrap(), ContactMessage::end(3));
        let deep = text.replace("\"approach\"", "\"depth\": 0.003, \"approach\"");
        assert_eq!(line(&deep).unwrap().depth, Some(0.003));
        for (from, to, part) in [
            ("[0,0,1]", "[0,0]", "`normal` is [0,0]; a list of three numbers is needed"),
            ("\"a\": 0", "\"a\": \"floor\"", "`a` is \"floor\"; a whole number"),
            (", \"step\": 0.01", "", "`impulse` needs `step`"),
            ("\"impulse\": 0.095, ", "", "`force` is missing; newtons are needed"),
            ("approach", "speed", "there is no key `speed`"),
        ] {
            let e = line(&text.replace(from, to)).unwrap_err();
            assert!(e.contains(part), "{e}");
        }
    }
}
