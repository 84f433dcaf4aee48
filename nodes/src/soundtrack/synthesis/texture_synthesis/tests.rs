use super::*;
use crate::core::feed::Feed;
use crate::core::item::AnyValue;
use crate::core::standalone::Standalone;
use crate::dsp::{Band, Butterworth, zero_phase};
use crate::soundtrack::score::read_score;
use crate::soundtrack::synthesis::{SourcePosition, Synthesizer};
use crate::soundtrack::wavelet::{ThresholdRules, TreeRecording, TreeRules, Wavelet, WaveletTree, inverse};

const RATE: Rate = Rate::hz(8000);

/// Low noise for a second, then high noise for a second, in each recording.
fn model(channels: usize) -> TextureModel {
    let mut rng = Rng::new(3);
    let mut channel = || {
        let (mut low, mut last) = (0.0, 0.0);
        (0..16_000)
            .map(|k| {
                let x = rng.between(-1.0, 1.0);
                low = 0.95 * low + 0.1 * x;
                let high = 0.5 * (x - last);
                last = x;
                (0.4 * if k < 8000 { low } else { high }) as f32
            })
            .collect::<Vec<f32>>()
    };
    let channels = (0..channels).map(|_| channel()).collect();
    let recording = TreeRecording { name: "a.wav".into(), content: String::new(), channels };
    let rules = TreeRules { block: Some(0.05), ..TreeRules::default() };
    TextureModel::new(WaveletTree::analyse(8000.0, &[recording], &rules).unwrap(), &ThresholdRules::default())
}

fn score(text: &str) -> SoundScore {
    read_score(&format!("SoundScore(sources: [(name: \"low\", segments: [(0.1, 0.9)]), (name: \"high\", segments: [(1.1, 1.9)])], targets: [{text}])")).unwrap()
}

fn params() -> TextureSynthesisParams {
    let p = TextureSynthesisParams::read(&|_| None).unwrap();
    TextureSynthesisParams { rate: RATE, duration: Some(2.0), reaction: 1.0, ..p }
}

fn standalone(p: TextureSynthesisParams, channels: usize) -> Standalone {
    Standalone::new::<TextureSynthesis>(p).value(TextureSynthesisPorts::model, model(channels))
}

fn with_score(p: TextureSynthesisParams, text: &str) -> Standalone {
    standalone(p, 1).feed(TextureSynthesisPorts::score.index(), Feed::value(AnyValue::new(score(text))))
}

fn audio(run: &Standalone) -> Vec<f32> {
    run.run().unwrap().stream(TextureSynthesisPorts::audio)
}

#[test]
fn windows_of_any_length_give_the_same_samples() {
    let whole = standalone(params(), 1).run().unwrap();
    let positions = whole.stream(TextureSynthesisPorts::positions);
    let whole = whole.stream(TextureSynthesisPorts::audio);
    assert_eq!((whole.len(), positions.len()), (16_000, 8000));
    for seconds in [0.001, 0.0137, 0.3] {
        let run = standalone(params(), 1).window(ticks(seconds)).run().unwrap();
        assert_eq!(run.stream(TextureSynthesisPorts::audio), whole, "{seconds}");
        assert_eq!(run.stream(TextureSynthesisPorts::positions), positions, "{seconds}");
    }
}

#[test]
fn the_stream_equals_the_inverse_of_the_whole_tree() {
    let whole = audio(&standalone(params(), 1));
    let model = Arc::new(model(1));
    let random = standalone(params(), 1).random();
    let reach = model.tree.wavelet.reach() as i64 + 1;
    let mut s =
        Synthesizer::new(Arc::clone(&model), Arc::default(), params().rules(), random, -reach, Some(2.0));
    let mut all = crate::soundtrack::wavelet::Coefficients {
        approximation: Vec::new(),
        details: vec![Vec::new(); model.tree.depth as usize],
    };
    let span = model.tree.span(0);
    for _ in -reach..(16_000 / span) as i64 + reach + 1 {
        s.advance(None);
        all.approximation.extend(s.approximation().iter().map(|x| f64::from(*x)));
        for (l, level) in all.details.iter_mut().enumerate() {
            let mut details = s.details(l).to_vec();
            s.join(l, &mut details);
            level.extend(details.into_iter().map(f64::from));
        }
    }
    let x = inverse(model.tree.wavelet, &all);
    for (k, y) in whole.iter().enumerate() {
        let x = x[k + reach as usize * span];
        assert!((x - f64::from(*y)).abs() < 1e-5, "{k}: {x} {y}");
    }
}

