//! Tests of the contract of nodes, with random parameters and inputs.
//!
//! Every node of the registry is tested.

use crate::trial::{Level, Trial, accepted, is_audio, possible};
use foley_nodes::core::node::{Class, NodeType};
use foley_nodes::core::params::{Bounds, Datum, ParamKind, ParamSpec};
use foley_nodes::core::ports::{Arity, PortKind, PortSpec};
use foley_nodes::core::random::Rng;
use foley_nodes::core::shape::NodeShape;
use foley_nodes::core::standalone::StandaloneRun;
use foley_nodes::core::time::{Rate, Tick};
use foley_nodes::registry::all;
use std::collections::{BTreeMap, HashSet};

/// Returns the number of accepted trials of a node; fewer for a node that computes a value once, without windows.
fn trials(node: usize) -> usize {
    if all()[node].eval.is_some() { 4 } else { 12 }
}

/// Runs `test` on the accepted trials of every node.
fn each_trial(level: Level, test: impl FnMut(&Trial)) {
    each_trial_of(|_| true, level, test);
}

/// Runs `test` on the accepted trials of every node of some types.
fn each_trial_of(is_tested: impl Fn(&NodeType) -> bool, level: Level, mut test: impl FnMut(&Trial)) {
    for (node, ty) in all().iter().enumerate() {
        if is_tested(ty) {
            accepted(node, level, trials(node)).iter().for_each(&mut test);
        }
    }
}

/// Returns true for a node that runs window by window, and does not compute values once.
fn has_windows(ty: &NodeType) -> bool {
    ty.eval.is_none()
}

fn plays(ty: &NodeType) -> bool {
    ty.class != Class::Offline
}

fn reads_streams(ty: &NodeType) -> bool {
    ty.inputs.iter().any(|port| matches!(port.kind, PortKind::Stream(_)))
}

#[test]
fn windows_of_any_length_give_the_same_bits() {
    each_trial(Level::Random, |trial| {
        let expected = trial.run(trial.whole_window()).bits();
        let items = trial.fastest_rate();
        // A value is computed once, without windows: one more window length is enough.
        let lengths: &[usize] = if trial.ty().eval.is_some() { &[] } else { &[1, 7, 64, 1000] };
        for &n in lengths {
            let bits = trial.run(items.span(n)).bits();
            assert!(bits == expected, "windows of {n} items give other bits: {trial:?}");
        }
        // A window that is not an integer number of items.
        let bits = trial.run(items.span(7) + 12_345).bits();
        assert!(bits == expected, "windows of a fractional number of items give other bits: {trial:?}");
    });
}

/// A node that starts in the middle of a run fills all later items. A source makes the same items as from its start.
#[test]
fn a_node_can_begin_anywhere() {
    each_trial_of(plays, Level::Random, |trial| {
        let window = trial.fastest_rate().span(13);
        let full_run = trial.standalone(window).run().unwrap_or_else(|e| panic!("{e}: {trial:?}"));
        let shape = trial.shape().expect("an accepted trial has a shape");
        for part in [0.2, 0.7] {
            let mut standalone = trial.standalone(window);
            standalone.poison = true;
            standalone.begin = (trial.length() as f64 * part) as Tick;
            let run = standalone.run().unwrap_or_else(|e| panic!("{e}: {trial:?}"));
            for port in 0..trial.ty().outputs.len() {
                let (numbers, finite) = run.numbers(port);
                assert!(finite, "output {port} has unwritten items: {trial:?}");
                let (expected, _) = full_run.numbers(port);
                assert_eq!(numbers.len(), expected.len(), "output {port}: {trial:?}");
                let source = trial.ty().inputs.is_empty();
                if let Some(stream) = shape.outputs[port].as_ref().filter(|_| source) {
                    let width = numbers.len() / stream.rate.first_at(trial.length()).max(1) as usize;
                    let from = stream.rate.first_at(standalone.begin) as usize * width;
                    assert!(numbers[from..] == expected[from..], "output {port}: {trial:?}");
                }
            }
        }
    });
}

