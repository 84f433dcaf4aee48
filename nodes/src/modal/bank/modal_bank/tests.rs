use super::*;
use crate::core::standalone::Standalone;

const FS: u32 = 44_100;

fn params() -> ModalBankParams {
    ModalBankParams::read(&|_| None).unwrap()
}

/// Twenty modes, each 6 dB weaker than the one before.
fn modes() -> Modes {
    let frequencies = (0..20).map(|k| 200.0 + 97.0 * f64::from(k)).collect();
    let gains = (0..20).map(|k| 0.5_f32.powi(k)).collect();
    Modes::new("graded", frequencies, vec![3.0; 20], gains).unwrap()
}

/// White noise as a force.
fn noise(samples: usize) -> Vec<f32> {
    let mut rng = Rng::new(8);
    (0..samples).map(|_| rng.between(-100.0, 100.0) as f32).collect()
}

fn standalone(p: ModalBankParams, samples: usize) -> Standalone {
    Standalone::new::<ModalBankNode>(p)
        .also(ModalBankPorts::forces, Rate::hz(FS), Channels(1), noise(samples))
        .value(ModalBankPorts::modes, modes())
        .window(Rate::hz(FS).span(256))
}

fn rms(x: &[f32]) -> f64 {
    (x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

#[test]
fn parameter_changes_while_it_rings_do_not_click() {
    let edits = [
        ModalBankParams { gain: 4.0, ..params() },
        ModalBankParams { db: -60.0, ..params() },
        ModalBankParams { damping: 20.0, ..params() },
        ModalBankParams { pitch: 1.5, ..params() },
        ModalBankParams { floor: -60.0, ..params() },
    ];
    for edit in edits {
        let mut run = standalone(params(), FS as usize).start().unwrap();
        let mut count = 0;
        while run.step().unwrap() {
            count += 1;
            if count == 60 {
                assert_eq!(run.node().retune(&edit), Retune::Done);
            }
        }
        let out = run.stream(ModalBankPorts::audio);
        let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        let before = step(&out[4000..15_000]).max(step(&out[18_000..44_000]));
        let during = step(&out[15_000..17_000]);
        assert!(before > 0.0 && during < 2.0 * before, "{edit:?}: {during} against {before}");
    }
    let mut run = standalone(params(), 1000).start().unwrap();
    assert_eq!(run.node().retune(&ModalBankParams { cull: -40.0, ..params() }), Retune::Rebuild);
}

#[test]
fn modes_above_049_of_the_rate_are_noted_before_the_run() {
    let high = Modes::new(
        "high",
        vec![100.0, 0.49 * f64::from(FS), 0.489 * f64::from(FS)],
        vec![1.0; 3],
        vec![1.0; 3],
    );
    let standalone = Standalone::new::<ModalBankNode>(params())
        .also(ModalBankPorts::forces, Rate::hz(FS), Channels(1), noise(100))
        .value(ModalBankPorts::modes, high.unwrap());
    let notes = standalone.shape().unwrap().notes;
    assert!(notes.len() == 1 && notes[0].contains("1 of 3 modes lie above 0.49 of"), "{notes:?}");
    assert!(self::standalone(params(), 100).shape().unwrap().notes.is_empty());
}

#[test]
fn the_error_of_left_out_modes_is_near_the_cull_level() {
    let figure = |run: &crate::core::standalone::StandaloneRun, key: &str| {
        run.summary.iter().find(|(k, _)| *k == key).and_then(|(_, v)| v.as_f64())
    };
    let all = standalone(ModalBankParams { cull: -300.0, ..params() }, 22_050).run().unwrap();
    let sound = all.stream(ModalBankPorts::audio);
    for (cull, used) in [(-80.0, 14.0), (-40.0, 7.0)] {
        let run = standalone(ModalBankParams { cull, ..params() }, 22_050).run().unwrap();
        assert_eq!((figure(&run, "modes"), figure(&run, "modes_too_weak")), (Some(used), Some(20.0 - used)));
        let less = run.stream(ModalBankPorts::audio);
        let error: Vec<f32> = sound.iter().zip(&less).map(|(a, b)| a - b).collect();
        let level = 20.0 * (rms(&error) / rms(&sound)).log10();
        println!("cull {cull} dB: {used} modes, what is error is at {level:.1} dB");
        assert!(level < cull + 2.0 && level > cull - 12.0, "{cull}: {level} dB");
    }
    assert_eq!((figure(&all, "modes"), figure(&all, "modes_too_weak")), (Some(20.0), None));
    assert_eq!(standalone(params(), 22_050).run().unwrap().stream(ModalBankPorts::audio).len(), sound.len());
}
