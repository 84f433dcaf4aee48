//! Messages as OSC over UDP.
//!
//! | address | arguments |
//! |---|---|
//! | `/foley/impact/CHANNEL` | energy in J, then optionally hardness, object, point, x, y, z |
//! | `/foley/contact/CHANNEL` | id, a, b, point (3), normal (3), force, velocity (3), then optionally approach, mass, travel over a (3), step, depth; or only an id, which ends the contact |
//! | `/foley/trigger/CHANNEL` | gain, then optionally index, ratio |
//! | `/foley/control/CHANNEL` | up to 16 numbers |
//! | `/foley/set/NAME` | a number, text or Boolean; `/foley/set/NODE/PARAM` for the parameter of a node |
//!
//! The messages of a bundle take effect at its time, or at once if that has passed.

use super::hub::Hub;
use super::listener::Listener;
use super::refusals::Refusal;
use foley_nodes::core::input::MessageKind;
use foley_nodes::dsp::Trigger;
use foley_nodes::live_input::{
    ContactMessage, contact_to_message, control_to_message, impact_to_message, trigger_to_message,
};
use foley_nodes::modal::{Body, Impact};
use rosc::{OscPacket, OscTime, OscType};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Seconds from 1900, the epoch of OSC, to 1970.
const EPOCH: f64 = 2_208_988_800.0;
/// Maximum depth of nested bundles.
const MAX_DEPTH: usize = 8;
/// Bytes of the beginning of a packet that a message shows.
const MAX_SHOWN: usize = 60;

/// Time from now to a time tag.
fn wait(time: OscTime, now: f64) -> Duration {
    // The time tag (0, 1) means at once.
    if (time.seconds, time.fractional) == (0, 1) {
        return Duration::ZERO;
    }
    let at = f64::from(time.seconds) + f64::from(time.fractional) / 4_294_967_296.0 - EPOCH;
    Duration::from_secs_f64((at - now).clamp(0.0, 3600.0))
}

fn number(argument: &OscType) -> Option<f64> {
    match argument {
        OscType::Int(x) => Some(f64::from(*x)),
        OscType::Long(x) => Some(*x as f64),
        OscType::Float(x) => Some(f64::from(*x)),
        OscType::Double(x) => Some(*x),
        OscType::Bool(x) => Some(f64::from(u8::from(*x))),
        _ => None,
    }
}

/// Converts a parameter value to RON.
fn ron(argument: &OscType) -> Option<String> {
    match argument {
        OscType::Int(x) => Some(x.to_string()),
        OscType::Long(x) => Some(x.to_string()),
        OscType::Float(x) => Some(format!("{x:?}")),
        OscType::Double(x) => Some(format!("{x:?}")),
        OscType::Bool(x) => Some(x.to_string()),
        OscType::String(text) => Some(text.clone()),
        OscType::Nil => Some("None".to_owned()),
        _ => None,
    }
}

/// Makes an impact from the numbers of a message.
fn impact(numbers: &[f64]) -> Option<Impact> {
    let &energy = numbers.first()?;
    if !(0.0..=1e9).contains(&energy) {
        return None;
    }
    let mut impact = Impact::from_energy(energy, Body { mass: 0.1, restitution: 0.5 });
    let index = |k: usize| match numbers.get(k) {
        None => Some(0),
        Some(x) => (x.fract() == 0.0 && (0.0..=1e6).contains(x)).then_some(*x as u32),
    };
    impact.hardness = numbers.get(1).map_or(1.0, |x| *x as f32);
    (impact.object, impact.point) = (index(2)?, index(3)?);
    for (coordinate, x) in impact.position.iter_mut().zip(numbers.get(4..).unwrap_or_default()) {
        *coordinate = *x as f32;
    }
    impact.is_valid().then_some(impact)
}

/// Arguments that a message requires.
fn wanted(kind: MessageKind) -> &'static str {
    match kind {
        MessageKind::Impact => {
            "an energy in J from 0 to 1e9, then optionally hardness, object, point, x, y, z"
        }
        MessageKind::Contact => {
            "id, a, b, point (3), normal (3), force, velocity (3), then optionally approach, mass, travel (3), step, depth; or an id alone"
        }
        MessageKind::Trigger => "a gain, then optionally an index from 0 on and a ratio from 0.0625 to 16",
        MessageKind::Control => "1 to 16 numbers",
    }
}