/// The saved state of a node determines the rest of its run, so another process can resume it.
#[test]
fn a_node_resumes_from_the_saved_state_of_another() {
    let mut wrong = std::collections::BTreeSet::new();
    each_trial_of(has_windows, Level::Random, |trial| {
        let window = trial.fastest_rate().span(13);
        let expected = trial.run(window).bits();
        let windows = (trial.length() / window) as usize;
        for cut in [1, windows / 3, windows * 4 / 5, windows + 2] {
            if trial.interrupted(window, cut).bits() != expected {
                wrong.insert(format!("{} after {cut} of {windows} windows", trial.ty().name));
            }
        }
    });
    assert!(wrong.is_empty(), "these give other bits after they are resumed: {wrong:#?}");
}

#[test]
fn all_output_items_are_written() {
    each_trial_of(has_windows, Level::Random, |trial| {
        for window in [trial.whole_window(), trial.fastest_rate().span(7)] {
            let mut standalone = trial.standalone(window);
            standalone.poison = true;
            let run = standalone.run().unwrap_or_else(|e| panic!("{e}: {trial:?}"));
            // Nodes that take blocks get them here, and not above.
            let blocks = trial.standalone(window).run().unwrap_or_else(|e| panic!("{e}: {trial:?}"));
            for port in 0..trial.ty().outputs.len() {
                let (numbers, finite) = run.numbers(port);
                assert!(finite, "output {port} has unwritten items: {trial:?}");
                assert!(numbers == blocks.numbers(port).0, "blocks give other numbers: {trial:?}");
            }
        }
    });
}

#[test]
fn outputs_stay_finite_whatever_the_level() {
    let test = |level: Level| {
        move |trial: &Trial| {
            let out = trial.run(trial.whole_window());
            assert!(out.finite, "{level:?} gives a number that is not finite: {trial:?}");
        }
    };
    each_trial(Level::Silence, test(Level::Silence));
    // Only streams have a level.
    for level in [Level::Constant, Level::FullScale, Level::Denormal] {
        each_trial_of(reads_streams, level, test(level));
    }
}

/// Nodes without counters whose inputs can be too short for their times, as those of trials often are: a run names them and their inputs.
const SHORT_INPUTS: [&str; 7] =
    ["AdditiveResynth", "Advance", "Crossfade", "Feedback", "Mfcc", "PoseCurve", "Trim"];

/// A node that gives nothing although something has arrived has a counter in its summary, or a parameter of 0, that says why.
#[test]
fn a_node_that_is_silent_says_why() {
    let mut silent = std::collections::BTreeMap::new();
    for node in 0..all().len() {
        let ty = all().swap_remove(node);
        let streams = |port: &PortSpec| matches!(port.kind, PortKind::Stream(_) | PortKind::Events(_));
        let flows = ty.inputs.iter().any(streams) && ty.outputs.iter().any(streams);
        if !flows || SHORT_INPUTS.contains(&ty.name) {
            continue;
        }
        for trial in possible(node, Level::Random).take(20) {
            let run = trial.standalone(trial.fastest_rate().span(13)).run();
            let run = run.unwrap_or_else(|e| panic!("{e}: {trial:?}"));
            if run.is_silent() && trial.has_input() && run.summary.is_empty() && !trial.has_zero() {
                silent.entry(ty.name).or_insert_with(|| format!("{trial:?}"));
            }
        }
    }
    assert!(silent.is_empty(), "these are silent without a word: {silent:#?}");
}