/// Power of the differences between neighbours over the power: about 0.05 for the low sound, 3 for the high one.
fn roughness(x: &[f32]) -> f64 {
    let power: f64 = x.iter().map(|x| f64::from(*x).powi(2)).sum();
    x.windows(2).map(|p| f64::from(p[1] - p[0]).powi(2)).sum::<f64>() / power
}

#[test]
fn a_score_places_sounds_and_positions_state_them() {
    let text = "(source: \"low\", from: 0, to: 1), (source: \"high\", from: 1, to: 2)";
    let run = with_score(params(), text).run().unwrap();
    let x = run.stream(TextureSynthesisPorts::audio);
    assert!(
        roughness(&x[..6000]) < 0.2 && roughness(&x[10_000..]) > 1.5,
        "{} {}",
        roughness(&x[..6000]),
        roughness(&x[10_000..])
    );
    let positions = run.stream(TextureSynthesisPorts::positions);
    assert!(positions[..3900].iter().all(|p| p.recording == 0 && p.seconds > 0.099 && p.seconds < 0.901));
    assert!(positions[4100..].iter().all(|p| p.seconds > 1.099 && p.seconds < 1.901));
    assert!(positions.iter().all(|p| (f64::from(p.frame) / 8000.0 - f64::from(p.seconds)).abs() < 1e-6));
}

#[test]
fn a_later_change_of_the_score_leaves_what_is_earlier() {
    let p = || TextureSynthesisParams { look_ahead: Some(0.1), ..params() };
    let before = "(source: \"low\", from: 0.2, to: 0.5)";
    let a = audio(&with_score(p(), before));
    let b = audio(&with_score(p(), &format!("{before}, (source: \"high\", from: 1.5, to: 1.8)")));
    let span = model(1).tree.span(0);
    // The ramp before the target, the look-ahead, and five blocks.
    let same = (1.45 - 0.1) * 8000.0 - 5.0 * span as f64;
    let differs = a.iter().zip(&b).position(|(a, b)| a != b).unwrap();
    assert!(differs as f64 > same && differs < 12_000, "{differs} {same}");
}

#[test]
fn weights_of_a_stream_equal_those_of_a_score() {
    let rate = Rate::hz(100);
    let items: Vec<f32> = (0..200).flat_map(|k| if k < 100 { [1.0, 0.0] } else { [0.0, 1.0] }).collect();
    let streamed = with_score(params(), "")
        .feed(TextureSynthesisPorts::weights.index(), Feed::stream::<f32>(rate, Channels(2), items));
    let mut score = score("(source: \"low\", from: 0, to: 1), (source: \"high\", from: 1, to: 10)");
    score.pad = Some(0.0);
    let scored =
        standalone(params(), 1).feed(TextureSynthesisPorts::score.index(), Feed::value(AnyValue::new(score)));
    assert_eq!(audio(&streamed), audio(&scored));
    assert_eq!(audio(&streamed.window(ticks(0.013))), audio(&scored));
}

#[test]
fn channels_are_those_of_the_model_or_their_mean() {
    let stereo = audio(&standalone(TextureSynthesisParams { channels: 2, ..params() }, 2));
    let mono = audio(&standalone(params(), 2));
    assert_eq!(stereo.len(), 32_000);
    for (frame, mean) in stereo.chunks_exact(2).zip(&mono) {
        assert!(((frame[0] + frame[1]) / 2.0 - mean).abs() < 1e-6);
    }
    let both = audio(&standalone(TextureSynthesisParams { channels: 2, ..params() }, 1));
    assert!(both.chunks_exact(2).all(|frame| frame[0] == frame[1]));
    let e = standalone(TextureSynthesisParams { channels: 3, ..params() }, 2).run().err().unwrap();
    assert!(e.message.contains("the model has 2 channels"), "{e}");
}