/// Delivers a message.
///
/// # Errors
/// A text with the value found and what is needed, if it is malformed.
fn deliver_message(message: &rosc::OscMessage, wait: Duration, hub: &Hub) -> Result<(), String> {
    let address = &message.addr;
    let parts = address.strip_prefix("/foley/").and_then(|path| path.split_once('/'));
    let (kind, name) = parts.filter(|(_, name)| !name.is_empty()).unwrap_or_default();
    if kind == "set" {
        let value = message.args.first().and_then(ron);
        let value = value.ok_or_else(|| format!("{address:?}: a number, a text or a Boolean is needed"))?;
        hub.set(name.replace('/', "."), value);
        return Ok(());
    }
    let Some(kind) = MessageKind::ALL.into_iter().find(|known| known.word() == kind) else {
        let kinds = MessageKind::ALL.map(MessageKind::word).join(", ");
        return Err(format!(
            "{address:?}: there is no such address; addresses are /foley/KIND/CHANNEL with a kind of {kinds}, and /foley/set/NAME"
        ));
    };
    let mut numbers = Vec::with_capacity(message.args.len());
    for (k, argument) in message.args.iter().enumerate() {
        let found = match argument {
            OscType::String(text) => format!("{text:?}"),
            _ => "of another type".to_owned(),
        };
        let needed = || format!("{address:?}: argument {} is {found}; a number is needed", k + 1);
        numbers.push(number(argument).ok_or_else(needed)?);
    }
    let encoded = match kind {
        MessageKind::Impact => impact(&numbers).and_then(|impact| impact_to_message(&impact)),
        MessageKind::Contact => {
            ContactMessage::from_numbers(&numbers).and_then(|contact| contact_to_message(&contact))
        }
        MessageKind::Trigger => {
            Trigger::from_numbers(&numbers).and_then(|trigger| trigger_to_message(&trigger))
        }
        MessageKind::Control => Some(&numbers).filter(|n| !n.is_empty()).and_then(|n| control_to_message(n)),
    };
    let found = || {
        let found: Vec<_> = numbers.iter().map(ToString::to_string).collect();
        let found = if found.is_empty() { "no argument".to_owned() } else { found.join(", ") };
        format!("{address:?}: {found}; needed: {}", wanted(kind))
    };
    hub.deliver(name, encoded.ok_or_else(found)?, wait);
    Ok(())
}

/// Time tag and elements of a bundle; `None` if the packet is no bundle.
fn bundle(packet: &[u8]) -> Option<(OscTime, &[u8])> {
    let (tag, elements) = packet.strip_prefix(b"#bundle\0")?.split_first_chunk::<8>()?;
    let [seconds, fractional] =
        [&tag[..4], &tag[4..]].map(|half| half.iter().fold(0, |word, byte| word << 8 | u32::from(*byte)));
    Some((OscTime { seconds, fractional }, elements))
}

/// Splits the first element off a bundle; `None` if its size is not that of a packet inside the bundle.
fn element(elements: &[u8]) -> Option<(&[u8], &[u8])> {
    let (size, rest) = elements.split_first_chunk::<4>()?;
    let size = u32::from_be_bytes(*size) as usize;
    if size.is_multiple_of(4) { rest.split_at_checked(size) } else { None }
}

