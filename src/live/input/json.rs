//! Messages as JSON lines.

use super::hub::{Hub, MAX_AHEAD};
use super::log_clock::{LogClock, MAX_LOG};
use super::refusals::Refusal;
use foley_nodes::core::input::Message;
use foley_nodes::core::time::Tick;
use foley_nodes::dsp::Trigger;
use foley_nodes::live_input::{
    ContactMessage, contact_to_message, control_to_message, impact_to_message, trigger_to_message,
};
use foley_nodes::modal::{Body, Defaults, read_impacts};
use serde_json::{Map, Value};
use std::io::BufRead;
use std::time::Duration;

/// Maximum bytes of a line.
const MAX_LINE_BYTES: usize = 64 * 1024;

/// Defaults of an impact.
fn defaults() -> Defaults {
    Defaults { body: Body { mass: 0.1, restitution: 0.5 }, hardness: 1.0, objects: Vec::new() }
}

/// Converts a JSON value of a parameter to RON.
fn ron(value: &Value) -> Option<String> {
    match value {
        Value::Bool(_) | Value::Number(_) => Some(value.to_string()),
        Value::String(text) => Some(text.clone()),
        Value::Null => Some("None".to_owned()),
        Value::Array(list) => {
            let parts = list.iter().map(|v| match v {
                Value::String(text) => Some(format!("{text:?}")),
                other => ron(other),
            });
            Some(format!("[{}]", parts.collect::<Option<Vec<_>>>()?.join(", ")))
        }
        Value::Object(_) => None,
    }
}

/// Time of a message.
#[derive(Clone, Copy, Debug)]
enum When {
    /// Seconds from now.
    In(Duration),
    /// A tick of the piece.
    At(Tick),
}

impl When {
    fn deliver(self, hub: &Hub, channel: &str, message: Message) {
        match self {
            Self::In(wait) => hub.deliver(channel, message, wait),
            Self::At(tick) => hub.deliver_at(channel, message, tick),
        }
    }
}

/// Reads one line:
///
/// - `{"impact": CHANNEL, "velocity": 2.0, ...}`: an impact, with the keys of an impact file; `in` seconds from now.
/// - `{"contact": CHANNEL, "id": 1, "a": 0, ...}`: one frame of a contact, or `"contacts": [...]` with all of a frame.
/// - `{"trigger": CHANNEL, "gain": 1.0, "index": 0, "ratio": 1.0}`: a trigger; each of the three may be left out.
/// - `{"control": CHANNEL, "values": [...]}`: numbers for a `LiveControl`.
/// - `{"set": NAME, "value": VALUE}`: a parameter, as with `--set`.
///
/// `time_s` in an impact, a contact, a trigger or a control is a time on the sender's clock, as in a log: see `LogClock`.
///
/// # Errors
/// A message with the error found and the expected form.
pub fn read_line(line: &str, hub: &Hub, log: &mut LogClock) -> Result<(), String> {
    let mut object: Map<String, Value> =
        serde_json::from_str(line).map_err(|e| format!("no JSON object on one line: {e}"))?;
    let text = |object: &mut Map<String, Value>, key: &str| match object.remove(key) {
        Some(Value::String(text)) => Ok(Some(text)),
        Some(other) => Err(format!("`{key}` is {other}; a name is needed")),
        None => Ok(None),
    };
    let wait = match object.remove("in") {
        None => 0.0,
        Some(wait) => {
            let longest = MAX_AHEAD.as_secs();
            let seconds = wait.as_f64().filter(|s| (0.0..=MAX_AHEAD.as_secs_f64()).contains(s));
            seconds.ok_or_else(|| format!("`in` is {wait}; seconds from 0 to {longest} are needed"))?
        }
    };
    let when = match object.remove("time_s") {
        None => When::In(Duration::from_secs_f64(wait)),
        Some(time) => {
            let seconds = time.as_f64().filter(|s| (0.0..=MAX_LOG).contains(s));
            let seconds = seconds.ok_or_else(|| format!("`time_s` is {time}; seconds from 0 are needed"))?;
            When::At(log.tick(seconds + wait, hub))
        }
    };
    if let Some(channel) = text(&mut object, "impact")? {
        object.insert("time_s".to_owned(), Value::from(0));
        let line = Value::Object(object).to_string();
        let impacts = read_impacts(line.as_bytes(), &defaults()).map_err(|e| e.message)?;
        for message in impacts.iter().filter_map(|(_, impact)| impact_to_message(impact)) {
            when.deliver(hub, &channel, message);
        }
        return Ok(());
    }
    if let Some(channel) = text(&mut object, "contact")? {
        return contacts(&channel, object, when, hub);
    }
    if let Some(channel) = text(&mut object, "trigger")? {
        let message = trigger_to_message(&trigger(&object)?).ok_or("its numbers are too large")?;
        when.deliver(hub, &channel, message);
        return Ok(());
    }
    if let Some(channel) = text(&mut object, "control")? {
        let values = object.remove("values");
        let list = values.as_ref().and_then(Value::as_array);
        let numbers: Option<Vec<f64>> = list.and_then(|list| list.iter().map(Value::as_f64).collect());
        let message = numbers.as_deref().and_then(control_to_message);
        when.deliver(hub, &channel, message.ok_or("`values` must be a list of up to 16 numbers")?);
        return Ok(());
    }
    if let Some(target) = text(&mut object, "set")? {
        let value = object.get("value").and_then(ron);
        hub.set(target, value.ok_or("`value` must be a number, a text, true, false or a list")?);
        return Ok(());
    }
    Err("one of `impact`, `contact`, `trigger`, `control` and `set` is needed".to_owned())
}

