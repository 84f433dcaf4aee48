use super::*;
use crate::core::item::Channels;
use crate::core::random::Random;
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, ticks};

fn all_params() -> FrictionModelBuilderParams {
    let p = FrictionModelBuilderParams::read(&|_| None).unwrap();
    FrictionModelBuilderParams { high_pass: 0.0, encoder: Some("encoder.csv".into()), ..p }
}

/// Noise twice as loud in the second half, where the roller turns twice as fast.
fn standalone(window: f64) -> Standalone {
    let mut standalone = recorded(all_params()).window(ticks(window));
    standalone.files.insert("encoder.csv", "time_s,speed_m_s\n0,0.2\n0.99,0.2\n1.01,0.4\n2,0.4\n");
    standalone
}

fn recorded(p: FrictionModelBuilderParams) -> Standalone {
    let random = Random::new(1, "roller");
    let noise = |i: u64| (random.uniform(0, i, 0) - 0.5) as f32 * if i < 8000 { 0.1 } else { 0.2 };
    let stereo = (0..16_000).flat_map(|i| [noise(i), noise(i)]).collect();
    Standalone::new::<FrictionModelBuilder>(p)
        .input(FrictionModelBuilderPorts::recording, Rate::hz(8000), Channels(2), stereo)
        .optional(FrictionModelBuilderPorts::rest, Rate::hz(8000), Channels(1), vec![0.0; 4000])
}

#[test]
fn the_model_of_a_recording_rises_with_speed_and_does_not_depend_on_windows() {
    let model =
        |window| standalone(window).run().unwrap().value(0).unwrap().get::<FrictionModel>().unwrap().clone();
    let whole = model(3.0);
    let (low, high) = (whole.power(0.2), whole.power(0.4));
    assert!((high / low / 4.0 - 1.0).abs() < 0.1, "{low} {high}");
    assert!((low - 0.01 / 12.0).abs() < 0.1 * low, "{low}");
    for window in [0.001, 0.0177] {
        assert_eq!(model(window), whole);
    }
}

/// The recording of `standalone` with a signal in place of its table.
fn with_signal(p: FrictionModelBuilderParams, rate: u32, turning: Vec<f32>) -> Standalone {
    let port = FrictionModelBuilderPorts::turning;
    let mut standalone =
        recorded(p).optional(port, Rate::hz(rate), Channels(1), turning).window(ticks(0.0377));
    standalone.files.insert("encoder.csv", "time_s,speed_m_s\n0,0.2\n2,0.4\n");
    standalone
}

#[test]
fn a_signal_of_the_encoder_gives_the_same_model_as_its_table() {
    let model = |standalone: Standalone| {
        standalone.run().unwrap().value(0).unwrap().get::<FrictionModel>().unwrap().clone()
    };
    // A ramp in steps of 1/4096 m/s, which single precision and text represent exactly.
    let speed = |i: usize| 0.25 + i as f32 / 4096.0;
    let mut tabled = standalone(3.0);
    let rows: String =
        (0..2048).map(|i| format!("{},{}\n", i as f64 / 1000.0, f64::from(speed(i)))).collect();
    tabled.files.insert("encoder.csv", format!("time_s,speed_m_s\n{rows}"));
    let wanted = model(tabled);
    assert!(wanted.speeds.len() > 5);
    let p = FrictionModelBuilderParams { encoder: None, ..all_params() };
    assert!(model(with_signal(p.clone(), 1000, (0..2048).map(speed).collect())) == wanted);
    // At 8 kHz and backwards, with full scale at 2 m/s: every eighth sample is used.
    let half = FrictionModelBuilderParams { full_scale: 2.0, ..p.clone() };
    let fine = (0..2048 * 8).map(|i| if i % 8 == 0 { -0.5 * speed(i / 8) } else { 9.0 }).collect();
    assert!(model(with_signal(half, 8000, fine)) == wanted);
    // As an angle that wraps each turn, on a roller of 0.1 m; its speed is a difference, so it is not equal bit for
    // bit.
    let angle = FrictionModelBuilderParams {
        signal: Signal::Angle,
        full_scale: std::f64::consts::TAU,
        roller_radius: 0.1,
        ..p
    };
    let turned = |i: usize| {
        let t = i as f64 / 1000.0;
        ((0.25 * t + 0.5 * t * t * 1000.0 / 4096.0) / 0.1 / std::f64::consts::TAU).fract() as f32
    };
    let found = model(with_signal(angle, 1000, (0..2048).map(turned).collect()));
    assert_eq!(found.clips, wanted.clips);
    assert!(found.speeds.iter().zip(&wanted.speeds).all(|(a, b)| (a / b - 1.0).abs() < 1e-3));
}

