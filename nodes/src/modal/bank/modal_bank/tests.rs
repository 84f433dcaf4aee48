use super::*;
use crate::core::item::AnyValue;
use crate::core::standalone::{Feed, Standalone};

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

/// One mode of 500 Hz on a tetrahedron, whose vertices move along z by 1, 2, 3 and 4.
fn one_mode() -> (Modes, ModeShapes) {
    let modes = Modes::new("one", vec![500.0], vec![2.0], vec![1.0]).unwrap();
    let shapes = (1..=4).flat_map(|k| [0.0, 0.0, k as f32]).collect();
    let shapes = ModeShapes {
        shapes,
        gains: vec![1.0],
        ..<ModeShapes as crate::core::item::Data>::trial(&mut Rng::new(1))
    };
    (modes, shapes)
}

/// The sound of two impulses at two contact points: impulse k at 0.1 (k + 1) s.
fn struck(positions: Vec<(Tick, Impact)>, supports: Vec<(Tick, Support)>, window: Tick) -> Vec<f32> {
    struck_in(BankForm::Time, positions, supports, window)
}

fn struck_in(
    form: BankForm,
    positions: Vec<(Tick, Impact)>,
    supports: Vec<(Tick, Support)>,
    window: Tick,
) -> Vec<f32> {
    let (modes, shapes) = one_mode();
    let mut force = vec![0.0; 2 * FS as usize];
    for k in 0..2 {
        force[2 * (FS as usize / 10 * (k + 1)) + k] = FS as f32;
    }
    let p = ModalBankParams {
        output: BankOutput::Displacement,
        reference: Reference::Absolute,
        cull: -300.0,
        form,
        ..params()
    };
    let standalone = Standalone::new::<ModalBankNode>(p)
        .also(ModalBankPorts::forces, Rate::hz(FS), Channels(2), force)
        .value(ModalBankPorts::modes, modes)
        .feed(ModalBankPorts::shapes.index(), Feed::value(AnyValue::new(shapes)))
        .feed(ModalBankPorts::positions.index(), Feed::events(positions, ticks(1.0)))
        .feed(ModalBankPorts::supports.index(), Feed::events(supports, ticks(1.0)));
    standalone.window(window).run().unwrap().stream(ModalBankPorts::audio)
}

/// Amplitude around a time, over ten periods.
fn amplitude(sound: &[f32], time: f64) -> f64 {
    let at = (time * f64::from(FS)) as usize;
    rms(&sound[at..at + FS as usize / 50]) * std::f64::consts::SQRT_2
}

#[test]
fn contact_points_move_to_the_positions_of_impacts() {
    let at = |time: f64, point: u32, local: [f32; 3]| {
        let body = crate::modal::Body { mass: 0.1, restitution: 0.0 };
        (ticks(time), Impact { point, local, ..Impact::from_velocity(1.0, body) })
    };
    // Slightly below the face z = 0, near vertices 0 and 2; the inward normal there is z.
    let positions = vec![at(0.1, 0, [1e-6, 1e-6, -1e-6]), at(0.2, 1, [1e-6, 0.0999, -1e-6])];
    let sound = struck(positions.clone(), Vec::new(), ticks(0.02));
    let first = amplitude(&sound, 0.15) * (2.0_f64 * 0.06).exp();
    assert!((first - 1.0).abs() < 0.01, "{first}");
    // Both, in phase: 100 ms are 50 periods.
    let both = amplitude(&sound, 0.25) * (2.0_f64 * 0.06).exp();
    assert!((both - (2.997 + (-0.2_f64).exp())).abs() < 0.03, "{both}");
    for window in [Rate::hz(FS).span(1), Rate::hz(FS).span(77), ticks(1.0)] {
        assert_eq!(struck(positions.clone(), Vec::new(), window), sound);
    }
}

