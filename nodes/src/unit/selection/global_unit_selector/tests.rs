//! Both global selectors as nodes: windows, channels, ends, and rejected inputs.

use super::*;
use crate::core::item::{AnyValue, Channels, StreamShape};
use crate::core::node::NodeType;
use crate::core::params::Text;
use crate::core::shape::{LinkShape, RawShape};
use crate::core::standalone::Standalone;
use crate::core::time::{Rate, ticks};
use crate::feature::{FeatureConventions, FeatureFormat};
use crate::unit::global::exact;
use crate::unit::selection::global::PathCostParams;
use crate::unit::selection::online_unit_selector::{
    OnlineUnitSelector, OnlineUnitSelectorParams, OnlineUnitSelectorPorts,
};
use crate::unit::{Segment, UnitSource};

const RATE: Rate = Rate::hz(240);
const UNITS: usize = 90;
const DIMS: usize = 3;

/// A random walk, `[units, dims]`.
fn walk(seed: u64, units: usize, dims: usize) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut at = vec![0.0; dims];
    let mut out = Vec::new();
    for _ in 0..units {
        for x in &mut at {
            *x = 0.9 * *x + rng.between(-1.0, 1.0);
            out.push(*x as f32);
        }
    }
    out
}

/// Two recordings, of cotton and of silk, with `joined` channels a unit.
fn database(joined: u32) -> UnitDatabase {
    let conventions = FeatureConventions { joined, ..FeatureConventions::trial() };
    let features = walk(9, UNITS, conventions.dims());
    let segment = |source, start| Segment { start, units: 45, source, ..Segment::default() };
    let source = |tag: &str| UnitSource { tag: tag.into(), ..UnitSource::default() };
    let db = UnitDatabase {
        version: crate::unit::database::DATABASE_VERSION,
        floor_energy: 1e-10,
        segments: vec![segment(0, 0), segment(1, 45)],
        sources: vec![source("cotton"), source("silk")],
        audio: walk(4, UNITS * (conventions.unit * joined) as usize, 1),
        unfiltered: features.clone(),
        features,
        conventions,
    };
    db.validate().unwrap();
    db
}

fn format(db: &UnitDatabase, vectors: usize) -> FeatureFormat {
    FeatureFormat { vectors, conventions: Arc::new(db.conventions.clone()) }
}

fn global(method: Method) -> GlobalUnitSelectorParams {
    let p = GlobalUnitSelectorParams::read(&|_| None).unwrap();
    GlobalUnitSelectorParams {
        method,
        candidates: 16,
        cost: PathCostParams { cool_off: 7, loop_guard: 0.0, ..p.cost },
        ..p
    }
}

fn online(lag: f64) -> OnlineUnitSelectorParams {
    OnlineUnitSelectorParams {
        lag,
        cost: PathCostParams {
            cool_off: 7,
            loop_guard: 0.0,
            ..OnlineUnitSelectorParams::read(&|_| None).unwrap().cost
        },
        ..OnlineUnitSelectorParams::read(&|_| None).unwrap()
    }
}

fn of_global(
    p: &GlobalUnitSelectorParams,
    db: &UnitDatabase,
    vectors: usize,
    features: &[f32],
) -> Standalone {
    type Port = GlobalUnitSelectorPorts;
    Standalone::new::<GlobalUnitSelector>(p.clone())
        .input(Port::features, RATE, format(db, vectors), features.to_vec())
        .value(Port::database, db.clone())
}

fn of_online(
    p: &OnlineUnitSelectorParams,
    db: &UnitDatabase,
    vectors: usize,
    features: &[f32],
) -> Standalone {
    type Port = OnlineUnitSelectorPorts;
    Standalone::new::<OnlineUnitSelector>(p.clone())
        .input(Port::features, RATE, format(db, vectors), features.to_vec())
        .value(Port::database, db.clone())
}

fn picks(standalone: Standalone) -> Vec<Pick> {
    standalone.run().unwrap().stream(GlobalUnitSelectorPorts::picks)
}

fn chosen(picks: &[Pick]) -> Vec<i32> {
    picks.iter().map(|pick| pick.unit).collect()
}