/// Decodes a message, whose size is a multiple of 4.
///
/// Arrays are refused before they are decoded: no message has one, and to free them takes stack for each level.
///
/// # Errors
/// A text with the value found.
fn message(packet: &[u8]) -> Result<rosc::OscMessage, String> {
    let address = packet.split(|byte| *byte == 0).next().unwrap_or_default();
    let tags = packet.get(address.len() / 4 * 4 + 4..).and_then(|rest| rest.split(|byte| *byte == 0).next());
    let begin = String::from_utf8_lossy(&address[..address.len().min(MAX_SHOWN)]);
    match tags {
        _ if address.first() != Some(&b'/') => {
            Err(format!("a packet is no OSC message: it begins with {begin:?}"))
        }
        Some(tags) if tags.contains(&b'[') => {
            Err(format!("{begin:?}: an argument is a list; none is needed"))
        }
        _ => match rosc::decoder::decode_udp(packet) {
            Ok((_, OscPacket::Message(message))) => Ok(message),
            Ok((_, OscPacket::Bundle(_))) | Err(_) => {
                Err(format!("{begin:?}: the arguments of the packet cannot be read"))
            }
        },
    }
}

fn refuse(hub: &Hub, text: impl FnOnce() -> String) {
    hub.refusals.refuse(Refusal::Malformed, || format!("OSC: {}", text()));
}

/// Reads one packet; malformed ones are counted, as are bundles deeper than 8 and messages in a bundle.
///
/// The bundles are walked here, in memory that the depth does not change: the decoder calls itself for each level.
pub fn read_packet(bytes: &[u8], hub: &Hub) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
    // Bundles that are open: what is left of each, and its time.
    let mut open: Vec<(&[u8], Duration)> = Vec::with_capacity(MAX_DEPTH);
    let mut next = Some((bytes, Duration::ZERO));
    loop {
        if let Some((packet, time)) = next.take() {
            match bundle(packet) {
                Some((tag, elements)) if open.len() < MAX_DEPTH => open.push((elements, wait(tag, now))),
                Some(_) => {
                    refuse(hub, || format!("bundles are inside each other more than {MAX_DEPTH} times"))
                }
                None => {
                    let delivered = message(packet).and_then(|m| deliver_message(&m, time, hub));
                    delivered.unwrap_or_else(|text| refuse(hub, || text));
                }
            }
        }
        let Some((elements, time)) = open.last_mut() else { return };
        match element(elements) {
            Some((first, rest)) => {
                *elements = rest;
                next = Some((first, *time));
            }
            None => {
                if !elements.is_empty() {
                    refuse(hub, || "an element of a bundle has a wrong size".to_owned());
                }
                open.pop();
            }
        }
    }
}