#[test]
fn a_grip_changes_the_decay_to_half_of_the_sum_of_dampings_without_a_step() {
    let body = crate::modal::Body { mass: 0.1, restitution: 0.0 };
    let hit = Impact { local: [0.0, 0.0999, -1e-6], ..Impact::from_velocity(1.0, body) };
    // At vertex 0 on the face z = 0: G / 2 = 20 / 2 * 1^2 along the normal.
    let grip = Support { id: 5, local: [1e-6, 1e-6, 0.0], coefficient: 20.0, mu: 0.5, release: 0.005 };
    let supports = vec![(ticks(0.5), grip), (ticks(0.8), Support { coefficient: 0.0, ..grip })];
    let sound = struck(vec![(ticks(0.1), hit)], supports.clone(), ticks(0.02));
    let decay = |a: f64, b: f64| (amplitude(&sound, a) / amplitude(&sound, b)).ln() / (b - a);
    for (found, expected) in [(decay(0.3, 0.45), 2.0), (decay(0.51, 0.77), 12.0), (decay(0.82, 0.96), 2.0)] {
        assert!((found / expected - 1.0).abs() < 0.02, "{found} for {expected}");
    }
    // The largest difference of neighbouring samples is that of the mode itself.
    let steps = |a: f64, b: f64| {
        let range = (a * f64::from(FS)) as usize..(b * f64::from(FS)) as usize;
        sound[range].windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
    };
    assert!(steps(0.5, 0.51) <= steps(0.49, 0.5), "{} {}", steps(0.5, 0.51), steps(0.49, 0.5));
    for window in [Rate::hz(FS).span(1), Rate::hz(FS).span(77), ticks(1.0)] {
        assert_eq!(struck(vec![(ticks(0.1), hit)], supports.clone(), window), sound);
    }
}

#[test]
fn a_material_replaces_the_damping_while_the_mode_rings() {
    let curve = DampingCurve::new(|_| 8.0);
    let mut force = vec![0.0; FS as usize];
    force[0] = FS as f32;
    let p = ModalBankParams { output: BankOutput::Displacement, reference: Reference::Absolute, ..params() };
    let standalone = Standalone::new::<ModalBankNode>(p)
        .also(ModalBankPorts::forces, Rate::hz(FS), Channels(1), force)
        .value(ModalBankPorts::modes, one_mode().0)
        .feed(ModalBankPorts::material.index(), Feed::events(vec![(ticks(0.4), curve)], ticks(1.0)));
    let sound = standalone.window(ticks(0.02)).run().unwrap().stream(ModalBankPorts::audio);
    let decay = |a: f64, b: f64| (amplitude(&sound, a) / amplitude(&sound, b)).ln() / (b - a);
    assert!((decay(0.1, 0.36) / 2.0 - 1.0).abs() < 0.02 && (decay(0.42, 0.9) / 8.0 - 1.0).abs() < 0.02);
}

#[test]
fn positions_and_supports_need_shapes_of_the_same_object() {
    let (modes, shapes) = one_mode();
    let standalone = |shapes: Option<ModeShapes>| {
        let mut all = Standalone::new::<ModalBankNode>(params())
            .also(ModalBankPorts::forces, Rate::hz(FS), Channels(1), vec![0.0; 10])
            .value(ModalBankPorts::modes, modes.clone())
            .feed(ModalBankPorts::supports.index(), Feed::events(Vec::<(Tick, Support)>::new(), 1));
        if let Some(shapes) = shapes {
            all = all.feed(ModalBankPorts::shapes.index(), Feed::value(AnyValue::new(shapes)));
        }
        all.shape().err().map(|reject| reject.message)
    };
    assert!(standalone(None).unwrap().contains("`supports` are on the surface"));
    let other = ModeShapes { shapes: vec![0.0; 24], gains: vec![1.0; 2], ..shapes.clone() };
    assert!(standalone(Some(other)).unwrap().contains("shapes of 2 modes for 1 modes"));
    assert_eq!(standalone(Some(shapes)), None);
}

