//! Reports of messages without a receiver, of sound beyond full scale, and of silence.

use rosc::{OscMessage, OscPacket, OscType, encoder::encode};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::UdpSocket;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const GRAPH: &str = "#![schema = \"foley:graph/1\"]
Graph(params: { \"object\": None }, nodes: {
    \"hits\": LiveImpacts(channel: \"hits\"),
    \"force\": ImpactForce(impacts: \"hits\", object: \"$object\", tau: 0.01, rate: 8000),
    \"level\": LiveControl(channel: \"level\", rate: 8000, initial: [0.0]),
    \"both\": Mix(inputs: [\"force\", \"level\"]),
    \"loud\": Gain(audio: \"both\", gain: 1.0),
    \"out\": WavOut(audio: \"loud\", path: \"o.wav\"),
})
";

/// Standard output and standard error of a session, and its report.
struct Outcome {
    out: String,
    err: String,
    report: serde_json::Value,
}

/// Plays the graph while `act` gets the socket of a sender and standard input.
fn play(arguments: &[&str], act: impl FnOnce(&dyn Fn(&[u8]), &mut dyn Write)) -> Outcome {
    play_text(GRAPH, arguments, act)
}

/// As [`play`], for another graph; `later.csv` has impacts on object 0, and one on object 1 after 3 s.
fn play_text(graph: &str, arguments: &[&str], act: impl FnOnce(&dyn Fn(&[u8]), &mut dyn Write)) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("main.ron"), graph).unwrap();
    let impacts = "time_s,velocity,mass,object\n0.1,1,0.1,0\n0.5,1,0.1,0\n1.5,1,0.1,0\n3,1,0.1,1\n";
    fs::write(folder.path().join("later.csv"), impacts).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.args(["live", "main.ron", "--no-cache", "--osc", "0", "--device", "null", "--report", "r.json"]);
    command.args(arguments).current_dir(folder.path()).env("NO_COLOR", "1");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut reader = BufReader::new(child.stdout.take().unwrap());
    let mut out = String::new();
    while !out.contains("Ctrl-C") {
        assert!(reader.read_line(&mut out).unwrap() > 0, "it never plays");
    }
    let address = out.split("OSC at ").nth(1).unwrap().split([';', '\n']).next().unwrap().trim().to_owned();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut lines = child.stdin.take().unwrap();
    let send = |packet: &[u8]| assert!(socket.send_to(packet, &address).is_ok());
    act(&send, &mut lines);
    drop(lines);
    reader.read_to_string(&mut out).unwrap();
    let run = child.wait_with_output().unwrap();
    let err = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{err}");
    let report = fs::read_to_string(folder.path().join("r.json")).unwrap();
    Outcome { out, err, report: serde_json::from_str(&report).unwrap() }
}

fn osc(address: &str, args: Vec<OscType>) -> Vec<u8> {
    encode(&OscPacket::Message(OscMessage { addr: address.into(), args })).unwrap()
}

#[test]
fn messages_that_reach_nothing_are_named_once_and_counted() {
    let float = |x: f32| vec![OscType::Float(x)];
    let text = |x: &str| vec![OscType::String(x.into())];
    let outcome = play(&["--for", "1.5"], |send, lines| {
        for _ in 0..3 {
            send(b"garbage");
            send(&osc("/fooley/hits", float(1.0)));
            send(&osc("/foley/impact/hits", Vec::new()));
            send(&osc("/foley/impact/hits", text("hard")));
            send(&osc("/foley/impact/hitz", float(0.5)));
            send(&osc("/foley/trigger/hits", float(0.5)));
            send(&osc("/foley/control/level", vec![OscType::Float(0.0), OscType::Float(1.0)]));
            writeln!(lines, "{{\"control\": \"nobody\", \"values\": [1]}}").unwrap();
        }
        lines.flush().unwrap();
    });
    for part in [
        "OSC: a packet is no OSC message: it begins with \"garbage\"",
        "OSC: \"/fooley/hits\": there is no such address; addresses are /foley/KIND/CHANNEL",
        "OSC: \"/foley/impact/hits\": no argument; needed: an energy in J",
        "OSC: \"/foley/impact/hits\": argument 1 is \"hard\"; a number is needed",
        "impact for \"hitz\": no node reads this channel; did you mean \"hits\"? the graph has \"hits\" (impact), \"level\" (control)",
        "trigger for \"hits\": the node of this channel reads the kind `impact`",
        "control for \"level\": its node reads 1 of the 2 numbers",
        "control for \"nobody\": no node reads this channel",
    ] {
        assert_eq!(outcome.err.matches(part).count(), 1, "{part}: {}", outcome.err);
    }
    let line = "messages: 3 delivered; 12 malformed, 6 for no node, 3 of the wrong kind";
    assert!(outcome.out.contains(line), "{}", outcome.out);
    assert!(outcome.out.contains("the sound was silent"), "{}", outcome.out);
    let counts = &outcome.report["messages"];
    let found = ["delivered", "malformed", "unclaimed", "wrong_kind", "not_set"]
        .map(|key| counts[key].as_u64().unwrap());
    assert_eq!(found, [3, 12, 6, 3, 0]);
}

