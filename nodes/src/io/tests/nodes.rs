use crate::core::item::Channels;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, ticks};
use crate::io::nodes::{WavInNode, WavInParams, WavInPorts, WavOutNode, WavOutParams, WavOutPorts};
use crate::io::{WriteFormat, probe};

fn out(format: WriteFormat, channels: u16, audio: Vec<f32>) -> Standalone {
    let params = WavOutParams { path: "a/b.wav".into(), format, dither: true };
    Standalone::new::<WavOutNode>(params).input(WavOutPorts::audio, Rate::hz(8000), Channels(channels), audio)
}

fn play(bytes: &[u8], start: f64, duration: Option<f64>) -> Standalone {
    let params = WavInParams { path: "in".into(), start, duration };
    let mut standalone = Standalone::new::<WavInNode>(params).window(ticks(0.013));
    standalone.files.insert("in", bytes);
    standalone
}

#[test]
fn a_written_file_is_read_back_with_an_exact_range() {
    let audio: Vec<f32> = (0..3000).map(|k| (k as f32 * 0.37).sin()).collect();
    let standalone = out(WriteFormat::Float32, 2, audio.clone());
    standalone.run().unwrap();
    let bytes = standalone.outputs.get("a/b.wav").unwrap();
    assert_eq!(play(&bytes, 0.0, None).run().unwrap().stream(WavInPorts::audio), audio);
    let piece = play(&bytes, 0.01, Some(0.02)).run().unwrap().stream(WavInPorts::audio);
    assert_eq!(piece, audio[160..480]);
}

#[test]
fn the_report_has_peak_rms_and_clipping() {
    let run = out(WriteFormat::Pcm16, 1, vec![0.5, -2.0, 0.5, 0.5]).run().unwrap();
    let entry = |key| run.summary.iter().find(|(k, _)| *k == key).map(|(_, v)| v.clone()).unwrap();
    assert_eq!(entry("path"), "a/b.wav");
    assert_eq!((entry("frames"), entry("channels"), entry("rate")), (4.into(), 1.into(), 8000.into()));
    assert_eq!((entry("peak"), entry("clipped")), (2.0.into(), 1.into()));
    assert!((entry("rms").as_f64().unwrap() - (4.75_f64 / 4.0).sqrt()).abs() < 1e-12);
}

#[test]
fn other_formats_play_as_decoded() {
    for bytes in [super::FLAC, super::OGG, super::MP3] {
        let run = play(bytes, 0.0, None).run().unwrap();
        let (info, samples) = super::read_all(bytes, 1000).unwrap();
        assert_eq!(run.stream(WavInPorts::audio), samples);
        assert_eq!(info, probe(std::io::Cursor::new(bytes)).unwrap());
    }
}

#[test]
fn errors_name_the_parameter() {
    let field = |standalone: Standalone| standalone.shape().unwrap_err().field.unwrap();
    assert_eq!(field(play(b"no audio at all", 0.0, None)), "path");
    assert_eq!(field(play(super::FLAC, 1e4, None)), "start");
    let standalone =
        Standalone::new::<WavInNode>(WavInParams { path: "none".into(), start: 0.0, duration: None });
    assert_eq!(field(standalone), "path");
}

#[test]
fn a_nan_stops_the_run_at_its_time() {
    let mut audio = vec![0.0; 800];
    audio[400] = f32::NAN;
    let fault = out(WriteFormat::Pcm24, 1, audio).run().err().unwrap();
    assert_eq!((fault.field.as_deref(), fault.time), (Some("audio"), Some(ticks(0.05))));
}

#[test]
fn a_fractional_rate_is_rejected() {
    let params = WavOutParams { path: "x".into(), format: WriteFormat::Pcm16, dither: false };
    let rate = Rate::new(24_000, 1001).unwrap();
    let standalone =
        Standalone::new::<WavOutNode>(params).input(WavOutPorts::audio, rate, Channels(1), vec![0.0]);
    assert!(standalone.shape().unwrap_err().help.unwrap().contains("Resample"));
}

#[test]
fn irregular_files_cause_warnings() {
    let notes = |path: &str| {
        let params = WavOutParams { path: path.into(), format: WriteFormat::Pcm16, dither: false };
        let standalone = Standalone::new::<WavOutNode>(params);
        standalone.input(WavOutPorts::audio, Rate::hz(8000), Channels(1), vec![0.0]).shape().unwrap().notes
    };
    assert!(notes("a.wav").is_empty() && notes("A.WAV").is_empty());
    for other in ["a", "a.mp3", "b.wav/a"] {
        let found = notes(other);
        assert!(found.len() == 1 && found[0].contains("use the extension .wav"), "{other}: {found:?}");
    }
    let warned = |bytes: &[u8]| {
        let run = play(bytes, 0.0, None).run().unwrap();
        run.summary.iter().any(|(k, text)| *k == "warning" && text.to_string().contains("do not decode"))
    };
    let mut damaged = super::FLAC.to_vec();
    let middle = damaged.len() / 2;
    damaged[middle..middle + 40].fill(0x55);
    assert!(warned(&damaged) && !warned(super::FLAC));
}
