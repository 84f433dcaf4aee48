//! A ball on a tiled floor between four walls, kicked every few seconds, or a capsule that a person steers. Its contacts are sent
//! in the formats that `foley live` reads.
//!
//! ```text
//! rolling_ball [--steer | --script FILE] [--seconds S] [--wait S] [--rate HZ] [--osc ADDRESS:PORT | --offline FILE]
//! ```

mod keys;
mod scene;

use keys::Keys;
use scene::{Contact, Roller, Scene};
use serde_json::{Value, json};
use std::io::Write;
use std::net::UdpSocket;
use std::time::{Duration, Instant};

/// Destination of the contacts.
enum To {
    /// JSON lines in real time, one per frame.
    Lines,
    /// OSC bundles in real time, one per frame.
    Osc(UdpSocket, String),
    /// A log for `ContactLog`, written as fast as possible.
    Log(std::io::BufWriter<std::fs::File>),
}

struct Options {
    seconds: f64,
    /// Pause before the first frame, s: frames sent while the listener starts would all arrive at once.
    wait: f64,
    rate: f64,
    to: To,
    /// Keys that steer the capsule in place of the ball.
    keys: Keys,
}

fn options() -> Result<Options, String> {
    let mut options =
        Options { seconds: f64::INFINITY, wait: 3.0, rate: 120.0, to: To::Lines, keys: Keys::None };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut next = || words.next().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "--seconds" => options.seconds = number(&next()?)?,
            "--wait" => options.wait = number(&next()?)?,
            "--rate" => options.rate = number(&next()?)?,
            "--steer" => options.keys = Keys::typed(),
            "--script" => {
                let file = next()?;
                let text = std::fs::read_to_string(&file).map_err(|e| format!("{file}: {e}"))?;
                options.keys = Keys::script(&text)?;
                // It rolls on for a while after the last key.
                options.seconds = options.seconds.min(options.keys.end().unwrap_or(0.0) + 2.0);
            }
            "--osc" => {
                let socket = UdpSocket::bind("0.0.0.0:0").map_err(|e| e.to_string())?;
                options.to = To::Osc(socket, next()?);
            }
            "--offline" => {
                let file = std::fs::File::create(next()?).map_err(|e| e.to_string())?;
                options.to = To::Log(std::io::BufWriter::new(file));
                options.seconds = options.seconds.min(10.0);
            }
            other => {
                return Err(format!(
                    "{other:?} is there; --steer, --script, --seconds, --wait, --rate, --osc and --offline are known"
                ));
            }
        }
    }
    Ok(options)
}

fn number(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|x| *x > 0.0);
    number.ok_or(format!("{text:?} is there; a number above 0 is needed"))
}

/// Rounds to a millionth, the digits that single precision holds.
fn short(x: f32) -> f64 {
    (f64::from(x) * 1e6).round() / 1e6
}

/// One contact as foley's JSON has it.
fn as_json(contact: &Contact, step: f64, time: Option<f64>) -> Value {
    if contact.ends {
        return json!({ "id": contact.id, "ends": true });
    }
    let mut value = json!({
        "id": contact.id, "a": contact.bodies[0], "b": contact.bodies[1],
        "point": contact.point.map(short), "normal": contact.normal.map(short), "impulse": short(contact.impulse),
        "velocity": contact.velocity.map(short), "approach": short(contact.approach), "mass": short(contact.mass),
        "travel_a": contact.travel.map(short), "step": short(step as f32),
    });
    if let Some(time) = time {
        // `foley live` reads the log by its channel, `ContactLog` without.
        value["contact"] = json!("ball");
        value["time_s"] = json!((time * 1e6).round() / 1e6);
    }
    value
}

/// One contact as foley's OSC has it.
fn as_osc(contact: &Contact, step: f64) -> rosc::OscPacket {
    let mut args = vec![rosc::OscType::Int(contact.id)];
    if !contact.ends {
        args.extend(contact.bodies.map(rosc::OscType::Int));
        let force = [contact.impulse / step as f32];
        let known = [contact.approach, contact.mass];
        let rest: [&[f32]; 7] = [
            &contact.point,
            &contact.normal,
            &force,
            &contact.velocity,
            &known,
            &contact.travel,
            &[step as f32],
        ];
        args.extend(rest.concat().into_iter().map(rosc::OscType::Float));
    }
    rosc::OscPacket::Message(rosc::OscMessage { addr: "/foley/contact/ball".into(), args })
}

fn send(to: &mut To, contacts: &[Contact], step: f64, time: f64) -> Result<(), Box<dyn std::error::Error>> {
    match to {
        To::Lines => {
            let list: Vec<Value> = contacts.iter().map(|c| as_json(c, step, None)).collect();
            let mut out = std::io::stdout().lock();
            writeln!(out, "{}", json!({ "contact": "ball", "contacts": list }))?;
            out.flush()?;
        }
        To::Osc(socket, address) => {
            // A time of 1 in the fraction alone means at once.
            let timetag = rosc::OscTime { seconds: 0, fractional: 1 };
            let content = contacts.iter().map(|c| as_osc(c, step)).collect();
            let bundle = rosc::OscPacket::Bundle(rosc::OscBundle { timetag, content });
            let bytes = rosc::encoder::encode(&bundle).map_err(|e| format!("{e:?}"))?;
            socket.send_to(&bytes, address.as_str())?;
        }
        To::Log(file) => {
            for contact in contacts.iter().filter(|c| !c.ends) {
                writeln!(file, "{}", as_json(contact, step, Some(time)))?;
            }
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Options { seconds, wait, rate, mut to, mut keys } = options()?;
    let step = 1.0 / rate;
    let roller = if matches!(keys, Keys::None) { Roller::Ball } else { Roller::Capsule };
    let mut scene = Scene::new(step as f32, roller);
    if !matches!(to, To::Log(_)) {
        std::thread::sleep(Duration::from_secs_f64(wait));
    }
    let start = Instant::now();
    for frame in 1_u64.. {
        let time = frame as f64 * step;
        if time > seconds {
            break;
        }
        for key in keys.pressed(time) {
            if key == 'q' {
                return Ok(());
            }
            scene.press(key);
        }
        let contacts = scene.step();
        if !matches!(to, To::Log(_)) {
            let due = Duration::from_secs_f64(time);
            std::thread::sleep(due.saturating_sub(start.elapsed()));
        }
        if !contacts.is_empty() {
            match send(&mut to, &contacts, step, time) {
                // Whoever listened has stopped.
                Err(e) if e.to_string().contains("Broken pipe") => break,
                other => other?,
            }
        }
    }
    Ok(())
}