/// Listens for OSC packets.
///
/// # Errors
/// When the address cannot be bound.
pub fn listen_to_osc(at: SocketAddr, hub: Arc<Hub>) -> std::io::Result<Listener> {
    let socket = UdpSocket::bind(at)?;
    socket.set_read_timeout(Some(Duration::from_millis(100)))?;
    let at = socket.local_addr()?;
    Ok(Listener::start(at, move |stop| {
        let mut bytes = vec![0; 65_536];
        while !stop.load(Relaxed) {
            if let Ok(n) = socket.recv(&mut bytes) {
                read_packet(&bytes[..n], &hub);
            }
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::checks::{check_packet, seeds};
    use foley_nodes::core::input::Inputs;
    use foley_nodes::core::random::Rng;
    use foley_nodes::core::time::{seconds, ticks};
    use foley_nodes::live_input::{impact_from_message, trigger_from_message};
    use rosc::{OscBundle, OscMessage, encoder::encode};

    fn bytes(addr: &str, args: Vec<OscType>) -> Vec<u8> {
        encode(&OscPacket::Message(OscMessage { addr: addr.into(), args })).unwrap()
    }

    #[test]
    fn each_kind_of_message_arrives() {
        let hub = Hub::new();
        let (mut hits, mut numbers) = (
            hub.open("hits", MessageKind::Impact, 24).unwrap(),
            hub.open("a/b", MessageKind::Control, 24).unwrap(),
        );
        read_packet(
            &bytes("/foley/impact/hits", vec![OscType::Float(0.5), OscType::Float(0.1), OscType::Int(2)]),
            &hub,
        );
        read_packet(&bytes("/foley/control/a/b", vec![OscType::Float(1.0), OscType::Int(-2)]), &hub);
        read_packet(&bytes("/foley/set/bell/gain", vec![OscType::Float(0.25)]), &hub);
        for wrong in ["/foley/impact/hits", "/foley/nothing/x", "/other", "/foley/set/"] {
            read_packet(&bytes(wrong, Vec::new()), &hub);
        }
        let impact = impact_from_message(&hits.next(1).unwrap().1).unwrap();
        assert_eq!((impact.energy, impact.hardness, impact.object), (0.5, 0.1, 2));
        assert_eq!(numbers.next(1).unwrap().1.numbers(), [1.0, -2.0]);
        assert_eq!(
            hub.take_sets(Duration::ZERO)[0],
            super::super::Set { target: "bell.gain".into(), value: "0.25".into() }
        );
        assert_eq!(hub.refusals.count(Refusal::Malformed), 4);
    }

    #[test]
    fn triggers_arrive_with_their_index_and_ratio_or_are_counted_as_malformed() {
        let hub = Hub::new();
        let mut inbox = hub.open("taps", MessageKind::Trigger, 24).unwrap();
        let send = |args: Vec<OscType>| read_packet(&bytes("/foley/trigger/taps", args), &hub);
        send(vec![OscType::Float(0.5)]);
        send(vec![OscType::Float(0.5), OscType::Int(3), OscType::Float(2.0)]);
        send(Vec::new());
        send(vec![OscType::Float(f32::NAN)]);
        send(vec![OscType::Float(0.5), OscType::Int(-1)]);
        send(vec![OscType::Float(0.5), OscType::Int(3), OscType::Float(0.0)]);
        let triggers: Vec<_> = std::iter::from_fn(|| inbox.next(1))
            .map(|(_, message)| trigger_from_message(&message).unwrap())
            .collect();
        assert_eq!(triggers, [Trigger::of(0.5), Trigger { gain: 0.5, index: 3, ratio: 2.0 }]);
        assert_eq!(hub.refusals.count(Refusal::Malformed), 4);
    }

    #[test]
    fn a_bundle_delivers_all_contacts_of_a_frame() {
        let hub = Hub::new();
        let mut inbox = hub.open("ball", MessageKind::Contact, 24).unwrap();
        let contact = |id: i32| {
            let numbers = [0.5_f32, 0.0, 0.0, 0.0, 0.0, 1.0, 9.5, 0.3, 0.0, -0.1];
            let mut args = vec![OscType::Int(id), OscType::Int(0), OscType::Int(1)];
            args.extend(numbers.map(OscType::Float));
            OscPacket::Message(OscMessage { addr: "/foley/contact/ball".into(), args })
        };
        let timetag = OscTime { seconds: 0, fractional: 1 };
        let bundle = OscBundle { timetag, content: (0..40).map(contact).collect() };
        read_packet(&encode(&OscPacket::Bundle(bundle)).unwrap(), &hub);
        read_packet(&bytes("/foley/contact/ball", vec![OscType::Int(7)]), &hub);
        let ids: Vec<_> = std::iter::from_fn(|| inbox.next(1))
            .filter_map(|(_, m)| foley_nodes::live_input::contact_from_message(&m))
            .map(|sent| (sent.id, sent.ends))
            .collect();
        assert_eq!(ids.len(), 41);
        assert_eq!((ids[39], ids[40]), ((39, false), (7, true)));
        assert_eq!(hub.refusals.count(Refusal::Malformed), 0);
    }

    #[test]
    fn the_messages_of_a_bundle_have_its_time() {
        let hub = Hub::new();
        let mut inbox = hub.open("c", MessageKind::Control, 24).unwrap();
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64() + EPOCH + 0.5;
        let timetag = OscTime { seconds: now as u32, fractional: (now.fract() * 4_294_967_296.0) as u32 };
        let inner = OscMessage { addr: "/foley/control/c".into(), args: vec![OscType::Float(1.0)] };
        let bundle = OscBundle { timetag, content: vec![OscPacket::Message(inner)] };
        read_packet(&encode(&OscPacket::Bundle(bundle)).unwrap(), &hub);
        let (at, _) = inbox.next(ticks(10.0)).unwrap();
        assert!((seconds(at) - 0.5).abs() < 0.1, "{}", seconds(at));
    }

    /// A packet inside `depth` bundles.
    fn nested(packet: &[u8], depth: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        for level in (0..depth).rev() {
            bytes.extend(b"#bundle\0\0\0\0\0\0\0\0\x01");
            bytes.extend((packet.len() as u32 + 20 * level as u32).to_be_bytes());
        }
        bytes.extend(packet);
        bytes
    }

    #[test]
    fn bundles_inside_each_other_are_refused_before_they_are_decoded() {
        let hub = Hub::new();
        let mut inbox = hub.open("x", MessageKind::Control, 24).unwrap();
        let message = bytes("/foley/control/x", vec![OscType::Float(4.0)]);
        // 3,276 levels are all that a packet has room for.
        for (depth, read) in [(0, 1), (1, 1), (8, 1), (9, 0), (2200, 0), (3276, 0)] {
            let before = hub.refusals.count(Refusal::Malformed);
            let packet = if depth == 3276 { nested(&[], depth) } else { nested(&message, depth) };
            assert!(packet.len() <= 65_535);
            read_packet(&packet, &hub);
            assert_eq!(std::iter::from_fn(|| inbox.next(1)).count(), read, "{depth}");
            assert_eq!(hub.refusals.count(Refusal::Malformed) - before, 1 - read as u64, "{depth}");
        }
    }

    #[test]
    fn arrays_inside_each_other_are_refused_before_they_are_decoded() {
        let hub = Hub::new();
        let mut packet = b"/foley/set/x\0\0\0\0,".to_vec();
        packet.extend([b'['; 32_000]);
        packet.extend([b']'; 32_000]);
        packet.extend([0; 3]);
        std::thread::scope(|scope| drop(scope.spawn(|| read_packet(&packet, &hub))));
        assert_eq!(hub.refusals.count(Refusal::Malformed), 1);
    }

    #[test]
    fn a_malformed_element_of_a_bundle_does_not_hide_the_next() {
        let hub = Hub::new();
        let mut inbox = hub.open("x", MessageKind::Control, 24).unwrap();
        let message = bytes("/foley/control/x", vec![OscType::Float(4.0)]);
        let mut packet = b"#bundle\0\0\0\0\0\0\0\0\x01".to_vec();
        for element in [&message[..], b"oops", &message[..]] {
            packet.extend((element.len() as u32).to_be_bytes());
            packet.extend(element);
        }
        packet.extend([0, 0, 0, 9]);
        read_packet(&packet, &hub);
        assert_eq!(std::iter::from_fn(|| inbox.next(1)).count(), 2);
        assert_eq!(hub.refusals.count(Refusal::Malformed), 2);
    }

    #[test]
    fn damaged_packets_do_not_panic() {
        let message = bytes("/foley/impact/hits", vec![OscType::Float(0.5), OscType::Int(1)]);
        let mut many = nested(&message, 3);
        many.extend((message.len() as u32).to_be_bytes());
        many.extend(&message);
        let good = [message.clone(), nested(&message, 7), many];
        for seed in seeds(6000) {
            let mut rng = Rng::new(seed);
            let mut bytes = good[seed as usize % 3].clone();
            for _ in 0..1 + rng.below(6) {
                let at = rng.below(bytes.len());
                match rng.below(4) {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] = rng.below(256) as u8,
                    2 => bytes.extend_from_within(at..),
                    _ => bytes.push(rng.below(256) as u8),
                }
            }
            check_packet(&bytes);
        }
    }

    #[test]
    fn packets_arrive_over_the_network() {
        let hub = Arc::new(Hub::new());
        let mut inbox = hub.open("x", MessageKind::Control, 24).unwrap();
        let listening = listen_to_osc("127.0.0.1:0".parse().unwrap(), Arc::clone(&hub)).unwrap();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.send_to(&bytes("/foley/control/x", vec![OscType::Float(4.0)]), listening.at).unwrap();
        let got = (0..200).find_map(|_| {
            std::thread::sleep(Duration::from_millis(10));
            inbox.next(1)
        });
        assert_eq!(got.unwrap().1.numbers(), [4.0]);
    }
}