/// Makes a trigger from the other keys of a line.
fn trigger(object: &Map<String, Value>) -> Result<Trigger, String> {
    let mut numbers = [1.0, 0.0, 1.0];
    for (key, value) in object {
        let (k, needed) = match key.as_str() {
            "gain" => (0, "a number"),
            "index" => (1, "a whole number from 0 on"),
            "ratio" => (2, "a number from 0.0625 to 16"),
            _ => return Err(format!("there is no key `{key}`; keys are `gain`, `index` and `ratio`")),
        };
        numbers[k] = value.as_f64().unwrap_or(f64::NAN);
        if Trigger::from_numbers(&numbers).is_none() {
            return Err(format!("`{key}` is {value}; {needed} is needed"));
        }
    }
    Trigger::from_numbers(&numbers).ok_or_else(|| "this is not a trigger".to_owned())
}

/// Delivers one contact, or all contacts of a frame.
fn contacts(channel: &str, mut object: Map<String, Value>, when: When, hub: &Hub) -> Result<(), String> {
    let one = |object: &Map<String, Value>| {
        let sent = ContactMessage::from_json(object)?;
        contact_to_message(&sent).ok_or_else(|| "its numbers are too large".to_owned())
    };
    let Some(list) = object.remove("contacts") else {
        when.deliver(hub, channel, one(&object)?);
        return Ok(());
    };
    if let Some(key) = object.keys().next() {
        return Err(format!("`{key}` is beside `contacts`; it belongs in each item of that list"));
    }
    let Value::Array(list) = list else { return Err("`contacts` must be a list".to_owned()) };
    // All or none: a part of a frame would end the other contacts.
    let messages: Result<Vec<_>, _> = list
        .iter()
        .map(|item| one(item.as_object().ok_or("`contacts` must be a list of objects")?))
        .collect();
    messages?.into_iter().for_each(|message| when.deliver(hub, channel, message));
    Ok(())
}

