use super::*;
use crate::core::item::{AnyValue, Event};
use crate::core::standalone::{Feed, Standalone};
use crate::core::time::{TICKS_PER_SECOND, ticks};
use crate::crumple::Weight;
use crate::crumple::matching::calibration::{EnergyMeter, Floor};
use crate::curvature::Method;

fn event(energy: f64) -> Crumple {
    Crumple { energy, ..Crumple::trial(&mut Rng::new(1)) }
}

fn calibration(energies: &[f64], floor: Floor) -> EnergyCalibration {
    let mut meter = EnergyMeter::default();
    energies.iter().for_each(|e| meter.add(&event(*e)).unwrap());
    meter.finish(10.0, floor)
}

fn defaults() -> HistogramMatcherParams {
    HistogramMatcherParams::read(&|_| None).unwrap()
}

fn standalone(p: HistogramMatcherParams, energies: &[f64], c: Option<EnergyCalibration>) -> Standalone {
    let events = energies.iter().enumerate().map(|(k, e)| (ticks(0.01 * k as f64), event(*e))).collect();
    let standalone = Standalone::new::<HistogramMatcher>(p)
        .events(HistogramMatcherPorts::events, events, ticks(0.01 * energies.len() as f64))
        .value(HistogramMatcherPorts::bank, CrumpleBank::testing(&[0.1, 0.2, 0.4, 0.8, 1.6]));
    match c {
        Some(c) => standalone.feed(2, Feed::value(AnyValue::new(c))),
        None => standalone,
    }
}

fn samples(standalone: &Standalone) -> Vec<u32> {
    let run = standalone.run().unwrap();
    run.events(HistogramMatcherPorts::matched).into_iter().map(|(_, m)| m.sample).collect()
}

#[test]
fn strong_events_get_strong_samples_and_weak_ones_none() {
    let c = calibration(&[1.0, 2.0, 3.0, 4.0, 5.0, 60.0], Floor::Absolute(2.0));
    let run = standalone(defaults(), &[2.0, 4.0, 1.0, 60.0, 999.0, 3.0], Some(c));
    assert_eq!(samples(&run), [0, 2, 4, 4, 1]);
    let summary = run.run().unwrap().summary;
    assert_eq!(summary.iter().map(|(_, v)| v.as_u64().unwrap()).collect::<Vec<_>>(), [5, 1, 1]);
}

#[test]
fn a_missing_calibration_or_one_of_another_weight_is_refused() {
    let reject = standalone(defaults(), &[1.0], None).shape().unwrap_err();
    assert!(reject.code == "F106" && reject.field.as_deref() == Some("calibration"), "{reject}");
    let p = HistogramMatcherParams { max_rate: Some(3.0), ..defaults() };
    let c = calibration(&[1.0], Floor::Absolute(0.0));
    assert_eq!(standalone(p, &[1.0], Some(c)).shape().unwrap_err().field.as_deref(), Some("max_rate"));
    let mut meter = EnergyMeter::default();
    meter.add(&Crumple { weight: Weight::None, ..event(1.0) }).unwrap();
    let other = meter.finish(1.0, Floor::Absolute(0.0));
    let fault = standalone(defaults(), &[1.0], Some(other)).run().err().unwrap();
    assert!(fault.message.contains("`weight`") && fault.time == Some(0), "{fault}");
    let c = calibration(&[1.0], Floor::Absolute(0.0));
    assert!(standalone(defaults(), &[f64::NAN], Some(c)).run().err().unwrap().message.contains("NaN"));
}

#[test]
fn a_calibration_of_another_mesh_rate_method_or_dead_band_is_used_with_a_warning() {
    let warnings = |c: EnergyCalibration, adapt: bool| {
        let p = HistogramMatcherParams { adapt, ..defaults() };
        let run = standalone(p, &[1.0, 2.0], Some(c)).run().unwrap();
        let found = run.summary.iter().filter(|(key, _)| *key == "warning");
        found.map(|(_, text)| text.to_string()).collect::<Vec<_>>()
    };
    let of = |event: Crumple| {
        let mut meter = EnergyMeter::default();
        meter.add(&event).unwrap();
        meter.finish(1.0, Floor::Absolute(0.0))
    };
    assert_eq!(warnings(of(event(1.0)), false), Vec::<String>::new());
    let mesh = of(Crumple { mesh: 99, ..event(1.0) });
    let found = warnings(mesh.clone(), false);
    assert!(
        found.len() == 1 && found[0].contains("`mesh` of the calibration is 99, of the events 7"),
        "{found:?}"
    );
    let slow = of(Crumple { interval: TICKS_PER_SECOND / 20, ..event(1.0) });
    let found = warnings(slow, false);
    assert!(found.len() == 1 && found[0].contains("`fps` of the calibration is"), "{found:?}");
    let dihedral = of(Crumple { method: Some(Method::Dihedral), ..event(1.0) });
    let found = warnings(dihedral, false);
    let wanted = "`method` of the calibration is Dihedral, of the events Cotan";
    assert!(found.len() == 1 && found[0].contains(wanted), "{found:?}");
    let wide = of(Crumple { h_eps: 0.5, ..event(1.0) });
    let found = warnings(wide, false);
    assert!(
        found.len() == 1 && found[0].contains("`h_eps` of the calibration is 0.5, of the events 0.4"),
        "{found:?}"
    );
    let near = of(Crumple { h_eps: 0.42, ..event(1.0) });
    let old = EnergyCalibration { method: None, h_eps: None, ..mesh.clone() };
    for silent in [near, EnergyCalibration { mesh: 7, ..old }.sealed()] {
        assert_eq!(warnings(silent, false), Vec::<String>::new());
    }
    assert_eq!(warnings(mesh, true), Vec::<String>::new(), "it is only the initial distribution");
}

