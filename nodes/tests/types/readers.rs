//! A fuzzer with fixed seeds for every node that reads a file. A damaged file results in an error with a reason or a
//! usable value; it never causes a panic, numbers that are not finite, or unbounded memory.

use foley_nodes::core::buffer::{Budget, Pad};
use foley_nodes::core::item::AnyValue;
use foley_nodes::core::ports::{Arity, PortKind};
use foley_nodes::core::random::Rng;
use foley_nodes::core::standalone::{Standalone, StandaloneRun};
use foley_nodes::core::time::ticks;
use foley_nodes::friction::{EncoderTrack, FrictionModel};
use foley_nodes::registry::all;

/// Damaged files per node type.
const ROUNDS: u64 = 400;

/// Replacements for a number in a text: small, extreme and invalid values.
const EXTREMES: [&str; 9] =
    ["0", "-1", "1e300", "1e-300", "1e39", "18446744073709551615", "null", "NaN", "0.5"];

/// Makes one change to a file: flips, truncates, removes, duplicates or moves bytes, or replaces a number of a text.
fn damage(file: &mut Vec<u8>, rng: &mut Rng) {
    if file.is_empty() {
        return;
    }
    let at = rng.below(file.len());
    let end = (at + 1 + rng.below(40)).min(file.len());
    match rng.below(8) {
        0 | 1 => file[at] ^= 1 << rng.below(8),
        2 => file[at] = [0, 1, 0x7f, 0x80, 0xff, b'-', b'9', b','][rng.below(8)],
        3 => drop(file.drain(at..end)),
        4 => {
            let bytes = file[at..end].to_vec();
            let to = if rng.below(2) == 0 { at } else { rng.below(file.len()) };
            file.splice(to..to, bytes);
        }
        5 if rng.below(4) == 0 => file.truncate(at),
        _ => {
            let digit = (0..file.len()).cycle().skip(at).take(file.len()).find(|&k| file[k].is_ascii_digit());
            let Some(start) = digit else { return };
            let number = |b: &u8| b.is_ascii_digit() || b".eE+-".contains(b);
            let end = start + file[start..].iter().take_while(|b| number(b)).count();
            file.splice(start..end, EXTREMES[rng.below(EXTREMES.len())].bytes());
        }
    }
}

/// Removes the digest from a JSON file that has one, so that damage is not detected by the digest.
fn without_digest(file: &mut Vec<u8>) {
    let Ok(serde_json::Value::Object(mut fields)) = serde_json::from_slice(file) else { return };
    if fields.remove("content").is_some() {
        *file = serde_json::Value::Object(fields).to_string().into_bytes();
    }
}

/// Damages the part of a file that its hash covers and updates the hash. Returns false if the file has no hash near its start.
fn damage_under_hash(file: &mut Vec<u8>, rng: &mut Rng) -> bool {
    let hash_of = |file: &[u8], end: usize| *blake3::hash(&file[end..]).as_bytes();
    let Some(end) = (32..file.len().min(160)).find(|&end| file[end - 32..end] == hash_of(file, end)) else {
        return false;
    };
    let mut fields = file.split_off(end);
    (0..1 + rng.below(3)).for_each(|_| damage(&mut fields, rng));
    file.extend(fields);
    let hash = hash_of(file, end);
    file[end - 32..end].copy_from_slice(&hash);
    true
}

/// Checks that all values of a run can be shown and that its streams are finite.
fn check(run: &StandaloneRun, outputs: usize, context: &str) {
    for port in 0..outputs {
        if let Some(value) = run.value(port) {
            let kind = value.kind();
            let _ = (value.json(), (kind.plot)(&value), (kind.file)(&value));
        }
        assert!(run.numbers(port).1, "{context}: not finite");
    }
}

/// Reads a quarter of a second of a damaged file, or returns the reason why it cannot be read.
fn read(standalone: &Standalone, streams: bool) -> Result<StandaloneRun, foley_nodes::core::fault::Fault> {
    if !streams {
        return standalone.run();
    }
    // The rate may be arbitrary, so the announced length may be hours.
    standalone.shape()?;
    let mut run = standalone.start()?;
    for _ in 0..5 {
        if !run.step()? {
            run.finish()?;
            break;
        }
    }
    Ok(run)
}

#[test]
fn damaged_files_are_refused_with_a_reason_or_give_usable_values() {
    let mut readers = 0;
    for k in 0..all().len() {
        let ty = all().swap_remove(k);
        let fed = ty.inputs.iter().any(|port| port.arity != Arity::Optional);
        let (name, outputs) = (ty.name, ty.outputs);
        let streams = ty.eval.is_none();
        if fed || (ty.trial)(&mut Rng::new(0)).1.paths().next().is_none() {
            continue;
        }
        readers += 1;
        let (mut taken, mut refused) = (0, 0);
        for round in 0..ROUNDS {
            let mut rng = Rng::new(round);
            let ty = all().swap_remove(k);
            let (params, files) = (ty.trial)(&mut rng);
            let mut standalone = Standalone::of_type(ty, params).window(ticks(0.05));
            standalone.until = ticks(0.25);
            let paths: Vec<String> = files.paths().map(str::to_owned).collect();
            standalone.files = files;
            if let Some(path) = paths.get(rng.below(paths.len().max(1))) {
                let mut file = standalone.files.get(path).unwrap_or_default().to_vec();
                let guarded = round % 2 == 1;
                if !guarded {
                    without_digest(&mut file);
                }
                if guarded || !damage_under_hash(&mut file, &mut rng) {
                    (0..1 + rng.below(3)).for_each(|_| damage(&mut file, &mut rng));
                }
                standalone.files.insert(path.clone(), file);
            }
            match read(&standalone, streams) {
                Ok(run) => {
                    check(&run, outputs.len(), &format!("{name}, round {round}"));
                    taken += 1;
                }
                Err(fault) => {
                    assert!(
                        fault.code != "F099" && !fault.message.is_empty(),
                        "{name}, round {round}: {fault}"
                    );
                    refused += 1;
                }
            }
        }
        println!("{name}: {taken} accepted, {refused} refused");
        assert!(refused > 10 && taken > 0, "{name}: {taken} accepted, {refused} refused");
    }
    assert!(readers >= 14, "{readers} readers");
}