/// Reads lines to the end; calls `report` with the number and the error of each wrong line.
pub fn read_lines(mut from: impl BufRead, hub: &Hub, mut report: impl FnMut(u64, &str)) {
    let mut line = Vec::new();
    let mut number = 0;
    let mut log = LogClock::default();
    loop {
        line.clear();
        number += 1;
        let mut limited = std::io::Read::take(&mut from, MAX_LINE_BYTES as u64);
        match limited.read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let result = if line.len() == MAX_LINE_BYTES && !line.ends_with(b"\n") {
            // What follows is a part of this line, and no line of its own.
            let rest = from.skip_until(b'\n');
            let most = MAX_LINE_BYTES - 1;
            rest.map_err(|e| e.to_string())
                .and(Err(format!("a line has at most {most} bytes; this one is ignored")))
        } else {
            let text = String::from_utf8_lossy(&line);
            // Some programs begin with a byte order mark.
            let text = text.trim_start_matches('\u{feff}').trim();
            if text.is_empty() { Ok(()) } else { read_line(text, hub, &mut log) }
        };
        if let Err(message) = result {
            hub.refusals.add(Refusal::Malformed);
            report(number, &message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::checks::{check_lines, seeds};
    use foley_nodes::core::input::{Inputs, MessageKind};
    use foley_nodes::core::random::Rng;
    use foley_nodes::live_input::{impact_from_message, trigger_from_message};
    use std::sync::atomic::Ordering::Relaxed;

    #[test]
    fn each_kind_of_line_arrives() {
        let hub = Hub::new();
        let (mut hits, mut numbers) = (
            hub.open("hits", MessageKind::Impact, 24).unwrap(),
            hub.open("pos", MessageKind::Control, 24).unwrap(),
        );
        let lines = "{\"impact\": \"hits\", \"velocity\": 2, \"mass\": 0.5}\n\n\
            {\"control\": \"pos\", \"values\": [1, 2.5, -3]}\n{\"set\": \"level\", \"value\": 0.5}\n{\"oops\": 1}\n";
        let mut wrong = Vec::new();
        read_lines(lines.as_bytes(), &hub, |line, message| wrong.push(format!("{line}: {message}")));
        let impact = impact_from_message(&hits.next(1).unwrap().1).unwrap();
        assert!((impact.energy - 1.0).abs() < 1e-6);
        assert_eq!(numbers.next(1).unwrap().1.numbers(), [1.0, 2.5, -3.0]);
        assert_eq!(
            hub.take_sets(Duration::ZERO)[0],
            super::super::Set { target: "level".into(), value: "0.5".into() }
        );
        assert_eq!(wrong, ["5: one of `impact`, `contact`, `trigger`, `control` and `set` is needed"]);
        assert_eq!((hub.delivered.load(Relaxed), hub.refusals.count(Refusal::Malformed)), (3, 1));
    }

    #[test]
    fn triggers_arrive_with_what_they_name_or_are_refused_with_a_reason() {
        let hub = Hub::new();
        let mut inbox = hub.open("taps", MessageKind::Trigger, 24).unwrap();
        let mut log = LogClock::default();
        let mut read = |keys: &str| read_line(&format!("{{\"trigger\": \"taps\"{keys}}}"), &hub, &mut log);
        read("").unwrap();
        read(", \"index\": 3, \"gain\": 0.5, \"ratio\": 2, \"in\": 0").unwrap();
        for (keys, part) in [
            (", \"ratio\": 0", "`ratio` is 0; a number from 0.0625 to 16 is needed"),
            (", \"index\": 0.5", "`index` is 0.5; a whole number from 0 on is needed"),
            (", \"gain\": \"loud\"", "`gain` is \"loud\"; a number is needed"),
            (", \"pitch\": 1", "there is no key `pitch`; keys are `gain`, `index` and `ratio`"),
        ] {
            assert_eq!(read(keys).unwrap_err(), part);
        }
        let triggers: Vec<_> = std::iter::from_fn(|| inbox.next(1))
            .map(|(_, message)| trigger_from_message(&message).unwrap())
            .collect();
        assert_eq!(triggers, [Trigger::of(1.0), Trigger { gain: 0.5, index: 3, ratio: 2.0 }]);
    }

    #[test]
    fn contacts_arrive_alone_or_as_a_whole_frame() {
        let hub = Hub::new();
        let mut inbox = hub.open("ball", MessageKind::Contact, 24).unwrap();
        let mut log = LogClock::default();
        let one = "\"id\": 1, \"a\": 0, \"b\": 1, \"point\": [0,0,0], \"normal\": [0,0,1], \"force\": 2, \"velocity\": [1,0,0]";
        read_line(&format!("{{\"contact\": \"ball\", {one}}}"), &hub, &mut log).unwrap();
        read_line(
            &format!("{{\"contact\": \"ball\", \"contacts\": [{{{one}}}, {{\"id\": 2, \"ends\": true}}]}}"),
            &hub,
            &mut log,
        )
        .unwrap();
        let ids: Vec<_> = std::iter::from_fn(|| inbox.next(1))
            .filter_map(|(_, m)| foley_nodes::live_input::contact_from_message(&m))
            .map(|sent| (sent.id, sent.ends))
            .collect();
        assert_eq!(ids, [(1, false), (1, false), (2, true)]);
        let wrong = format!("{{\"contact\": \"ball\", \"contacts\": [{{{one}}}, {{\"id\": 2}}]}}");
        assert!(read_line(&wrong, &hub, &mut log).unwrap_err().contains("`force` is missing"));
        assert!(inbox.next(1).is_none(), "all or none");
    }

    #[test]
    fn a_line_that_is_too_long_is_ignored_with_its_end_and_a_byte_order_mark_is_skipped() {
        let hub = Hub::new();
        let good = "{\"set\": \"a\", \"value\": 1}";
        let lines = format!(
            "\u{feff}{good}\n{}{good}\n{}{good}",
            " ".repeat(65_536),
            " ".repeat(65_535 - good.len())
        );
        let mut wrong = Vec::new();
        read_lines(lines.as_bytes(), &hub, |line, message| wrong.push(format!("{line}: {message}")));
        assert_eq!(wrong, ["2: a line has at most 65535 bytes; this one is ignored"]);
        assert_eq!((hub.delivered.load(Relaxed), hub.refusals.count(Refusal::Malformed)), (2, 1));
    }

    #[test]
    fn damaged_lines_are_counted_or_delivered() {
        let good = [
            "{\"trigger\": \"x\", \"gain\": 0.5, \"index\": 3, \"ratio\": 0.5}",
            "{\"impact\": \"hits\", \"velocity\": 2, \"mass\": 0.5, \"in\": 0.1}",
            "{\"contact\": \"ball\", \"contacts\": [{\"id\": 1, \"ends\": true}, {\"id\": 2, \"ends\": true}]}",
            "{\"control\": \"x\", \"values\": [0.5, -1e9]}\n{\"set\": \"level\", \"value\": [true, \"a\"]}",
        ];
        for seed in seeds(3000) {
            let mut rng = Rng::new(seed);
            let mut bytes = good[seed as usize % 4].as_bytes().to_vec();
            for _ in 0..rng.below(5) {
                let at = rng.below(bytes.len());
                match rng.below(4) {
                    0 => bytes[at] = rng.below(256) as u8,
                    1 => drop(bytes.remove(at)),
                    2 => bytes.extend_from_within(at..),
                    _ => bytes.insert(at, b"{}[]\",:0e-1"[rng.below(11)]),
                }
            }
            check_lines(&bytes);
        }
    }
}