/// Vectors of several channels, one after the other for each unit.
fn woven(channels: &[Vec<f32>]) -> Vec<f32> {
    let units = channels[0].len() / DIMS;
    let unit = |k: usize| channels.iter().flat_map(move |c| c[k * DIMS..(k + 1) * DIMS].to_vec());
    (0..units).flat_map(unit).collect()
}

const METHODS: [Method; 3] = [Method::Exact, Method::Beam, Method::FixedLag];

#[test]
fn windows_of_any_size_give_the_same_picks() {
    let (db, target) = (database(1), woven(&[walk(1, 61, DIMS), walk(2, 61, DIMS)]));
    for window in [RATE.span(1), RATE.span(7), ticks(0.0111), ticks(3.0)] {
        for method in METHODS {
            let all = picks(of_global(&global(method), &db, 2, &target));
            let parts = picks(of_global(&global(method), &db, 2, &target).window(window));
            assert!(all.len() == 122 && parts == all, "{method:?}, windows of {window}");
        }
        for lag in [0.0, 0.05, 9.0] {
            let all = picks(of_online(&online(lag), &db, 2, &target));
            let parts = picks(of_online(&online(lag), &db, 2, &target).window(window));
            assert!(all.len() == 122 && parts == all, "lag {lag}, windows of {window}");
        }
    }
}

#[test]
fn the_node_gives_the_path_that_the_search_finds() {
    let (db, target) = (database(1), walk(3, 70, DIMS));
    let p = GlobalUnitSelectorParams {
        cost: PathCostParams { cool_off: 0, ..global(Method::Exact).cost },
        ..global(Method::Exact)
    };
    let set = units(&format(&db, 1), &db, &[]).unwrap();
    let table = Table::new(&set).unwrap();
    let path = p.cost.global(240.0);
    let wanted = exact(&table, &target, &path, None).unwrap();
    let found = picks(of_global(&p, &db, 1, &target));
    let units: Vec<u32> = found.iter().map(|pick| pick.unit as u32).collect();
    assert_eq!(units, wanted.units);
    assert!(found.iter().any(|pick| pick.fallback) && found.iter().any(|pick| !pick.fallback));
    assert!(found.iter().all(|pick| pick.fallback == (f64::from(pick.d1) > p.cost.d_max)));
    // A choice after the end of the take is as good as one that reads it first; one unit later it has read less.
    let free =
        OnlineUnitSelectorParams { cost: PathCostParams { cool_off: 0, ..online(1.0).cost }, ..online(1.0) };
    assert_eq!(chosen(&picks(of_online(&free, &db, 1, &target))), chosen(&found));
    let hasty = OnlineUnitSelectorParams { lag: 0.0, ..free };
    assert_ne!(chosen(&picks(of_online(&hasty, &db, 1, &target))), chosen(&found));
}

#[test]
fn independent_channels_are_chosen_for_as_if_each_were_alone() {
    let db = database(1);
    let channels = [walk(1, 50, DIMS), walk(2, 50, DIMS), walk(1, 50, DIMS)];
    let apart = |all: &[Pick], channel: usize| -> Vec<Pick> {
        all.iter().skip(channel).step_by(3).copied().collect()
    };
    for method in METHODS {
        let all = picks(of_global(&global(method), &db, 3, &woven(&channels)));
        for (k, channel) in channels.iter().enumerate() {
            assert!(apart(&all, k) == picks(of_global(&global(method), &db, 1, channel)), "{method:?} {k}");
        }
        assert!(apart(&all, 0) == apart(&all, 2) && apart(&all, 0) != apart(&all, 1));
    }
    let all = picks(of_online(&online(0.05), &db, 3, &woven(&channels)));
    for (k, channel) in channels.iter().enumerate() {
        assert!(apart(&all, k) == picks(of_online(&online(0.05), &db, 1, channel)), "{k}");
    }
}