/// No number that a control can send fails a node or makes an output that is not finite, so none silences it for good.
#[test]
fn no_extreme_of_a_control_silences_a_node() {
    let mut wrong = std::collections::BTreeMap::new();
    for node in 0..all().len() {
        let ty = all().swap_remove(node);
        let control = |port: &PortSpec| matches!(port.kind, PortKind::Stream(item) if is_audio(item));
        if ty.class == Class::Offline || !ty.inputs.iter().any(control) {
            continue;
        }
        for trial in accepted(node, Level::Control, trials(node)) {
            let run = trial.standalone(trial.fastest_rate().span(13)).run();
            let finite = |run: &StandaloneRun| (0..ty.outputs.len()).all(|port| run.numbers(port).1);
            match run {
                Ok(run) if finite(&run) => {}
                Ok(_) => drop(wrong.insert(ty.name, format!("not finite: {trial:?}"))),
                Err(fault) => drop(wrong.insert(ty.name, format!("{fault}: {trial:?}"))),
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The output of a node depends on the seed if and only if its documentation has a section `# Randomness`.
#[test]
fn the_seed_decides_all_randomness() {
    for node in 0..all().len() {
        let mut differs = false;
        for mut trial in accepted(node, Level::Random, trials(node)) {
            let window = trial.whole_window();
            let first = trial.run(window).bits();
            assert!(trial.run(window).bits() == first, "two equal runs differ: {trial:?}");
            trial.seed += 1;
            differs |= trial.run(window).bits() != first;
        }
        let ty = &all()[node];
        let documented = ty.doc.contains("# Randomness");
        // Some parameters leave nothing to chance, so a few trials may not show it.
        let more = possible(node, Level::Random).skip(trials(node)).take(if documented { 50 } else { 0 });
        differs = differs
            || more.into_iter().any(|mut trial| {
                let window = trial.whole_window();
                let first = trial.run(window).bits();
                trial.seed += 1;
                trial.run(window).bits() != first
            });
        assert_eq!(differs, documented, "`{}`: does another seed give another output?", ty.name);
    }
}

/// Returns the distance of the item `item` of an input from the time of an output item, in items: 1 is the next item.
fn distance(trial: &Trial, shape: &NodeShape, port: usize, item: i64, tick: Tick) -> i64 {
    let rate = trial.input_rate(port).expect("a varied input is a stream");
    item - (rate.first_at(tick + shape.lag + 1) - 1)
}

/// Changes single items of the inputs and finds the earliest output that changes: with a declared look-ahead of `n` the distance must
/// be `n` items in some trial. (It cannot be larger: the engine allows no access to later items.)
#[test]
fn declared_look_ahead_is_needed() {
    for node in 0..all().len() {
        // For each input port with look-ahead: true if all of it was needed in some trial.
        let mut ports: BTreeMap<usize, bool> = BTreeMap::new();
        // Streams of compatible rates seldom need all of it, so trials continue until some do.
        for (k, trial) in possible(node, Level::Random).enumerate().take(20 * trials(node)) {
            if k >= trials(node) && ports.values().all(|needed| *needed) {
                break;
            }
            let shape = trial.shape().expect("an accepted trial has a shape");
            let base = trial.run(trial.whole_window());
            for port in 0..trial.ty().inputs.len() {
                let ahead = shape.lookaround[port].ahead as i64;
                // A node that reads a whole stream before its first item looks ahead by the length of the stream.
                let Some(items) = trial.input_items(port).filter(|&items| ahead > 0 && items != ahead) else {
                    continue;
                };
                let needed = ports.entry(port).or_default();
                let mut rng = Rng::new(trial.seed);
                for _ in 0..10 {
                    if *needed || items < ahead {
                        break;
                    }
                    let item = ahead as usize + rng.below((items - ahead) as usize);
                    let changed = trial.varied(port, item, &mut rng);
                    let Some(tick) = base.first_difference(&changed.run(changed.whole_window())) else {
                        continue;
                    };
                    let distance = distance(&trial, &shape, port, item as i64, tick);
                    assert!(distance <= ahead, "looks {distance} items ahead, declares {ahead}: {trial:?}");
                    *needed = distance == ahead;
                }
            }
        }
        for (port, needed) in ports {
            let ty = &all()[node];
            let input = ty.inputs[port].name;
            assert!(needed, "`{}` never needs all of the look-ahead that it declares on `{input}`", ty.name);
        }
    }
}

/// `FooBar` as `foo_bar`.
fn snake_case(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

#[test]
fn a_node_type_stands_in_the_file_of_its_name() {
    // Two families have not been put in order yet.
    for ty in all() {
        let (path, file) = (ty.source.path(), format!("/{}.rs", snake_case(ty.name)));
        assert!(path.starts_with("nodes/src/") && path.ends_with(&file), "`{}` stands in {path}", ty.name);
    }
}

#[test]
fn everything_is_documented() {
    let mut names = HashSet::new();
    for ty in all() {
        let name = ty.name;
        assert!(names.insert(name), "two nodes are called `{name}`");
        assert!(!ty.family.is_empty(), "`{name}` has no family");
        assert!(ty.summary().ends_with('.'), "`{name}` has no sentence for a summary");
        let mut ports = HashSet::new();
        for port in ty.inputs.iter().chain(ty.outputs) {
            assert!(port.doc.trim().ends_with('.'), "`{name}.{}` has no sentence for a doc", port.name);
            assert!(ports.insert(port.name), "`{name}` has two ports `{}`", port.name);
        }
        for spec in (ty.params)() {
            let param = spec.name;
            assert!(spec.doc.trim().ends_with('.'), "`{name}.{param}` has no sentence for a doc");
            if spec.kind.is_number() {
                assert!(spec.unit.is_some(), "`{name}.{param}` has no unit");
                assert!(spec.bounds.is_some(), "`{name}.{param}` has no range");
            }
            // A link replaces the parameter of its name; any other port of that name would be ambiguous.
            if let Some(port) = ty.inputs.iter().find(|port| port.name == param) {
                assert_eq!(
                    port.arity,
                    Arity::Optional,
                    "`{name}.{param}` is a parameter and a required input"
                );
            }
            assert!(!ty.outputs.iter().any(|port| port.name == param), "`{name}.{param}` is also an output");
        }
    }
}

type Given = BTreeMap<&'static str, Datum>;

fn read(ty: &NodeType, given: &Given) -> Result<Given, String> {
    let params = (ty.read)(&|name| given.get(name).cloned()).map_err(|e| format!("{e:?}"))?;
    Ok(params.write().into_iter().collect())
}

/// Returns the required parameters, or all parameters, with values from a trial.
fn given(ty: &NodeType, seed: u64, all: bool) -> Given {
    let (params, _) = (ty.trial)(&mut Rng::new(seed));
    let required = |name: &str| (ty.params)().iter().any(|s| s.name == name && s.default.is_none());
    params.write().into_iter().filter(|(name, _)| all || required(name)).collect()
}

#[test]
fn written_parameters_are_read_unchanged() {
    for ty in all() {
        let defaults = read(&ty, &given(&ty, 1, false)).unwrap_or_else(|e| panic!("`{}`: {e}", ty.name));
        assert_eq!(read(&ty, &defaults).as_ref(), Ok(&defaults), "`{}`", ty.name);
        for spec in (ty.params)() {
            if let Some(default) = &spec.default {
                assert_eq!(defaults.get(spec.name), Some(default), "`{}.{}`", ty.name, spec.name);
            }
        }
        for seed in 0..50 {
            let written = given(&ty, seed, true);
            assert_eq!(read(&ty, &written).as_ref(), Ok(&written), "`{}`", ty.name);
        }
    }
}

/// Returns a number as a value of a parameter kind.
fn datum_of(kind: &ParamKind, x: f64) -> Datum {
    match kind {
        ParamKind::Int => Datum::Int(x as i64),
        ParamKind::List(inner, count) => Datum::List(vec![datum_of(inner, x); count.unwrap_or(1)]),
        ParamKind::Maybe(inner) => datum_of(inner, x),
        _ => Datum::Float(x),
    }
}

/// Returns the ends of a range, and numbers just outside them.
fn edges(spec: &ParamSpec, Bounds { min, max }: Bounds) -> ([f64; 2], [f64; 2]) {
    let step = |end: f64| match spec.kind.innermost() {
        ParamKind::Int => 1.0,
        _ => (end.abs() * 1e-6).max(1e-9),
    };
    ([min, max], [min - step(min), max + step(max)])
}

#[test]
fn ranges_include_their_ends_and_nothing_outside() {
    for ty in all() {
        let required = given(&ty, 1, false);
        for spec in (ty.params)().iter().filter(|spec| spec.kind.is_number()) {
            let (name, param) = (ty.name, spec.name);
            let bounds = spec.bounds.unwrap_or_else(|| panic!("`{name}.{param}` has no range"));
            let with = |x: f64| {
                let mut given = required.clone();
                given.insert(param, datum_of(&spec.kind, x));
                read(&ty, &given)
            };
            let (inside, outside) = edges(spec, bounds);
            for x in inside.into_iter().filter(|x| x.abs() < 9e15) {
                assert!(with(x).is_ok(), "`{name}.{param}` refuses {x}, an end of its range");
            }
            for x in outside.into_iter().filter(|x| x.abs() < 9e15) {
                assert!(with(x).is_err(), "`{name}.{param}` takes {x}, outside its range {bounds}");
            }
            for x in [f64::NAN, f64::INFINITY] {
                assert!(
                    *spec.kind.innermost() != ParamKind::Float || with(x).is_err(),
                    "`{name}.{param}` takes {x}"
                );
            }
        }
    }
}

/// Returns true if no output stream has the item type of an input stream that is always there.
fn makes_another_kind(ty: &NodeType) -> bool {
    let streams = |port: &&PortSpec| matches!(port.kind, PortKind::Stream(_));
    let is_required = |port: &&PortSpec| port.arity != Arity::Optional;
    let given = |out: &PortSpec| ty.inputs.iter().filter(is_required).any(|port| port.kind.feeds(&out.kind));
    !ty.outputs.iter().filter(streams).any(given)
}

#[test]
fn names_and_rates_follow_the_conventions() {
    for ty in all() {
        assert!(
            ty.name.starts_with(char::is_uppercase) && ty.name.chars().all(char::is_alphanumeric),
            "{ty:?}"
        );
        for spec in (ty.params)() {
            // Streams have rates: only a node that outputs a new kind of stream, or that changes the rate of its input, may have
            // a rate as a parameter.
            let rate = spec.kind == ParamKind::Rate && !["LevelMeter", "Resample"].contains(&ty.name);
            assert!(
                !rate || makes_another_kind(&ty),
                "`{}.{}` is a rate, which its input defines",
                ty.name,
                spec.name
            );
        }
    }
}

/// The checks of taps before a run rely on these declarations.
#[test]
fn types_with_drawings_and_files_declare_them() {
    let (mut plots, mut files) = (0, 0);
    for ty in all() {
        for port in ty.outputs {
            let (PortKind::Value(kind) | PortKind::Fold(kind)) = port.kind else { continue };
            for seed in 0..4 {
                let value = (kind.trial)(&mut Rng::new(seed));
                let (plot, file) = ((kind.plot)(&value).is_some(), (kind.file)(&value).is_some());
                assert!((!plot || kind.plots) && (!file || kind.files), "{}", kind.name);
                plots += usize::from(plot);
                files += usize::from(file);
            }
        }
    }
    assert!(plots > 20 && files > 4, "{plots} drawings, {files} files");
}

#[test]
fn trials_have_several_rates() {
    // Checks the trials themselves: they must not assume equal rates.
    let rates: HashSet<Rate> = (0..all().len())
        .flat_map(|node| accepted(node, Level::Random, 4))
        .flat_map(|trial| (0..trial.ty().inputs.len()).filter_map(move |port| trial.input_rate(port)))
        .collect();
    assert!(rates.len() > 3, "{rates:?}");
}
