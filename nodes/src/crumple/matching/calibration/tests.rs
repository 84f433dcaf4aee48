use super::*;
use crate::core::item::Event;

fn meter(energies: &[f64]) -> EnergyMeter {
    let mut rng = Rng::new(1);
    let mut meter = EnergyMeter::default();
    for &energy in energies {
        meter.add(&Crumple { energy, interval: 11_760_000, ..Crumple::trial(&mut rng) }).unwrap();
    }
    meter
}

#[test]
fn floors_are_an_energy_a_percentile_or_a_rate() {
    let energies: Vec<f64> = (0..100).map(|k| f64::from((k * 37) % 100)).collect();
    let of = |floor| {
        let c = meter(&energies).finish(10.0, floor);
        c.validate().unwrap();
        (c.e_min, c.events, c.dropped)
    };
    assert_eq!(of(Floor::Absolute(30.0)), (30.0, 70, 30));
    assert_eq!(of(Floor::Percentile(90.0)), (89.5, 10, 90));
    assert_eq!(of(Floor::Rate(2.0)), (80.0, 20, 80));
    assert_eq!(of(Floor::Rate(20.0)), (0.0, 100, 0));
    let c = meter(&energies).finish(10.0, Floor::Rate(2.0));
    assert_eq!((c.rate, c.fps, c.energies.len()), (2.0, 60.0, 20));
    assert!(c.plot().unwrap().contains("20 events in 10.0 s"));
}

#[test]
fn many_energies_become_quantiles_and_a_take_without_events_has_a_calibration() {
    let energies: Vec<f64> = (0..10_240).map(f64::from).collect();
    let c = meter(&energies).finish(1.0, Floor::Absolute(0.0));
    assert_eq!((c.energies.len(), c.events), (1024, 10_240));
    assert!((c.energies[512] - 5124.5).abs() < 1e-9, "{}", c.energies[512]);
    let none = EnergyMeter::default().finish(3.0, Floor::Percentile(50.0));
    none.validate().unwrap();
    assert_eq!((none.events, none.weight, none.plot()), (0, None, None));
}

#[test]
fn wrong_fields_are_named() {
    let good = meter(&[1.0, 2.0]).finish(1.0, Floor::Absolute(0.5));
    let error = |c: EnergyCalibration| c.validate().unwrap_err().to_string();
    assert!(error(EnergyCalibration { version: 9, ..good.clone() }).contains("`version` is 9"));
    assert!(error(EnergyCalibration { fps: 30.0, ..good.clone() }).contains("`conventions`"));
    assert!(error(EnergyCalibration { energies: vec![2.0, 1.0], ..good.clone() }).contains("energy 1 is 1"));
    assert!(error(EnergyCalibration { e_min: 1.5, ..good.clone() }).contains("energy 0 is 1"));
    assert!(error(EnergyCalibration { seconds: f64::NAN, ..good.clone() }).contains("`seconds`"));
    assert!(good.check_weight(Weight::None).unwrap_err().to_string().contains("`weight`"));
    assert!(good.check_weight(Weight::Area).is_ok());
}