#[test]
fn joint_channels_have_one_pick_for_both_and_shared_ones_as_well() {
    let db = database(2);
    let target = walk(5, 40, 2 * DIMS);
    let widths = |shape: crate::core::shape::NodeShape| shape.outputs[0].as_ref().map(|s| s.width);
    for method in METHODS {
        let standalone = of_global(&global(method), &db, 1, &target);
        assert_eq!(widths(standalone.shape().unwrap()), Some(1));
        let found = picks(standalone);
        assert!(found.len() == 40 && found.iter().all(|p| (0..90).contains(&p.unit)), "{method:?}");
        // Both channels count: the second one alone results in another choice.
        let mut other = target.clone();
        other.chunks_mut(2 * DIMS).for_each(|unit| unit[DIMS..].iter_mut().for_each(|x| *x = -*x));
        assert!(picks(of_global(&global(method), &db, 1, &other)) != found, "{method:?}");
    }
    assert_eq!(picks(of_online(&online(0.05), &db, 1, &target)).len(), 40);
    // SharedMid: one vector of the middle, in a database of one channel.
    let mono = database(1);
    let middle = of_global(&global(Method::Exact), &mono, 1, &walk(5, 40, DIMS));
    assert_eq!(widths(middle.shape().unwrap()), Some(1));
    // Joint features meet no database of single channels.
    let format = format(&db, 1);
    let standalone = Standalone::new::<GlobalUnitSelector>(global(Method::Exact))
        .input(GlobalUnitSelectorPorts::features, RATE, format, target)
        .value(GlobalUnitSelectorPorts::database, mono);
    assert!(
        standalone.shape().unwrap_err().message.contains("joined"),
        "{}",
        standalone.shape().unwrap_err()
    );
}

#[test]
fn targets_of_no_unit_and_of_one_are_chosen_for() {
    let db = database(1);
    for vectors in [1, 2] {
        for method in METHODS {
            assert_eq!(picks(of_global(&global(method), &db, vectors, &[])), []);
            let one = picks(of_global(&global(method), &db, vectors, &walk(6, vectors, DIMS)));
            assert_eq!(one.len(), vectors, "{method:?}");
        }
        assert_eq!(picks(of_online(&online(0.05), &db, vectors, &[])), []);
        // Shorter than the lag.
        assert_eq!(picks(of_online(&online(0.05), &db, vectors, &walk(6, vectors, DIMS))).len(), vectors);
    }
    // The nearest of all is the only choice for one unit.
    let target = walk(6, 1, DIMS);
    let far = |unit: usize| {
        db.feature(unit).iter().zip(&target).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
    };
    let nearest = (0..UNITS).min_by(|a, b| far(*a).total_cmp(&far(*b))).unwrap() as i32;
    assert_eq!(chosen(&picks(of_global(&global(Method::Exact), &db, 1, &target))), [nearest]);
    assert_eq!(chosen(&picks(of_online(&online(0.05), &db, 1, &target))), [nearest]);
}

#[test]
fn only_recordings_of_a_tag_are_chosen_from_by_every_method() {
    let (db, target) = (database(1), walk(7, 60, DIMS));
    for tags in [vec![Text::from("silk")], vec![Text::from("silk"), Text::from("wool")]] {
        for method in METHODS {
            let p = GlobalUnitSelectorParams {
                cost: PathCostParams { tags: tags.clone(), ..global(method).cost },
                ..global(method)
            };
            assert!(picks(of_global(&p, &db, 1, &target)).iter().all(|p| p.unit >= 45), "{method:?}");
        }
        let p =
            OnlineUnitSelectorParams { cost: PathCostParams { tags, ..online(0.05).cost }, ..online(0.05) };
        assert!(picks(of_online(&p, &db, 1, &target)).iter().all(|p| p.unit >= 45));
    }
    let p = GlobalUnitSelectorParams {
        cost: PathCostParams { tags: vec!["wool".into()], ..global(Method::Exact).cost },
        ..global(Method::Exact)
    };
    let reject = of_global(&p, &db, 1, &target).shape().unwrap_err();
    assert_eq!((reject.code, reject.field.as_deref()), ("F101", Some("tags")));
    let p = OnlineUnitSelectorParams {
        cost: PathCostParams { tags: vec!["wool".into()], ..online(0.05).cost },
        ..online(0.05)
    };
    assert_eq!(of_online(&p, &db, 1, &target).shape().unwrap_err().code, "F101");
}

