//! The session: a graph from a program, to files, to memory, as typed arrays, live, with all diagnostics as values.

use foley::live::{Options, Reloaded};
use foley::nodes::core::input::NoInputs;
use foley::nodes::core::item::Channels;
use foley::nodes::core::time::Rate;
use foley::nodes::io::AudioReader;
use foley::run::{EventTap, StreamTap, ValueTap};
use foley::{Registry, Session};
use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::Ordering;

const WIND: &str = r#"#![schema = "foley:graph/1"]
Graph(seed: 3, params: { "gain": 0.5 }, nodes: {
    "wind": Noise(duration: Some(0.2), rate: 8000),
    "soft": Gain(audio: "wind", gain: "$gain"),
    "out": WavOut(audio: "soft", path: "wind.wav", format: Float32),
})"#;

fn samples(bytes: Vec<u8>) -> Vec<f32> {
    let mut reader = AudioReader::open(Box::new(Cursor::new(bytes))).unwrap();
    let mut samples = vec![0.0; reader.info().frames as usize * reader.info().channels];
    reader.read(&mut samples).unwrap();
    samples
}

#[test]
fn files_memory_and_taps_hold_the_same_sound() {
    let mut session = Session::from_text(WIND, ".").with_threads(Some(2));
    let tap = Arc::new(StreamTap::<f32>::new());
    session.tap("soft", &tap);
    let folder = tempfile::tempdir().unwrap();
    let report = session.render(folder.path()).unwrap();
    assert_eq!(report.outputs.len(), 1);
    let tapped = tap.take().unwrap();
    assert_eq!((tapped.rate, tapped.format, tapped.data.len()), (Rate::hz(8000), Channels(1), 1600));
    assert_eq!(samples(std::fs::read(folder.path().join("wind.wav")).unwrap()), tapped.data);
    let (_, files) = session.render_to_memory().unwrap();
    assert_eq!(files.paths(), ["wind.wav"]);
    assert_eq!(samples(files.get("wind.wav").unwrap()), tapped.data);
    assert_eq!(tap.take().unwrap(), tapped, "each run collects again");
    session.set("gain", "0.25");
    session.set("gain", "1.0");
    session.render_to_memory().unwrap();
    let louder = tap.take().unwrap().data;
    assert!(
        louder.iter().zip(&tapped.data).all(|(a, b)| (a - 2.0 * b).abs() < 1e-6),
        "the last value counts"
    );
    session.unset("gain");
    session.render_to_memory().unwrap();
    assert_eq!(tap.take().unwrap(), tapped);
}

#[test]
fn values_and_events_are_tapped_as_they_are() {
    let text = r#"#![schema = "foley:graph/1"]
Graph(nodes: {
    "wind": Noise(duration: Some(1.0), rate: 8000),
    "loud": Loudness(audio: "wind"),
    "bar": Metronome(interval: 0.25, duration: Some(1.0)),
})"#;
    let mut session = Session::from_text(text, ".");
    let (value, events) = (
        Arc::new(ValueTap::<foley::nodes::dsp::Level>::new()),
        Arc::new(EventTap::<foley::nodes::dsp::Trigger>::new()),
    );
    session.tap("loud", &value);
    session.tap("bar", &events);
    session.render_to_memory().unwrap();
    let level = value.take().unwrap();
    assert!(level.rms > 0.1 && f64::from(level.peak) > level.rms, "{level:?}");
    assert_eq!(events.take().unwrap().len(), 4);
    let mut wrong = Session::from_text(text, ".");
    wrong.tap("loud", &Arc::new(StreamTap::<f32>::new()));
    wrong.tap("nobody", &value);
    let errors = wrong.render_to_memory().unwrap_err();
    let codes: Vec<_> = errors.diagnostics.iter().map(|d| d.code).collect();
    assert_eq!(codes, ["F083", "F083"]);
    assert!(
        errors.to_string().contains("`loud` is a fold of level; this tap takes a stream of audio"),
        "{errors}"
    );
}

