use super::super::generator::{GeneratorRules, generated};
use super::*;
use crate::core::feed::Feed;
use crate::core::item::Data;
use crate::core::standalone::Standalone;
use crate::grain::synthesis::sound_of;
use crate::grain::trial_dictionary;

fn model() -> PatternModel {
    PatternModel::trial(&mut Rng::new(2))
}

fn params() -> GrainTextureParams {
    let p = GrainTextureParams::read(&|_| None).unwrap();
    GrainTextureParams { rate: Rate::hz(8000), duration: Some(1.0), ..p }
}

fn standalone(p: GrainTextureParams) -> Standalone {
    Standalone::new::<GrainTexture>(p)
        .value(GrainTexturePorts::model, model())
        .value(GrainTexturePorts::dictionary, trial_dictionary())
}

fn audio(run: Standalone) -> Vec<f32> {
    run.run().unwrap().stream(GrainTexturePorts::audio)
}

#[test]
fn windows_of_any_length_give_the_same_samples() {
    let whole = audio(standalone(params()));
    assert!(whole.iter().any(|x| x.abs() > 1e-3));
    for seconds in [0.001, 0.0137, 0.3] {
        assert_eq!(audio(standalone(params()).window(ticks(seconds))), whole, "{seconds}");
    }
}

#[test]
fn the_grains_of_a_generator_are_played() {
    // The same random numbers for both.
    let dictionary = trial_dictionary();
    let (model, random) = (model(), Random::new(5, "texture"));
    let rules = GeneratorRules { density: 1.7, ..GeneratorRules::default() };
    let uniform = |index: u64, lane: u32| random.uniform(0, index, lane);
    let steps = generated([&model, &model], &dictionary, &rules, 16_000, false, uniform);
    let want = sound_of(&dictionary, [&steps], 16_000);
    let (mut queue, mut generator, mut out) =
        (SegmentQueue::default(), Generator::default(), vec![0.0; 16_000]);
    for (k, out) in out.chunks_mut(777).enumerate() {
        queue.add(&dictionary, [777 * k as i64, 1], out, |_, _| {
            let step = generator.next([&model, &model], &dictionary, &rules, uniform).step;
            single(&dictionary, &step).filter(|segment| segment.end() <= 16_000)
        });
    }
    assert!(steps.len() > 20);
    assert_eq!(out, want);
}

#[test]
fn density_and_loudness_follow_their_controls() {
    let constant = |value: f32| Feed::stream::<f32>(Rate::hz(8000), Channels(1), vec![value; 8000]);
    let with = |port: usize, value: f32| audio(standalone(params()).feed(port, constant(value)));
    let of = |p: GrainTextureParams| audio(standalone(p));
    let dense = with(GrainTexturePorts::density.index(), 3.0);
    assert_eq!(dense, of(GrainTextureParams { density: 3.0, ..params() }));
    let soft = with(GrainTexturePorts::loudness.index(), -20.0);
    assert_eq!(soft, of(GrainTextureParams { loudness: -20.0, ..params() }));
    // What is not finite leaves the parameter.
    assert_eq!(with(GrainTexturePorts::density.index(), f32::NAN), of(params()));
    let energy = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let fall = 10.0 * (energy(&of(params())) / energy(&soft)).log10();
    assert!((fall - 20.0).abs() < 0.01, "{fall}");
}

#[test]
fn models_of_another_dictionary_are_refused() {
    let other = PatternModel { dictionary: "other".into(), ..model() };
    let run = Standalone::new::<GrainTexture>(params())
        .value(GrainTexturePorts::model, other)
        .value(GrainTexturePorts::dictionary, trial_dictionary());
    let error = run.run().err().unwrap();
    assert!(error.message.contains("another dictionary"), "{}", error.message);
}