#[test]
fn damaged_tables_of_an_encoder_are_refused_or_give_a_motion() {
    let speeds: String =
        (0..40).map(|k| format!("{:.2},{:.3}\n", 0.02 * f64::from(k), 0.1 + 0.01 * f64::from(k))).collect();
    let angles: String =
        (0..40).map(|k| format!("{:.2},{:.3}\n", 0.02 * f64::from(k), 0.3 * f64::from(k))).collect();
    let (mut taken, mut refused) = (0, 0);
    for round in 0..4000 {
        let mut rng = Rng::new(round);
        let (header, rows) = [("time_s,speed_m_s", &speeds), ("time_s,angle_rad", &angles)][rng.below(2)];
        let mut table = format!("{header}\n{rows}").into_bytes();
        (0..1 + rng.below(3)).for_each(|_| damage(&mut table, &mut rng));
        match EncoderTrack::from_csv(&table).and_then(|buffer| buffer.motion(0.05)) {
            Ok(motion) => {
                taken += 1;
                for t in [-1.0, 0.0, 0.31, 0.5, 1e9] {
                    let (low, high) = motion.speed_range(t, t + 0.05);
                    assert!(low <= high && motion.speed_at(t) >= 0.0, "round {round} at {t}");
                }
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().is_empty());
            }
        }
    }
    assert!(taken > 200 && refused > 200, "{taken} accepted, {refused} refused");
}

#[test]
fn damaged_friction_models_that_are_accepted_have_finite_power() {
    let mut rng = Rng::new(5);
    let mut taken = 0;
    for _ in 0..3000 {
        let value = AnyValue::new(<FrictionModel as foley_nodes::core::item::Data>::trial(&mut rng));
        let mut text = value.json().into_bytes();
        (0..1 + rng.below(3)).for_each(|_| damage(&mut text, &mut rng));
        let Ok(model) = serde_json::from_slice::<FrictionModel>(&text) else { continue };
        if model.validate().is_ok() {
            assert!(model.power(0.5).is_finite() && model.power(1e9).is_finite());
            taken += 1;
        }
    }
    assert!(taken > 50, "{taken} accepted");
}

#[test]
fn damaged_values_and_items_of_the_cache_are_refused_or_decoded_in_bounds() {
    let (mut kinds, mut taken, mut refused) = (std::collections::BTreeSet::new(), 0, 0);
    for output in all().iter().flat_map(|ty| ty.outputs) {
        let mut rng = Rng::new(kinds.len() as u64);
        match output.kind {
            PortKind::Value(kind) | PortKind::Fold(kind) if kinds.insert(kind.name) => {
                for _ in 0..100 {
                    let encoded = (kind.encode)(&(kind.trial)(&mut rng)).unwrap();
                    assert!((kind.decode)(&encoded).is_some(), "{}", kind.name);
                    let mut bytes = encoded;
                    (0..1 + rng.below(3)).for_each(|_| damage(&mut bytes, &mut rng));
                    match (kind.decode)(&bytes) {
                        Some(value) => {
                            taken += 1;
                            assert!((kind.encode)(&value).is_some(), "{}", kind.name);
                        }
                        None => refused += 1,
                    }
                }
            }
            PortKind::Stream(item) if kinds.insert(item.name) => {
                for _ in 0..100 {
                    let bytes: Vec<u8> = (0..rng.below(200)).map(|_| rng.below(256) as u8).collect();
                    let mut buffer = (item.buffer)(1 + rng.below(4), 16, 0, Pad::Silence);
                    match (item.decode)(&mut *buffer, &bytes) {
                        Some(()) => taken += 1,
                        None => refused += 1,
                    }
                    assert!(buffer.bytes() < 1 << 20, "{}", item.name);
                }
            }
            PortKind::Events(event) if kinds.insert(event.name) => {
                for _ in 0..100 {
                    let bytes: Vec<u8> = (0..rng.below(200)).map(|_| rng.below(256) as u8).collect();
                    let mut buffer = (event.buffer)(ticks(1.0), &Budget::new(1 << 16));
                    let _ = (event.decode)(&mut *buffer, &bytes);
                    assert!(buffer.bytes() < 4 << 20, "{}", event.name);
                }
            }
            _ => {}
        }
    }
    println!("{} types: {taken} accepted, {refused} refused", kinds.len());
    assert!(kinds.len() > 30 && taken > 100 && refused > 100, "{} types", kinds.len());
}