#[test]
fn no_encoder_two_encoders_and_invalid_encoders_are_refused() {
    let p = FrictionModelBuilderParams { encoder: None, ..all_params() };
    let refused =
        |standalone: Standalone| standalone.shape().err().map(|reject| reject.field.unwrap_or_default());
    let signal = || vec![0.3; 2000];
    assert_eq!(refused(with_signal(p.clone(), 1000, signal())), None);
    assert_eq!(refused(with_signal(all_params(), 1000, signal())), Some("encoder".into()));
    assert_eq!(refused(recorded(p.clone())), Some("encoder".into()));
    assert_eq!(refused(with_signal(p.clone(), 1000, vec![0.3])), Some("turning".into()));
    // The recording lasts 2 s.
    assert_eq!(refused(with_signal(p.clone(), 1000, vec![0.3; 1999])), None);
    let short = with_signal(p.clone(), 1000, vec![0.3; 1900]).shape().unwrap_err();
    assert_eq!((short.code, short.field.as_deref()), ("F047", Some("turning")));
    let angle = FrictionModelBuilderParams { signal: Signal::Angle, ..p.clone() };
    assert_eq!(refused(with_signal(angle, 1000, signal())), Some("roller_radius".into()));
    let fault = with_signal(p, 1000, vec![f32::NAN; 2000]).run().err().unwrap();
    assert_eq!((fault.code, fault.field.as_deref()), ("F077", Some("turning")));
}

#[test]
fn errors_of_the_encoder_are_reported_before_the_run() {
    let mut standalone = standalone(1.0);
    standalone.files.insert("encoder.csv", "t,v\n0,1\n");
    let reject = standalone.shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F077", Some("encoder")));
    standalone.files.insert("encoder.csv", "time_s,speed_m_s\n0,0.2\n1,0.2\n0.5,0.4\n");
    let reject = standalone.shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F077", Some("encoder")));
    assert!(reject.message.contains("encoder.csv") && reject.message.contains("sample 2"), "{reject}");
}

#[test]
fn a_recording_too_slow_or_too_short_to_measure_is_refused_before_the_run() {
    let refused = |rate: u32, samples: usize, rest: usize| {
        let port = FrictionModelBuilderPorts::recording;
        let files = standalone(1.0).files;
        let mut standalone = Standalone::new::<FrictionModelBuilder>(all_params())
            .input(port, Rate::hz(rate), Channels(1), vec![0.1; samples])
            .optional(FrictionModelBuilderPorts::rest, Rate::hz(rate), Channels(1), vec![0.0; rest]);
        standalone.files = files;
        standalone.shape().err().map(|reject| (reject.code, reject.field.unwrap_or_default()))
    };
    // A clip of 50 ms is 400 samples at 8 kHz, and the next begins 100 later.
    assert_eq!(refused(8000, 500, 400), None);
    assert_eq!(refused(8000, 499, 400), Some(("F077", "recording".into())));
    assert_eq!(refused(8000, 500, 399), Some(("F077", "rest".into())));
    assert_eq!(refused(24, 1000, 1000), Some(("F077", "clip".into())));
}