#[test]
fn of_a_coupled_pair_only_the_combination_that_moves_at_the_support_is_damped() {
    let pair = |coupling: SupportCoupling, point: usize| {
        let modes = Modes::new("pair", vec![500.0; 2], vec![2.0; 2], vec![1.0, 0.0]).unwrap();
        // Displacements along z: (0.6, 0.8) at vertex 0, the support, and (0.8, -0.6) at vertex 2.
        let vertex = |a: f32, b: f32| [0.0, 0.0, 0.0, 0.0, a, b];
        let shapes = [vertex(0.6, 0.8), vertex(0.0, 0.0), vertex(0.8, -0.6), vertex(0.0, 0.0)].concat();
        let all = ModeShapes { shapes, gains: vec![1.0, 2.0], ..one_mode().1 };
        let local = [[1e-6, 1e-6, -1e-6], [1e-6, 0.09999, -1e-6]][point];
        let hit = Impact {
            local,
            ..Impact::from_velocity(1.0, crate::modal::Body { mass: 0.1, restitution: 0.0 })
        };
        let grip = Support { id: 5, local: [1e-6, 1e-6, 0.0], coefficient: 20.0, mu: 0.0, release: 0.005 };
        let mut force = vec![0.0; FS as usize];
        force[FS as usize / 10] = FS as f32;
        let p = ModalBankParams {
            output: BankOutput::Displacement,
            reference: Reference::Absolute,
            cull: -300.0,
            coupling,
            ..params()
        };
        let standalone = Standalone::new::<ModalBankNode>(p)
            .also(ModalBankPorts::forces, Rate::hz(FS), Channels(1), force)
            .value(ModalBankPorts::modes, modes)
            .feed(ModalBankPorts::shapes.index(), Feed::value(AnyValue::new(all)))
            .feed(ModalBankPorts::positions.index(), Feed::events(vec![(ticks(0.1), hit)], ticks(1.0)))
            .feed(ModalBankPorts::supports.index(), Feed::events(vec![(0, grip)], ticks(1.0)));
        let sound = standalone.window(ticks(0.013)).run().unwrap().stream(ModalBankPorts::audio);
        (amplitude(&sound, 0.2) / amplitude(&sound, 0.3)).ln() / 0.1
    };
    // G = 20 for the combination that moves at the support: half of it is 10.
    for (coupling, point, expected) in [(SupportCoupling::Full, 0, 12.0), (SupportCoupling::Full, 1, 2.0)] {
        let found = pair(coupling, point);
        assert!((found / expected - 1.0).abs() < 0.02, "{coupling:?} {point}: {found} for {expected}");
    }
    // Each by itself: both decay faster than the combination, and their sum is no exponential.
    let found = pair(SupportCoupling::Diagonal, 1);
    assert!((found - 2.0).abs() > 0.5, "{found}");
}

#[test]
fn the_fourier_form_follows_positions_and_supports_as_the_time_form_does() {
    let body = crate::modal::Body { mass: 0.1, restitution: 0.0 };
    let hit = |point: u32, local: [f32; 3]| Impact { point, local, ..Impact::from_velocity(1.0, body) };
    let positions =
        vec![(ticks(0.1), hit(0, [0.0, 0.0999, -1e-6])), (ticks(0.2), hit(1, [1e-6, 1e-6, -1e-6]))];
    let grip = Support { id: 5, local: [1e-6, 1e-6, 0.0], coefficient: 20.0, mu: 0.5, release: 0.005 };
    let supports = vec![(ticks(0.5), grip), (ticks(0.8), Support { coefficient: 0.0, ..grip })];
    let run = |form, window| struck_in(form, positions.clone(), supports.clone(), window);
    let right = run(BankForm::Time, ticks(0.02));
    let found = run(BankForm::Fourier, ticks(0.02));
    let difference: Vec<f32> = found.iter().zip(&right).map(|(a, b)| a - b).collect();
    let second = FS as usize;
    for part in [0..second / 5, second / 5..second / 2, second / 2..second * 4 / 5, second * 4 / 5..second] {
        let error = 20.0 * (rms(&difference[part.clone()]) / rms(&right[part.clone()])).log10();
        println!("samples {part:?}: {error:.1} dB");
        assert!(error < -30.0 && error > -120.0, "{part:?}: {error} dB");
    }
    for window in [Rate::hz(FS).span(1), Rate::hz(FS).span(77), ticks(1.0)] {
        assert!(run(BankForm::Fourier, window) == found, "{window}");
    }
}

#[test]
fn coupled_modes_are_refused_in_the_fourier_form() {
    let with = |coupling, form| {
        let standalone = standalone(ModalBankParams { coupling, form, ..params() }, 100);
        standalone.shape().err().map(|found| (found.code, found.message))
    };
    let (code, message) = with(SupportCoupling::Full, BankForm::Fourier).unwrap();
    assert!(code == "F078" && message.contains("`coupling: Full`"), "{code} {message}");
    assert_eq!(with(SupportCoupling::Full, BankForm::Auto), None);
    assert_eq!(with(SupportCoupling::Diagonal, BankForm::Fourier), None);
}

#[test]
fn a_reload_from_one_form_to_the_other_is_a_rebuild() {
    let mut run = standalone(params(), 1000).start().unwrap();
    let edit = ModalBankParams { form: BankForm::Fourier, ..params() };
    assert_eq!(run.node().retune(&edit), Retune::Rebuild);
}
