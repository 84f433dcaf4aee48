use super::*;
use crate::core::item::Data;
use crate::core::standalone::Standalone;
use crate::grain::trial_dictionary;

fn params() -> PatternResynthParams {
    let p = PatternResynthParams::read(&|_| None).unwrap();
    PatternResynthParams { rate: Rate::hz(8000), duration: Some(0.5), ..p }
}

fn standalone(p: PatternResynthParams) -> Standalone {
    let patterns = CorrelationPatterns::trial(&mut Rng::new(2));
    Standalone::new::<PatternResynth>(p)
        .value(PatternResynthPorts::patterns, patterns)
        .value(PatternResynthPorts::dictionary, trial_dictionary())
}

fn audio(p: PatternResynthParams) -> Vec<f32> {
    standalone(p).run().unwrap().stream(PatternResynthPorts::audio)
}

#[test]
fn windows_of_any_length_give_the_same_samples() {
    let of = |seconds: f64| {
        standalone(params()).window(ticks(seconds)).run().unwrap().stream(PatternResynthPorts::audio)
    };
    let whole = of(0.5);
    assert!(whole.iter().any(|x| x.abs() > 1e-3));
    assert_eq!(of(0.001), whole);
    assert_eq!(of(0.0137), whole);
}

#[test]
fn a_repeated_pattern_begins_again_at_its_end() {
    let repeated = audio(PatternResynthParams { repeat: true, duration: Some(0.6), ..params() });
    let once = audio(PatternResynthParams { duration: Some(0.6), ..params() });
    // Recordings of 2000 samples.
    assert!(once[2200..].iter().all(|x| *x == 0.0) && repeated[2200..].iter().any(|x| x.abs() > 1e-3));
    assert_eq!(repeated[2400..4000], once[400..2000]);
}

#[test]
fn stereo_has_both_channels_and_names_and_rates_are_checked() {
    let (stereo, mono) = (audio(PatternResynthParams { channels: 2, ..params() }), audio(params()));
    assert!(stereo.chunks(2).zip(&mono).all(|(two, one)| two == [*one, *one]));
    let error = |p: PatternResynthParams| standalone(p).run().err().unwrap().message;
    let unknown = error(PatternResynthParams { recording: "nothing".into(), ..params() });
    assert!(unknown.contains("no recording is named"), "{unknown}");
    let rate = error(PatternResynthParams { rate: Rate::hz(48_000), ..params() });
    assert!(rate.contains("8000"), "{rate}");
}