#[test]
fn a_sound_that_is_short_for_its_target_is_a_warning() {
    let p = || TextureSynthesisParams { duration: Some(0.2), ..params() };
    let warnings = |text: &str| {
        let run = with_score(p(), text).run().unwrap();
        run.summary
            .into_iter()
            .filter(|(name, _)| *name == "warning")
            .map(|(_, text)| text.to_string())
            .collect::<String>()
    };
    assert_eq!(warnings("(source: \"low\", from: 0, to: 3)"), "");
    let long = warnings("(source: \"low\", from: 0, to: 3.5)");
    assert!(long.contains("low has the weight 1 for 3.50 s, and lasts 0.80 s"), "{long}");
}

#[test]
fn what_does_not_fit_is_named() {
    let error = |run: Standalone| run.run().err().unwrap();
    let e = error(standalone(TextureSynthesisParams { rate: Rate::hz(16_000), ..params() }, 1));
    assert!(e.code == "F155" && e.message.contains("the model has 8000 Hz"), "{e}");
    let e = error(with_score(
        params(),
        "(source: \"low\", from: 0, to: 1),\n(source: \"high\", from: 0.5, to: 1)",
    ));
    assert!(e.code == "F156" && e.message.starts_with("2:1: high has the weight 1 from 0.5 s to 1 s"), "{e}");
    let weights = |channels: u16| {
        let items = vec![0.0; 10 * usize::from(channels)];
        Feed::stream::<f32>(Rate::hz(100), Channels(channels), items)
    };
    let e = error(with_score(params(), "").feed(TextureSynthesisPorts::weights.index(), weights(3)));
    assert!(e.message.contains("there are 3 weights, and the score has 2 sounds"), "{e}");
    let short = TextureSynthesisParams { reaction: 0.1, ..params() };
    let e = error(with_score(short, "").feed(TextureSynthesisPorts::weights.index(), weights(2)));
    assert!(e.message.contains("act by 0.276 s early"), "{e}");
    let e = error(standalone(params(), 1).feed(TextureSynthesisPorts::weights.index(), weights(2)));
    assert!(e.message.contains("no score"), "{e}");
}

#[test]
fn a_stream_of_another_model_begins_anew() {
    let stream = |channels: usize, wavelet: Wavelet| {
        let tree = WaveletTree { wavelet, ..model(channels).tree };
        let model = Arc::new(TextureModel::new(tree, &ThresholdRules::default()));
        TextureStream::new(model, Arc::default(), params().rules(), standalone(params(), 1).random(), None)
    };
    let play = |stream: &mut TextureStream, channels: usize| {
        let mut audio = vec![0.0; 100 * channels];
        stream.fill(1000, None, &mut audio, &mut []);
        audio
    };
    let mut old = stream(2, Wavelet::Db5);
    let mut first = vec![0.0; 2000];
    old.fill(0, None, &mut first, &mut []);
    let goes_on = play(&mut old.clone(), 2);
    for (channels, wavelet, is_same) in
        [(2, Wavelet::Db5, true), (1, Wavelet::Db5, false), (2, Wavelet::Db2, false)]
    {
        let mut new = stream(channels, wavelet);
        new.follow(&old);
        assert_eq!(play(&mut new, channels) == goes_on, is_same, "{channels} {wavelet:?}");
    }
}

/// The level of a band of octaves around `centre`, dB.
fn octave(x: &[f32], centre: f64) -> f64 {
    let x: Vec<f64> = x.iter().map(|x| f64::from(*x)).collect();
    let pass = |band, cutoff| Butterworth::design(band, 4, cutoff, 8000.0).unwrap();
    let y = zero_phase(&pass(Band::LowPass, centre * 1.414), &x);
    let y = zero_phase(&pass(Band::HighPass, centre / 1.414), &y);
    let inner = &y[400..y.len() - 400];
    10.0 * (inner.iter().map(|y| y * y).sum::<f64>() / inner.len() as f64 + 1e-15).log10()
}

