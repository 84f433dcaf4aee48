use super::*;
use crate::core::fault::Fault;
use crate::core::random::Rng;
use crate::core::standalone::Standalone;
use crate::core::time::Rate;

const RATE: Rate = Rate::hz(48_000);

fn noise(seed: u64, n: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    (0..n).map(|_| rng.between(-0.5, 0.5) as f32).collect()
}

fn standalone(levels: bool, audio: (u16, Vec<f32>), target: (u16, Vec<f32>)) -> Standalone {
    Standalone::new::<InterauralCues>(InterauralCuesParams { levels })
        .input(InterauralCuesPorts::audio, RATE, Channels(audio.0), audio.1)
        .input(InterauralCuesPorts::target, RATE, Channels(target.0), target.1)
}

fn out(standalone: &Standalone) -> Result<Vec<f32>, Fault> {
    Ok(standalone.run()?.stream(InterauralCuesPorts::out))
}

#[test]
fn windows_change_no_bit() {
    for inputs in [1, 2] {
        let n = 9000;
        let (audio, target) = (noise(1, n * usize::from(inputs)), noise(2, 2 * n));
        let of = |window: usize| {
            out(&standalone(true, (inputs, audio.clone()), (2, target.clone())).window(RATE.span(window)))
                .unwrap()
        };
        let whole = of(n);
        assert_eq!(whole.len(), 2 * n);
        for window in [64, 255, 256, 257, 4096] {
            assert!(of(window) == whole, "{inputs} channels, windows of {window}");
        }
    }
}

#[test]
fn a_sound_is_at_its_place_from_the_first_sample_to_the_last() {
    // Both ears alike: the sound itself, in both.
    let n = 5000;
    let (audio, target) = (noise(1, n), noise(2, n));
    let target = target.iter().flat_map(|x| [*x, *x]).collect();
    let found = out(&standalone(true, (1, audio.clone()), (2, target))).unwrap();
    assert_eq!(found.len(), 2 * n);
    for (k, (frame, x)) in found.chunks_exact(2).zip(&audio).enumerate() {
        assert!((frame[0] - x).abs() < 1e-5 && (frame[1] - x).abs() < 1e-5, "{k}: {frame:?} {x}");
    }
}

#[test]
fn what_has_no_cues_to_get_passes_bit_for_bit() {
    let n = 3000;
    let mono = noise(1, n);
    assert!(out(&standalone(true, (1, mono.clone()), (1, noise(2, n)))).unwrap() == mono);
    let stereo = noise(3, 2 * n);
    for (levels, channels) in [(true, 1), (false, 2)] {
        let target = (channels, noise(4, n * usize::from(channels)));
        assert!(out(&standalone(levels, (2, stereo.clone()), target)).unwrap() == stereo);
    }
    // Mono audio gets the cues of any binaural target.
    assert_eq!(out(&standalone(false, (1, mono), (2, noise(5, 2 * n)))).unwrap().len(), 2 * n);
}

#[test]
fn a_target_of_several_channels_gives_their_levels() {
    let n = 30_000;
    let levels = [1.0_f32, 0.5, 0.25];
    let target = noise(1, n).iter().flat_map(|x| levels.map(|level| level * x)).collect();
    let found = out(&standalone(true, (1, noise(2, n)), (3, target))).unwrap();
    let power = |c: usize| found.iter().skip(c).step_by(3).map(|x| f64::from(x * x)).sum::<f64>();
    let ratios = [power(1) / power(0), power(2) / power(0)];
    assert!((ratios[0] - 0.25).abs() < 1e-3 && (ratios[1] - 0.0625).abs() < 1e-3, "{ratios:?}");
}

#[test]
fn other_rates_and_channels_are_refused_by_name() {
    let reject = standalone(true, (3, vec![0.0; 300]), (2, vec![0.0; 200])).shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F046", Some("audio")));
    assert!(reject.message.contains("3 channels") && reject.message.contains("`target` 2"), "{reject}");
    let other = Standalone::new::<InterauralCues>(InterauralCuesParams { levels: true })
        .input(InterauralCuesPorts::audio, RATE, Channels(1), vec![0.0; 100])
        .input(InterauralCuesPorts::target, Rate::hz(44_100), Channels(2), vec![0.0; 200]);
    let reject = other.shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F045", Some("audio")));
}