#[test]
fn without_calibration_ranks_are_those_among_earlier_events() {
    let p = HistogramMatcherParams { adapt: true, ..defaults() };
    let energies: Vec<f64> = (0..200).map(|k| f64::from((k * 37) % 101) + 1.0).collect();
    let found = samples(&standalone(p.clone(), &energies, None));
    let late: Vec<(f64, u32)> = energies.iter().copied().zip(found).skip(100).collect();
    assert!(late.iter().all(|(e, s)| (*e > 90.0) <= (*s >= 3) && (*e < 10.0) <= (*s <= 1)), "{late:?}");
    // A motion a thousand times as strong is matched equally once the seed has decayed.
    let seed = calibration(&[0.001, 0.002], Floor::Absolute(0.0));
    let adapted =
        samples(&standalone(HistogramMatcherParams { half_life: 0.1, ..p.clone() }, &energies, Some(seed)));
    assert!(adapted.iter().skip(120).any(|s| *s < 2));
    // A maximum rate drops the weakest.
    let p = HistogramMatcherParams { max_rate: Some(20.0), ..p };
    let run = standalone(p, &energies, None).run().unwrap();
    let matched = run.events(HistogramMatcherPorts::matched);
    assert!((30..50).contains(&matched.len()), "{} in 2 s", matched.len());
    assert!(matched.iter().skip(10).all(|(_, m)| m.energy > 70.0));
}

#[test]
fn dropped_events_are_in_no_distribution() {
    let strong: Vec<f64> = (0..60).map(|k| 10.0 + f64::from(k * 37 % 61)).collect();
    // Three weak events before each strong one, which has the same time in both streams.
    let at = |k: usize, j: usize| ticks(0.04 * k as f64 + 0.01 * j as f64);
    let mixed: Vec<(Tick, Crumple)> = strong
        .iter()
        .enumerate()
        .flat_map(|(k, e)| {
            let weak = (0..3).map(move |j| (at(k, j), event(0.5 + 3.0 * j as f64)));
            weak.chain([(at(k, 3), event(*e))])
        })
        .collect();
    let alone: Vec<(Tick, Crumple)> = mixed.iter().filter(|(_, e)| e.energy >= 10.0).copied().collect();
    let matched = |p: &HistogramMatcherParams, events: &[(Tick, Crumple)], c: EnergyCalibration| {
        let run = Standalone::new::<HistogramMatcher>(p.clone())
            .events(HistogramMatcherPorts::events, events.to_vec(), at(60, 0))
            .value(HistogramMatcherPorts::bank, CrumpleBank::testing(&[0.1, 0.2, 0.4, 0.8, 1.6]))
            .feed(2, Feed::value(AnyValue::new(c)));
        let found = run.run().unwrap().events(HistogramMatcherPorts::matched);
        found.into_iter().map(|(tick, m)| (tick, m.sample, m.wanted, m.energy)).collect::<Vec<_>>()
    };
    let of = |events: &[(Tick, Crumple)], floor| {
        let energies: Vec<f64> = events.iter().map(|(_, e)| e.energy).collect();
        calibration(&energies, floor)
    };
    let floors = [Floor::Absolute(10.0), Floor::Percentile(75.0), Floor::Rate(6.0)];
    for p in [defaults(), HistogramMatcherParams { adapt: true, half_life: 1.0, ..defaults() }] {
        let wanted = matched(&p, &alone, of(&alone, Floor::Absolute(10.0)));
        let samples: Vec<usize> = (0..5).map(|k| wanted.iter().filter(|m| m.1 == k).count()).collect();
        assert!(wanted.len() == 60 && samples.iter().all(|n| *n >= 4), "{samples:?}");
        for floor in floors {
            let c = of(&mixed, floor);
            assert_eq!(matched(&p, &mixed, c), wanted, "{floor:?}, adapt {}", p.adapt);
        }
        // With the weak events in the calibration, all audible ones would be strong.
        let other = matched(&p, &alone, of(&mixed, Floor::Absolute(0.0)));
        assert!(p.adapt || other.iter().all(|m| m.1 >= 3), "{other:?}");
    }
}

#[test]
fn events_below_the_maximum_rate_use_all_samples() {
    // Of 100 events per second 20 are not dropped: the weakest of them get the weakest samples.
    let mut rng = Rng::new(8);
    let energies: Vec<f64> = (0..2000).map(|_| 10_f64.powf(rng.between(-4.0, 4.0))).collect();
    let p = HistogramMatcherParams { adapt: true, max_rate: Some(20.0), half_life: 5.0, ..defaults() };
    let found = samples(&standalone(p, &energies, None));
    let late = &found[found.len() / 2..];
    let counts: Vec<usize> = (0..5).map(|k| late.iter().filter(|s| **s == k).count()).collect();
    let even = late.len() as f64 / 5.0;
    assert!(counts.iter().all(|n| (*n as f64 / even - 1.0).abs() < 0.5), "{counts:?}");
}

#[test]
fn after_a_calibration_without_events_all_events_get_the_middle_sample() {
    let none = EnergyMeter::default().finish(2.0, Floor::Rate(5.0));
    assert_eq!(samples(&standalone(defaults(), &[7.0], Some(none))), [2]);
}