#[test]
fn hard_constraints_are_heard() {
    // Noise below 200 Hz, and then noise above 1.5 kHz.
    let mut rng = Rng::new(5);
    let white: Vec<f64> = (0..48_000).map(|_| rng.between(-0.3, 0.3)).collect();
    let pass = |band, cutoff| Butterworth::design(band, 4, cutoff, 8000.0).unwrap();
    let low = zero_phase(&pass(Band::LowPass, 200.0), &white[..24_000]);
    let high = zero_phase(&pass(Band::HighPass, 1500.0), &white[24_000..]);
    let channel: Vec<f32> = low.into_iter().chain(high).map(|x| x as f32).collect();
    let source = [channel[800..23_200].to_vec(), channel[24_800..47_200].to_vec()];
    let recording = TreeRecording { name: "a.wav".into(), content: String::new(), channels: vec![channel] };
    let rules = TreeRules { block: Some(0.05), ..TreeRules::default() };
    let tree = WaveletTree::analyse(8000.0, &[recording], &rules).unwrap();
    let model = TextureModel::new(tree, &ThresholdRules::default());
    let text = "SoundScore(sources: [(name: \"low\", segments: [(0.05, 2.95)], outside: Exclude), (name: \"high\", segments: [(3.05, 5.95)])],
        targets: [(source: \"low\", from: 0, to: 3), (source: \"high\", from: 3.5, to: 6)])";
    let run = Standalone::new::<TextureSynthesis>(TextureSynthesisParams { duration: Some(6.0), ..params() })
        .value(TextureSynthesisPorts::model, model)
        .feed(TextureSynthesisPorts::score.index(), Feed::value(AnyValue::new(read_score(text).unwrap())));
    let x = audio(&run);
    let (wanted, without) = (&x[800..23_200], &x[28_800..47_200]);
    for centre in [63.0, 125.0, 250.0] {
        // Within 1 dB of the range of the thirds of the sound.
        let parts: Vec<f64> = source[0].chunks_exact(7400).map(|x| octave(x, centre)).collect();
        let (least, most) =
            parts.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
        let found = octave(wanted, centre);
        assert!(found > least - 1.0 && found < most + 1.0, "{centre}: {found} of {least} to {most}");
        // Where it is excluded it is 30 dB down.
        assert!(octave(without, centre) < found - 30.0, "{centre}: {} {found}", octave(without, centre));
    }
    let (found, own) = (octave(without, 2000.0), octave(&source[1], 2000.0));
    assert!((found - own).abs() < 1.0, "{found} {own}");
}

/// A tone and noise, whose levels swell by 18 dB every 3 s, in blocks of 0.25 s.
fn swells() -> TextureModel {
    let mut rng = Rng::new(7);
    let sample = |k: i32| {
        let t = f64::from(k) / 8000.0;
        let level = 10_f64.powf(-0.45 * (2.0 * std::f64::consts::PI * t / 3.0).cos());
        (0.02 * level * ((2500.0 * t).sin() + rng.between(-1.0, 1.0))) as f32
    };
    let channel = (0..192_000).map(sample).collect();
    let recording = TreeRecording { name: "a.wav".into(), content: String::new(), channels: vec![channel] };
    let rules = TreeRules { block: Some(0.256), ..TreeRules::default() };
    TextureModel::new(WaveletTree::analyse(8000.0, &[recording], &rules).unwrap(), &ThresholdRules::default())
}

#[test]
fn levels_go_on_at_joins() {
    let steps = |join_gain: f64| {
        let p = TextureSynthesisParams { duration: Some(60.0), join_gain, ..params() };
        let run = Standalone::new::<TextureSynthesis>(p)
            .value(TextureSynthesisPorts::model, swells())
            .run()
            .unwrap();
        let x = run.stream(TextureSynthesisPorts::audio);
        let positions = run.stream(TextureSynthesisPorts::positions);
        let level = |x: &[f32]| 10.0 * (x.iter().map(|x| x * x).sum::<f32>() / x.len() as f32).log10();
        // Of parts of 40 ms on either side.
        let step = |k: usize| level(&x[2 * k..2 * k + 320]) - level(&x[2 * k - 320..2 * k]);
        let is_join = |k: &usize| positions[*k].frame != positions[*k - 1].frame + 2;
        let joins: Vec<f32> = (1000..positions.len() - 1000).filter(is_join).map(step).collect();
        let frames: Vec<u32> = positions.iter().map(|p| p.frame).collect();
        assert!(joins.len() > 50, "{}", joins.len());
        ((joins.iter().map(|x| x * x).sum::<f32>() / joins.len() as f32).sqrt(), frames)
    };
    let (recorded, of_recorded) = steps(0.0);
    let (joined, of_joined) = steps(20.0);
    // The swell has 9 dB to either side: at random places, blocks would differ by 9 dB rms. Joined at borders of a class they differ by less already.
    assert!(recorded < 4.5 && joined < 0.9 * recorded, "{recorded} {joined}");
    assert_eq!(of_recorded, of_joined, "the choice is the same");
}

#[test]
fn another_sound_begins_at_its_own_level() {
    // The high sound is 40 dB above the low one at 3 kHz. It begins where a block does.
    let text = "(source: \"low\", from: 0, to: 1.024), (source: \"high\", from: 1.024, to: 2)";
    let begins = |join_gain: f64| {
        let run = Standalone::new::<TextureSynthesis>(TextureSynthesisParams { join_gain, ..params() })
            .value(TextureSynthesisPorts::model, model(1))
            .feed(TextureSynthesisPorts::score.index(), Feed::value(AnyValue::new(score(text))));
        let x = audio(&run);
        assert_eq!(8192 % model(1).tree.span(0), 0);
        10.0 * x[8240..8640].iter().map(|x| x * x).sum::<f32>().log10()
    };
    let (recorded, joined) = (begins(0.0), begins(40.0));
    assert!((recorded - joined).abs() < 1.0, "{recorded} {joined}");
}

#[test]
fn a_look_ahead_brings_what_leads_to_a_sound() {
    // A rising tone always leads to a burst; between them is noise.
    let mut rng = Rng::new(6);
    let (rate, count) = (8000.0, 12);
    let mut channel = Vec::new();
    for _ in 0..count {
        channel.extend((0..12_000).map(|_| rng.between(-0.05, 0.05) as f32));
        channel.extend((0..4000).map(|k| {
            let t = f64::from(k) / rate;
            (0.3 * (2.0 * std::f64::consts::PI * (300.0 + 400.0 * t) * t).sin() + rng.between(-0.05, 0.05))
                as f32
        }));
        channel
            .extend((0..4000).map(|k| (f64::from(-k) / 1000.0).exp() as f32 * rng.between(-1.0, 1.0) as f32));
    }
    let recording = TreeRecording { name: "a.wav".into(), content: String::new(), channels: vec![channel] };
    let rules = TreeRules { block: Some(0.13), ..TreeRules::default() };
    let tree = WaveletTree::analyse(rate, &[recording], &rules).unwrap();
    let model = TextureModel::new(tree, &ThresholdRules::default());
    let segments: Vec<String> =
        (0..count).map(|k| format!("({}, {})", 2.5 * f64::from(k) + 2.0, 2.5 * f64::from(k) + 2.4)).collect();
    let targets: Vec<String> =
        (0..20).map(|k| format!("(source: \"boom\", from: {0}, to: {0}.4)", 3 * k + 2)).collect();
    let text = format!(
        "SoundScore(pad: 0, sources: [(name: \"boom\", segments: [{}], outside: Exclude)], targets: [{}])",
        segments.join(","),
        targets.join(",")
    );
    let led = |look_ahead: f64| {
        let p = TextureSynthesisParams {
            duration: Some(62.0),
            look_ahead: Some(look_ahead),
            max_run: None,
            ..params()
        };
        let run =
            Standalone::new::<TextureSynthesis>(p).value(TextureSynthesisPorts::model, model.clone()).feed(
                TextureSynthesisPorts::score.index(),
                Feed::value(AnyValue::new(read_score(&text).unwrap())),
            );
        let run = run.run().unwrap();
        let positions = run.stream(TextureSynthesisPorts::positions);
        // Targets before which the tone is heard for most of 0.3 s.
        let is_led = |k: &usize| {
            let end = (3 * k + 2) * 4000 - 200;
            let own = &positions[end - 1200..end];
            let is_tone = |p: &&SourcePosition| (1.5..2.0).contains(&(f64::from(p.seconds) % 2.5));
            own.iter().filter(is_tone).count() > 600
        };
        (0..20).filter(is_led).count()
    };
    let (with, without) = (led(0.4), led(0.0));
    // A tone leads to about every fourth by chance.
    assert!(with >= 16 && without <= 8, "{with} {without} of 20");
}