#[test]
fn all_mistakes_come_back_as_values() {
    let text = WIND.replace("Noise(", "Nois(").replace("Float32", "Float33");
    let found = Session::from_text(&text, ".").check();
    let codes: Vec<_> = found.diagnostics.iter().map(|d| d.code).collect();
    assert!(found.any_error() && codes.len() >= 2, "{codes:?}");
    let error: Box<dyn std::error::Error> =
        Box::new(Session::from_text(&text, ".").render_to_memory().unwrap_err());
    assert!(error.to_string().contains("did you mean `Noise`?"), "{error}");
    let none = Session::from_text(WIND, ".").with_registry(Arc::new(Registry::empty())).check();
    assert_eq!(none.diagnostics.iter().filter(|d| d.code == "F010").count(), 3);
}

#[test]
fn a_run_is_cancelled_from_another_thread() {
    let text = WIND.replace("Some(0.2)", "Some(20000.0)");
    let session = Session::from_text(text, ".");
    let progress = Arc::clone(session.progress());
    let run = std::thread::spawn(move || session.render_to_memory().map(drop));
    while progress.done.load(Ordering::Relaxed) == 0 && !run.is_finished() {
        std::thread::yield_now();
    }
    progress.stop.store(true, Ordering::SeqCst);
    let errors = run.join().unwrap().unwrap_err();
    assert_eq!(errors.diagnostics[0].code, "F091", "{errors}");
}

#[test]
fn an_analysis_that_takes_long_reports_its_progress_and_is_cancelled() {
    // Some hundreds of modes of a disc of a thousand elements: it would take minutes.
    let text = r#"Graph(nodes: {
    "mesh": RevolvedMesh(profile: [[0.0, 0.0], [0.3, 0.0]], thickness: [0.002], around: 60, along: 20),
    "model": ModalAnalysis(mesh: "mesh", young: 200e9, poisson: 0.3, density: 7850, highest: 20000),
    "steel": MaterialFile(path: "graphs/lib/materials/steel_wrench.material.ron"),
    "modes": ModelModes(model: "model", material: "steel", points: [[0.1, 0.0, 0.0]]),
    "force": Tone(frequency: 5.0, rate: 8000, duration: Some(0.1)),
    "bank": ModalBank(forces: ["force"], modes: "modes.modes"),
    "out": WavOut(audio: "bank", path: "disc.wav"),
})"#;
    let session = Session::from_text(text, ".");
    let progress = Arc::clone(session.progress());
    let run = std::thread::spawn(move || session.render_to_memory().map(drop));
    while progress.value_text().is_none() && !run.is_finished() {
        std::thread::yield_now();
    }
    let text = progress.value_text();
    progress.stop.store(true, Ordering::SeqCst);
    let errors = run.join().unwrap().unwrap_err();
    assert!(text.is_some_and(|text| text.starts_with("model: ") && text.ends_with(" %")));
    assert_eq!(errors.diagnostics[0].code, "F091", "{errors}");
}

#[test]
fn a_host_plays_with_its_own_callback_and_loads_edits() {
    let text = WIND.replace("duration: Some(0.2), ", "");
    let mut session = Session::from_text(text, ".");
    let options = Options { threads: 0, quantum: 64, ..Options::default() };
    let (mut player, mut callback) = session.play(Arc::new(NoInputs), options).unwrap();
    let mut block = [0.0; 256];
    let mut level = |player: &mut foley::live::Player, blocks: usize| {
        let mut peak = 0.0_f32;
        for _ in 0..blocks {
            player.pump();
            callback.fill(&mut block);
            player.tick();
            peak = block.iter().fold(0.0, |m, x| m.max(x.abs()));
        }
        peak
    };
    let before = level(&mut player, 20);
    assert!(before > 0.1);
    session.set("gain", "0.0");
    let edit = player.load(session.live_graph(Arc::new(NoInputs)).unwrap()).unwrap();
    assert!(matches!(edit, Reloaded::Edit(_)));
    assert!(level(&mut player, 100) < 1e-6);
    let wrong = Session::from_text("Graph(", ".").live_graph(Arc::new(NoInputs)).map(drop);
    assert_eq!(wrong.unwrap_err().diagnostics.iter().filter(|d| d.code == "F001").count(), 1);
}