#[test]
fn a_target_without_end_is_for_the_one_that_decides_online() {
    let db = database(1);
    let links = [
        vec![LinkShape::Stream(StreamShape::new::<Features>(RATE, format(&db, 1), None))],
        vec![LinkShape::Value(Some(AnyValue::new(db)))],
        Vec::new(),
    ];
    let files = MemoryFiles::default();
    let ty = NodeType::of::<GlobalUnitSelector>("");
    let reject = ty.shape(&global(Method::Exact), RawShape::new(&links, 1, &files)).unwrap_err().remove(0);
    assert_eq!((reject.code, reject.field.as_deref()), ("F075", Some("features")));
    assert!(reject.help.is_some_and(|help| help.contains("OnlineUnitSelector")));
    assert_eq!(GlobalUnitSelector::CLASS, Class::Offline);
    let ty = NodeType::of::<OnlineUnitSelector>("");
    let shape = ty.shape(&online(0.05), RawShape::new(&links, 1, &files)).unwrap();
    assert_eq!((shape.lookaround[0].behind, shape.lookaround[0].ahead, shape.end), (0, 12, None));
    assert_eq!(OnlineUnitSelector::CLASS, Class::Worker);
}

#[test]
fn a_number_that_is_not_finite_is_reported_with_its_unit() {
    let db = database(1);
    let mut target = walk(8, 30, DIMS);
    target[DIMS * 17 + 1] = f32::NAN;
    let global = METHODS.map(|method| of_global(&global(method), &db, 1, &target));
    // First seen zero, twelve and all units ahead.
    let online = [0.0, 0.05, 9.0].map(|lag| of_online(&online(lag), &db, 1, &target));
    for standalone in global.into_iter().chain(online) {
        let fault = standalone.run().map(|_| ()).unwrap_err();
        assert!(fault.code == "F102" && fault.message.contains("unit 17 of"), "{fault}");
    }
    // Units before it that were skipped in silence are counted as well.
    let (sound, skipped) = skipped_target(&db);
    let mut target = walk(5, 360, DIMS);
    target[DIMS * (skipped.end + 3)] = f32::NAN;
    let audio = RATE.times(u64::from(db.conventions.unit)).unwrap();
    let port = OnlineUnitSelectorPorts::target;
    let standalone = of_online(&self::online(0.5), &db, 1, &target).optional(port, audio, Channels(1), sound);
    let fault = standalone.run().map(|_| ()).unwrap_err();
    assert!(fault.message.contains(&format!("unit {} of", skipped.end + 3)), "{fault}");
}

/// A target that is silent from its 60th unit to its 300th, of 360, and the units that are skipped for it.
fn skipped_target(db: &UnitDatabase) -> (Vec<f32>, std::ops::Range<usize>) {
    let unit = db.unit();
    let sample = |k: usize| if (60 * unit..300 * unit).contains(&k) { 1e-6 } else { 0.1 };
    // Asleep from 0.55 s and two units after the last sound on.
    ((0..360 * unit).map(sample).collect(), 60 + 134..300)
}

#[test]
fn silence_of_the_target_is_slept_through_and_the_path_leads_on_from_where_it_was() {
    let (db, features) = (database(1), walk(5, 360, DIMS));
    let (target, skipped) = skipped_target(&db);
    let audio = RATE.times(u64::from(db.conventions.unit)).unwrap();
    let awake = [&features[..skipped.start * DIMS], &features[skipped.end * DIMS..]].concat();
    for method in [Method::Exact, Method::Beam] {
        let with = |p: &GlobalUnitSelectorParams| {
            let port = GlobalUnitSelectorPorts::target;
            of_global(p, &db, 1, &features).optional(port, audio, Channels(1), target.clone())
        };
        let found = picks(with(&global(method)));
        let frozen = found[skipped.start - 1].unit;
        assert!(found[skipped.clone()].iter().all(|p| p.unit == frozen && p.d1 == 0.0), "{method:?}");
        let alone = picks(of_global(&global(method), &db, 1, &awake));
        let rest: Vec<Pick> = [&found[..skipped.start], &found[skipped.end..]].concat();
        assert!(rest == alone, "{method:?}: as if there were no silence");
        for window in [RATE.span(3), ticks(0.0173)] {
            assert!(picks(with(&global(method)).window(window)) == found, "{method:?}, windows of {window}");
        }
        let run = with(&global(method)).run().unwrap();
        let share = run.summary.iter().find(|(name, _)| *name == "asleep_share").unwrap().1.as_f64();
        assert_eq!(share, Some(skipped.len() as f64 / 360.0));
        let keep = GlobalUnitSelectorParams { keep_room_tone: Some(true), ..global(method) };
        assert!(
            picks(with(&keep)) == picks(of_global(&keep, &db, 1, &features)),
            "{method:?}: awake all the time"
        );
    }
}

