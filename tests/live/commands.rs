//! `foley live` as a user runs it: a file as the device, impacts on standard input and over OSC, and what is refused.

use foley_nodes::io::AudioReader;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

fn graph(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs").join(name)
}

fn foley(args: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_foley"));
    command.args(args).current_dir(folder).env("NO_COLOR", "1").stdin(Stdio::null());
    command
}

/// Plays a graph for three seconds into `played.wav`, with a report in `r.json`: the process, its lines, and its port for OSC.
fn play_three_seconds(text: &str, folder: &Path) -> (Child, ChildStdin, u16) {
    std::fs::write(folder.join("main.ron"), text).unwrap();
    // A port that is free now; another process may take it before foley does, but hardly ever.
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let args =
        ["live", "main.ron", "--device", "file:played.wav", "--for", "3", "--report", "r.json", "--osc"];
    let mut command = foley(&args, folder);
    let mut child =
        command.arg(port.to_string()).stdin(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    let lines = child.stdin.take().unwrap();
    std::thread::sleep(Duration::from_millis(700));
    (child, lines, port)
}

fn samples(path: &Path) -> (Vec<f32>, u32) {
    let mut reader = AudioReader::open(Box::new(BufReader::new(File::open(path).unwrap()))).unwrap();
    let info = reader.info().clone();
    let mut samples = vec![0.0; info.frames as usize * info.channels];
    reader.read(&mut samples).unwrap();
    (samples, info.rate)
}

#[test]
fn impacts_from_lines_and_from_osc_are_heard_in_the_file_that_was_played() {
    let folder = tempfile::tempdir().unwrap();
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"hits\": LiveImpacts(channel: \"hits\"),
        \"force\": ImpactForce(impacts: \"hits\", rate: 44100),
        \"out\": WavOut(audio: \"force\", path: \"o.wav\") })";
    let (mut child, mut lines, port) = play_three_seconds(text, folder.path());
    lines.write_all(b"{\"impact\": \"hits\", \"velocity\": 2.0}\nwrong\n").unwrap();
    lines.flush().unwrap();
    std::thread::sleep(Duration::from_millis(600));
    let message =
        rosc::OscMessage { addr: "/foley/impact/hits".into(), args: vec![rosc::OscType::Float(0.5)] };
    let packet = rosc::encoder::encode(&rosc::OscPacket::Message(message)).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.send_to(&packet, ("127.0.0.1", port)).unwrap();
    // Other programs read the levels beside the graph while it plays.
    let main = folder.path().join("main.ron");
    let levels = (0..120).find_map(|_| {
        std::thread::sleep(Duration::from_millis(25));
        foley::live::Levels::beside(&main)
    });
    assert!(levels.is_some_and(|levels| levels.played > 0.5));
    assert!(child.wait().unwrap().success());
    assert_eq!(foley::live::Levels::beside(&main), None);
    let (heard, rate) = samples(&folder.path().join("played.wav"));
    assert!((heard.len() as f64 / f64::from(rate) - 3.0).abs() < 1.0, "{} samples", heard.len());
    let mut impacts = 0;
    let mut quiet = 1000;
    for x in &heard {
        if *x > 0.0 && quiet >= 1000 {
            impacts += 1;
        }
        quiet = if *x == 0.0 { quiet + 1 } else { 0 };
    }
    assert_eq!(impacts, 2);
    let report = std::fs::read_to_string(folder.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let messages = &report["messages"];
    assert_eq!((&messages["delivered"], &messages["malformed"]), (&2.into(), &1.into()));
    assert_eq!(report["quantum"], 128);
}

#[test]
fn contacts_from_lines_and_from_osc_strike_and_end_when_their_sender_stalls() {
    let folder = tempfile::tempdir().unwrap();
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"sent\": LiveContacts(channel: \"ball\"),
        \"contacts\": ContactClassifier(contacts: \"sent\", struck: B),
        \"force\": ImpactForce(impacts: \"contacts.impacts\", rate: 44100),
        \"out\": WavOut(audio: \"force\", path: \"o.wav\") })";
    let (mut child, mut lines, port) = play_three_seconds(text, folder.path());
    // Two bodies land in one frame.
    let body = |id: u32| {
        format!(
            "{{\"id\": {id}, \"a\": 0, \"b\": {id}, \"point\": [0,0,0], \"normal\": [0,0,1], \"force\": 60, \
             \"velocity\": [0,0,0.5], \"approach\": 1, \"mass\": 0.5, \"step\": 0.0166}}"
        )
    };
    let line = format!("{{\"contact\": \"ball\", \"contacts\": [{}, {}]}}\nwrong\n", body(1), body(2));
    lines.write_all(line.as_bytes()).unwrap();
    lines.flush().unwrap();
    // They are silent from now on, so they have ended: a later message of the first begins another contact, and strikes again.
    std::thread::sleep(Duration::from_millis(600));
    let mut args = vec![1, 0, 1].into_iter().map(rosc::OscType::Int).collect::<Vec<_>>();
    let numbers = [0.0_f32, 0.0, 0.0, 0.0, 0.0, 1.0, 60.0, 0.0, 0.0, 0.5, 1.0];
    args.extend(numbers.map(rosc::OscType::Float));
    let message = rosc::OscMessage { addr: "/foley/contact/ball".into(), args };
    let packet = rosc::encoder::encode(&rosc::OscPacket::Message(message)).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.send_to(&packet, ("127.0.0.1", port)).unwrap();
    assert!(child.wait().unwrap().success());
    let (heard, _) = samples(&folder.path().join("played.wav"));
    let mut impacts: Vec<f32> = Vec::new();
    let mut quiet = 1000;
    for x in &heard {
        if *x > 0.0 && quiet >= 1000 {
            impacts.push(0.0);
        }
        quiet = if *x == 0.0 { quiet + 1 } else { 0 };
        if let Some(peak) = impacts.last_mut() {
            *peak = peak.max(*x);
        }
    }
    assert_eq!(impacts.len(), 2, "two at once, and one later: {impacts:?}");
    assert!((impacts[0] / impacts[1] - 2.0).abs() < 0.1, "{impacts:?}");
    let report = std::fs::read_to_string(folder.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let messages = &report["messages"];
    assert_eq!((&messages["delivered"], &messages["malformed"]), (&3.into(), &1.into()));
}

/// Output of `graphs/texture/live.ron` for the demo's log, without impacts: contact by contact, at their own times.
fn rolled(osc: bool) -> Vec<f32> {
    let folder = tempfile::tempdir().unwrap();
    let path = graph("texture/live.ron");
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port().to_string();
    let args =
        ["live", path.to_str().unwrap(), "--device", "file:played.wav", "--for", "6", "--report", "r.json"];
    let quick = ["profile.extend=false", "alike.extend=false", "equal.by_speed=false"];
    // Nothing but what scrapes.
    let scrapes = ["bell.gain=0.0", "on_floor.object=99", "on_ball.object=99"];
    let numbers = quick.iter().chain(&scrapes).flat_map(|number| ["--set", number]);
    let mut command = foley(&args, folder.path());
    command.args(numbers).args(["--no-cache", "--osc", if osc { &port } else { "off" }]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = child.stdin.take().unwrap();
    let mut reported = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    while !line.starts_with("playing") {
        line.clear();
        assert!(reported.read_line(&mut line).unwrap() > 0, "it never plays");
    }
    let text = std::fs::read_to_string(graph("assets/contacts/rolling_ball.jsonl")).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let start = std::time::Instant::now();
    let mut count = 0;
    for line in text.lines() {
        let mut row: serde_json::Map<String, serde_json::Value> = serde_json::from_str(line).unwrap();
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let time = number(&row.remove("time_s").unwrap());
        // From shortly before it rolls on.
        if time < 1.0 {
            continue;
        }
        std::thread::sleep(Duration::from_secs_f64(time - 1.0).saturating_sub(start.elapsed()));
        count += 1;
        if osc {
            let list = |key: &str| row[key].as_array().unwrap().iter().map(number).collect::<Vec<_>>();
            let step = number(&row["step"]);
            let rest = [
                list("point"),
                list("normal"),
                vec![number(&row["impulse"]) / step],
                list("velocity"),
                vec![number(&row["approach"]), number(&row["mass"])],
                list("travel_a"),
                vec![step],
            ];
            let ids = ["id", "a", "b"].map(|key| rosc::OscType::Int(row[key].as_i64().unwrap() as i32));
            let rest = rest.concat().into_iter().map(|x| rosc::OscType::Float(x as f32));
            let args = ids.into_iter().chain(rest).collect();
            let message = rosc::OscMessage { addr: "/foley/contact/ball".into(), args };
            let packet = rosc::encoder::encode(&rosc::OscPacket::Message(message)).unwrap();
            socket.send_to(&packet, format!("127.0.0.1:{port}")).unwrap();
        } else {
            row.insert("contact".into(), "ball".into());
            writeln!(lines, "{}", serde_json::Value::Object(row)).unwrap();
            lines.flush().unwrap();
        }
    }
    reported.read_to_string(&mut line).unwrap();
    assert!(child.wait().unwrap().success());
    let report = std::fs::read_to_string(folder.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["messages"]["malformed"], 0, "{report}");
    let delivered = report["messages"]["delivered"].as_u64().unwrap();
    // Some come after the end where the machine is slow.
    assert!(delivered > 100 && delivered <= count, "{delivered} of {count}");
    let (heard, _) = samples(&folder.path().join("played.wav"));
    heard
}

#[test]
fn contacts_from_lines_and_from_osc_scrape_a_playing_surface() {
    for osc in [false, true] {
        let heard = rolled(osc);
        let first = heard.iter().position(|x| x.abs() > 1e-4);
        // Scraping lasts: of the second after the first sound most hundredths are louder than silence.
        let first = first.unwrap_or_else(|| panic!("nothing is heard, osc: {osc}"));
        let after = &heard[first..(first + 44_100).min(heard.len())];
        let level = |part: &[f32]| part.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        let loud = after.chunks(441).filter(|part| level(part) > 1e-4).count();
        assert!(loud > 50, "osc: {osc}: {loud} of 100 hundredths of a second sound");
    }
}

#[test]
fn the_log_that_ships_plays_at_its_times_as_standard_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = graph("texture/live.ron");
    let args =
        ["live", path.to_str().unwrap(), "--device", "file:played.wav", "--for", "6", "--report", "r.json"];
    let quick = ["profile.extend=false", "alike.extend=false", "equal.by_speed=false", "bell.gain=0.0"];
    let mut command = foley(&args, folder.path());
    command.args(quick.iter().flat_map(|number| ["--set", number])).args([
        "--no-cache",
        "--osc",
        "off",
        "--json",
    ]);
    let log = graph("assets/contacts/rolling_ball.jsonl");
    let lines = std::fs::read_to_string(&log).unwrap().lines().count() as u64;
    let ran = command.stdin(File::open(log).unwrap()).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    assert!(ran.stderr.is_empty(), "{}", String::from_utf8_lossy(&ran.stderr));
    let report = std::fs::read_to_string(folder.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let messages = &report["messages"];
    let counts = ["delivered", "malformed", "unclaimed"].map(|key| messages[key].as_u64());
    assert_eq!(counts, [Some(lines), Some(0), Some(0)]);
    // The meter of the force on the floor has 30 readings a second, some of them of impacts.
    let output = String::from_utf8_lossy(&ran.stdout).into_owned();
    let peaks: Vec<f64> = output
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .flat_map(|status| status["meters"][0]["peak"].as_array().cloned().unwrap_or_default())
        .filter_map(|peak| peak.as_f64())
        .collect();
    assert!(peaks.len() > 60 && peaks.iter().any(|peak| *peak > 100.0), "{peaks:?}");
    // The first three impacts of the log are at 0.342, 0.708 and 0.9 s.
    let (heard, rate) = samples(&folder.path().join("played.wav"));
    let first = heard.iter().position(|x| x.abs() > 1e-3).unwrap();
    let level = |from: f64, to: f64| {
        let part = [from, to].map(|s| first + (s * f64::from(rate)) as usize);
        heard[part[0]..part[1]].iter().fold(0.0_f32, |most, x| most.max(x.abs()))
    };
    for later in [0.708 - 0.342, 0.9 - 0.342] {
        let [before, after] = [level(later - 0.03, later - 0.012), level(later - 0.012, later + 0.03)];
        assert!(after > 2.0 * before, "{later} s after the first impact: {before} to {after}");
    }
}

#[test]
fn meshes_are_taken_at_their_port_and_a_wrong_one_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: {
        \"sheet\": LiveMesh(channel: \"sheet\", path: \"a.obj\", rate: 100),
        \"age\": Resample(audio: \"sheet.age\", rate: 8000),
        \"out\": WavOut(audio: \"age\", path: \"o.wav\") })";
    std::fs::write(folder.path().join("main.ron"), text).unwrap();
    let args = ["live", "main.ron", "--device", "null", "--for", "2", "--report", "r.json", "--osc", "off"];
    let mut command = foley(&args, folder.path());
    command.args(["--meshes", "127.0.0.1:0"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut reported = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    reported.read_line(&mut line).unwrap();
    let at = line.split("meshes at ").nth(1).unwrap_or_else(|| panic!("{line}")).trim().to_owned();
    let head = |vertices: u32| {
        let mut bytes = [&b"foleymsh"[..], &1_u32.to_le_bytes(), &5_u32.to_le_bytes(), b"sheet"].concat();
        bytes.extend(vertices.to_le_bytes());
        bytes
    };
    let mut good = TcpStream::connect(&at).unwrap();
    good.write_all(&[head(3), vec![0; 8 + 36]].concat()).unwrap();
    TcpStream::connect(&at).unwrap().write_all(&head(4)).unwrap();
    let run = child.wait_with_output().unwrap();
    assert!(run.status.success());
    let reported = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(reported.contains("it has 4 vertices; the LiveMesh of \"sheet\" has 3"), "{reported}");
    let report = std::fs::read_to_string(folder.path().join("r.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let messages = &report["messages"];
    assert_eq!((&messages["delivered"], &messages["malformed"]), (&1.into(), &1.into()), "{messages}");
}

#[test]
fn the_examples_that_play_play_without_a_gap() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["impact/live.ron", "texture/live.ron", "cloth/friction_live.ron", "cloth/live.ron"] {
        let path = graph(name);
        let args =
            ["live", path.to_str().unwrap(), "--device", "null", "--osc", "off", "--for", "2", "--no-cache"];
        let run = foley(&args, folder.path()).args(["--report", "r.json"]).output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let report = std::fs::read_to_string(folder.path().join("r.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        assert!(report["played_s"].as_f64().unwrap() > 0.5, "{report}");
        assert_eq!(report["not_finite"], 0, "{name}");
    }
}

#[test]
fn what_cannot_play_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str, more: &[&str], code: &str| {
        let nodes = format!("#![schema = \"foley:graph/1\"]\nGraph(nodes: {{ {text} }})");
        std::fs::write(folder.path().join("main.ron"), nodes).unwrap();
        let args = [&["live", "main.ron", "--osc", "off", "--for", "0.2"], more].concat();
        let run = foley(&args, folder.path()).output().unwrap();
        let reported = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(!run.status.success() && reported.contains(code), "{code}: {reported}");
    };
    let tone = "\"a\": Tone(frequency: 100.0, rate: 48000), \"o\": WavOut(audio: \"a\", path: \"o.wav\")";
    refused("\"a\": Tone(frequency: 100.0, rate: 48000)", &["--device", "null"], "F052");
    refused(tone, &["--device", "null", "--rate", "44100"], "F045");
    refused(tone, &["--device", "file:main.ron/x.wav"], "F054");
    let two = format!(
        "{tone}, \"b\": Tone(frequency: 100.0, rate: 44100), \"p\": WavOut(audio: \"b\", path: \"p.wav\")"
    );
    refused(&two, &["--device", "null"], "F045");
}

#[test]
fn the_levels_of_all_nodes_are_in_the_file_beside_a_graph_that_plays() {
    let folder = tempfile::tempdir().unwrap();
    let text = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"tone\": Tone(level: 0.5),
    \"soft\": Gain(audio: \"tone\", db: -14.0),
    \"off\": Gain(audio: \"tone\", gain: 0.0),
    \"both\": Mix(inputs: [\"soft\", \"off\"]),
    \"out\": WavOut(audio: \"both\", path: \"a.wav\"),
})";
    let graph = folder.path().join("a.ron");
    std::fs::write(&graph, text).unwrap();
    let args = ["live", "a.ron", "--device", "null", "--for", "30", "--osc", "off"];
    let mut child = foley(&args, folder.path()).stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    let start = std::time::Instant::now();
    let levels = loop {
        let levels = foley::live::Levels::beside(&graph).filter(|levels| !levels.nodes.is_empty());
        if levels.is_some() || start.elapsed() > Duration::from_secs(25) {
            break levels;
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    child.kill().unwrap();
    child.wait().unwrap();
    let nodes = levels.expect("there are levels").nodes;
    let is = |id: &str, db: f64| (nodes[id].unwrap() - db).abs() < 0.1;
    assert!(is("tone", -6.02) && is("soft", -20.02) && is("both", -20.02), "{nodes:?}");
    assert_eq!(nodes["off"], None);
}