#[test]
fn a_parameter_that_cannot_be_set_is_counted() {
    let outcome = play(&["--for", "1"], |_, lines| {
        writeln!(lines, "{{\"set\": \"loud.gein\", \"value\": 1}}").unwrap();
        lines.flush().unwrap();
    });
    assert!(outcome.err.contains("gein"), "{}", outcome.err);
    assert_eq!(outcome.report["messages"]["not_set"], 1);
}

#[test]
fn a_sound_beyond_full_scale_is_reported_with_a_gain_that_would_do() {
    let outcome = play(&["--for", "1"], |_, lines| {
        writeln!(lines, "{{\"control\": \"level\", \"values\": [10]}}").unwrap();
        lines.flush().unwrap();
    });
    assert_eq!(
        outcome.err.matches("the sound exceeds full scale: its peak is 20.0 dB").count(),
        1,
        "{}",
        outcome.err
    );
    let advice = "beyond full scale: its peak is 20.0 dB above full scale: set `db: -21.0` on `loud` (now 0)";
    assert!(outcome.out.contains(advice), "{}", outcome.out);
    assert!((outcome.report["peak"].as_f64().unwrap() - 10.0).abs() < 1e-3);
    assert!(outcome.report["beyond_full_scale"].as_u64().unwrap() > 1000);
}

#[test]
fn a_second_of_silence_with_impacts_of_another_object_is_explained_once() {
    let outcome = play(&["--for", "4", "--set", "object=77"], |_, lines| {
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(3) {
            writeln!(lines, "{{\"impact\": \"hits\", \"velocity\": 1, \"mass\": 0.1, \"object\": 1}}")
                .unwrap();
            lines.flush().unwrap();
            std::thread::sleep(Duration::from_millis(50));
        }
    });
    let note = "note: force: silent: no impact has object 77; there are 1";
    assert_eq!(outcome.err.matches(note).count(), 1, "{}", outcome.err);
    assert_eq!(outcome.err.matches("note:").count(), 1, "{}", outcome.err);
    assert_eq!(outcome.report["notes"][0]["node"], "force");
}

#[test]
fn what_files_hold_for_later_needs_no_explanation() {
    let graph = GRAPH.replace("LiveImpacts(channel: \"hits\")", "ImpactFile(path: \"later.csv\")");
    let outcome = play_text(&graph, &["--for", "2.5", "--set", "object=1"], |_, _| {});
    assert!(!outcome.err.contains("note:"), "{}", outcome.err);
}

#[test]
fn silence_without_messages_and_sound_need_no_explanation() {
    let outcome = play(&["--for", "2.5"], |_, _| {});
    assert!(!outcome.err.contains("note:"), "{}", outcome.err);
    let outcome = play(&["--for", "2.5"], |_, lines| {
        writeln!(lines, "{{\"control\": \"level\", \"values\": [0.25]}}").unwrap();
        lines.flush().unwrap();
    });
    assert!(!outcome.err.contains("note:"), "{}", outcome.err);
    assert!(outcome.out.contains("peak -12.0 dB of full scale"), "{}", outcome.out);
}