#[test]
fn what_decides_online_sleeps_as_well_and_looks_at_nothing_that_is_slept_through() {
    let (db, features) = (database(1), walk(5, 360, DIMS));
    let (target, skipped) = skipped_target(&db);
    let audio = RATE.times(u64::from(db.conventions.unit)).unwrap();
    let with = |lag| {
        let port = OnlineUnitSelectorPorts::target;
        of_online(&online(lag), &db, 1, &features).optional(port, audio, Channels(1), target.clone())
    };
    for lag in [0.0, 0.05] {
        let found = picks(with(lag));
        let units = (lag * 240.0).round() as usize;
        let table = Table::new(&self::units(&format(&db, 1), &db, &[]).unwrap()).unwrap();
        let path = online(lag).cost.global(240.0);
        let mut choice = FixedLag::new(table, path, units);
        for at in (0..360).filter(|at| !skipped.contains(at)) {
            let known = (at..=(at + units).min(359)).filter(|k| !skipped.contains(k));
            let window: Vec<f32> = known.flat_map(|k| features[k * DIMS..(k + 1) * DIMS].to_vec()).collect();
            assert_eq!(found[at].unit, choice.choose(&window).unwrap().unit as i32, "{lag} {at}");
        }
        let frozen = found[skipped.start - 1].unit;
        assert!(found[skipped.clone()].iter().all(|p| p.unit == frozen && p.d1 == 0.0));
        for window in [RATE.span(1), ticks(0.0173), ticks(9.0)] {
            assert!(picks(with(lag).window(window)) == found, "{lag}, windows of {window}");
        }
    }
    let port = OnlineUnitSelectorPorts::target;
    let other =
        of_online(&online(0.0), &db, 1, &features).optional(port, Rate::hz(44_100), Channels(1), target);
    assert!(other.shape().is_err(), "a target of another rate");
}

#[test]
fn the_report_states_how_often_a_fixed_lag_departs_from_the_best_path() {
    let (db, target) = (database(1), walk(3, 70, DIMS));
    let differs = |method: Method, lag: f64, cool_off: usize| {
        let p = GlobalUnitSelectorParams {
            lag,
            cost: PathCostParams { cool_off, ..global(method).cost },
            ..global(method)
        };
        let run = of_global(&p, &db, 1, &target).run().unwrap();
        let reported = run.summary.iter().find(|(name, _)| *name == "differs").and_then(|(_, x)| x.as_f64());
        (reported, chosen(&run.stream(GlobalUnitSelectorPorts::picks)))
    };
    for cool_off in [0, 7] {
        let (none, best) = differs(Method::Exact, 0.0, cool_off);
        assert_eq!(none, None);
        for lag in [0.0, 0.0125, 0.05, 1.0] {
            let (reported, found) = differs(Method::FixedLag, lag, cool_off);
            let others = found.iter().zip(&best).filter(|(a, b)| a != b).count() as f64 / 70.0;
            assert_eq!(reported, Some(others), "lag {lag}");
            // One known unit is less than the path needs; all of them are all that it needs.
            assert!(others > 0.0 || lag > 0.0, "{cool_off}");
            assert!(others == 0.0 || lag < 1.0 || cool_off > 0, "{cool_off}");
        }
    }
}
