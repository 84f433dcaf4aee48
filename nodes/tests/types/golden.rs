//! The output of every registered node at its current version. Another output with the same version is an error, since the cache would
//! continue to use results of the older code.
//!
//! `golden.csv` holds, for each node, trial and list of output numbers, their count, their peak and three sums with fixed random signs.
//! The tolerance is 10^-4 of the peak, since Fourier transforms and mathematical functions differ in the last bits between machines. To
//! rewrite the file:
//!
//! ```text
//! FOLEY_GOLDEN=write cargo test -p foley-nodes --test suite golden
//! ```

use crate::trial::{Level, Trial, accepted};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::standalone::StandaloneRun;
use foley_nodes::registry::all;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Trials per node.
const TRIALS: usize = 4;
/// Sums with random signs per list.
const SUMS: usize = 3;
/// Tolerance relative to the peak.
const TOLERANCE: f64 = 1e-4;
/// The row with the parameters of a trial, to distinguish a change of the trials from a change of the output.
const PARAMETERS: &str = "(parameters)";
const HEAD: &str = "node,version,trial,what,count,peak,sum 1,sum 2,sum 3";

/// A digest of a list of numbers.
#[derive(Clone, Debug, PartialEq)]
struct Digest {
    count: usize,
    peak: f64,
    sums: [f64; SUMS],
}

impl Digest {
    fn of(numbers: &[f64]) -> Self {
        let mut sums = [0.0; SUMS];
        for (i, x) in numbers.iter().enumerate() {
            let bits = scramble(i as u64);
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += if bits >> (7 * k) & 1 == 0 { *x } else { -x };
            }
        }
        // The sums of white noise are then about its root mean square at any length.
        let scale = (numbers.len().max(1) as f64).sqrt();
        let peak = numbers.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        Self { count: numbers.len(), peak, sums: sums.map(|sum| sum / scale) }
    }

    fn near(&self, other: &Self) -> bool {
        let scale = self.peak.max(other.peak).max(1e-30);
        let near = |a: f64, b: f64| (a - b).abs() <= TOLERANCE * scale;
        self.count == other.count
            && near(self.peak, other.peak)
            && self.sums.iter().zip(&other.sums).all(|(a, b)| near(*a, *b))
    }
}

/// The mixing step of SplitMix64.
fn scramble(i: u64) -> u64 {
    let x = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Maps a text to a number below 1.
fn text(bytes: &[u8]) -> f64 {
    let hash = bytes.iter().fold(0, |h, b| scramble(h ^ u64::from(*b)));
    (hash >> 11) as f64 / (1_u64 << 53) as f64
}

/// Collects the numbers of a value by the path of their fields.
fn leaves(path: &str, value: &Value, lists: &mut BTreeMap<String, Vec<f64>>) {
    let number = match value {
        Value::Array(items) => return items.iter().for_each(|item| leaves(path, item, lists)),
        Value::Object(fields) => {
            return fields.iter().for_each(|(name, field)| leaves(&format!("{path}.{name}"), field, lists));
        }
        Value::Number(x) => x.as_f64().unwrap_or_default(),
        other => text(other.to_string().as_bytes()),
    };
    lists.entry(path.to_owned()).or_default().push(number);
}

/// Returns all outputs of a trial as lists of numbers by name.
fn outcome(trial: &Trial) -> BTreeMap<String, Vec<f64>> {
    let standalone = trial.standalone(trial.fastest_rate().span(64));
    let run: StandaloneRun = standalone.run().unwrap_or_else(|fault| panic!("{fault}: {trial:?}"));
    let mut lists = BTreeMap::new();
    for (port, spec) in trial.ty().outputs.iter().enumerate() {
        let name = spec.name;
        match spec.kind {
            PortKind::Stream(item) => {
                let (numbers, _) = run.numbers(port);
                let columns = item.columns.len().max(1);
                for (c, column) in item.columns.iter().enumerate() {
                    let own = numbers.iter().skip(c).step_by(columns).map(|x| f64::from(*x));
                    lists.insert(format!("{name}.{column}"), own.collect());
                }
            }
            PortKind::Events(_) => {
                let events = run.events_json(port);
                lists.insert(format!("{name}.(ticks)"), events.iter().map(|(t, _)| *t as f64).collect());
                events.iter().for_each(|(_, event)| leaves(name, event, &mut lists));
            }
            PortKind::Value(_) | PortKind::Fold(_) => {
                let json = run
                    .value(port)
                    .and_then(|value| serde_json::from_str(&value.json()).ok())
                    .unwrap_or_default();
                leaves(name, &json, &mut lists);
            }
        }
    }
    if let Some(file) = standalone.outputs.get("trial.out") {
        lists.insert("(file)".to_owned(), vec![file.len() as f64, text(&file)]);
    }
    lists
}

/// Returns the parameters as numbers.
fn parameters(trial: &Trial) -> Vec<f64> {
    let written = trial.params().write().into_iter();
    let words = written.flat_map(|(name, datum)| [name.to_string(), datum.to_string()]);
    words.map(|word| word.parse().unwrap_or_else(|_| text(word.as_bytes()))).collect()
}

type Rows = BTreeMap<(String, u32, usize, String), Digest>;

fn rows_of(node: usize) -> Rows {
    let ty = &all()[node];
    let mut rows = Rows::new();
    for (number, trial) in accepted(node, Level::Random, TRIALS).iter().enumerate() {
        let mut add = |what: &str, numbers: &[f64]| {
            let key = (ty.name.to_owned(), ty.version, number, what.to_owned());
            rows.insert(key, Digest::of(numbers));
        };
        add(PARAMETERS, &parameters(trial));
        outcome(trial).iter().for_each(|(what, numbers)| add(what, numbers));
    }
    rows
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden.csv")
}

fn write(rows: &Rows) -> String {
    let mut csv = format!("{HEAD}\n");
    for ((node, version, trial, what), digest) in rows {
        let _ = write!(csv, "{node},{version},{trial},{what},{},{:.7e}", digest.count, digest.peak);
        digest.sums.iter().for_each(|sum| {
            let _ = write!(csv, ",{sum:.7e}");
        });
        csv.push('\n');
    }
    csv
}

fn read(csv: &str) -> Rows {
    let mut rows = Rows::new();
    for line in csv.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields.len(), 6 + SUMS, "golden.csv: {line}");
        let number = |k: usize| fields[k].parse::<f64>().expect("a number in golden.csv");
        let whole = |k: usize| fields[k].parse::<usize>().expect("a whole number in golden.csv");
        let key = (fields[0].to_owned(), whole(1) as u32, whole(2), fields[3].to_owned());
        let sums = std::array::from_fn(|k| number(6 + k));
        rows.insert(key, Digest { count: whole(4), peak: number(5), sums });
    }
    rows
}

/// Compares the output of a node with its entries in the file. Returns the difference, if any.
fn verdict(name: &str, version: u32, golden: &Rows, now: &Rows) -> Option<String> {
    const REWRITE: &str = "FOLEY_GOLDEN=write cargo test -p foley-nodes --test suite golden";
    let of = |rows: &Rows| -> Rows {
        rows.iter()
            .filter(|(key, _)| key.0 == name)
            .map(|(key, digest)| (key.clone(), digest.clone()))
            .collect()
    };
    let (golden, now) = (of(golden), of(now));
    let Some(was) = golden.keys().map(|key| key.1).next() else {
        return Some(format!("`{name}` has no entry: run {REWRITE}"));
    };
    if was != version {
        return Some(format!("`{name}` has version {version}, its entry version {was}: run {REWRITE}"));
    }
    let differs = |key: &&(String, u32, usize, String)| match (golden.get(*key), now.get(*key)) {
        (Some(was), Some(is)) => !was.near(is),
        _ => true,
    };
    let mut keys = golden.keys().chain(now.keys()).filter(differs).peekable();
    let first = *keys.peek()?;
    if keys.any(|key| key.3 == PARAMETERS) {
        return Some(format!(
            "`{name}`: its trials have other parameters, so its output cannot be compared: check that nothing else has changed, \
             then run {REWRITE}"
        ));
    }
    Some(format!(
        "`{name}`: the output `{}` of trial {} has changed and the version has not ({:?} -> {:?}). Raise VERSION, so that \
         cached results are not used as new ones, then run {REWRITE}; if only the trials of its inputs have changed, keep \
         VERSION",
        first.3,
        first.2,
        golden.get(first),
        now.get(first)
    ))
}

#[test]
fn outputs_change_with_the_version_only() {
    let types = all();
    let now: Rows = (0..types.len()).flat_map(rows_of).collect();
    if std::env::var_os("FOLEY_GOLDEN").is_some_and(|v| v == "write") {
        std::fs::write(path(), write(&now)).expect("golden.csv can be written");
        return;
    }
    let golden = read(&std::fs::read_to_string(path()).unwrap_or_default());
    let mut wrong: Vec<String> =
        types.iter().filter_map(|ty| verdict(ty.name, ty.version, &golden, &now)).collect();
    let gone = golden.keys().map(|key| &key.0).filter(|name| types.iter().all(|ty| ty.name != **name));
    let gone: std::collections::BTreeSet<&String> = gone.collect();
    wrong.extend(
        gone.iter().map(|name| format!("golden.csv has `{name}`, which is not a node: rewrite the file")),
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_change_of_a_thousandth_is_detected_and_rounding_is_not() {
    let noise: Vec<f64> = (0..5000).map(|i| text(&u64::to_le_bytes(i)) - 0.5).collect();
    let golden = Digest::of(&noise);
    let louder = |by: f64| Digest::of(&noise.iter().map(|x| x * by).collect::<Vec<_>>());
    assert!(!golden.near(&louder(1.001)) && !golden.near(&louder(0.999)));
    assert!(golden.near(&louder(1.0 + 1e-6)));
    let late: Vec<f64> = [0.0].iter().chain(&noise[..4999]).copied().collect();
    assert!(!golden.near(&Digest::of(&late)), "one sample late");
    let mut swapped = noise.clone();
    swapped.swap(10, 4000);
    assert!(!golden.near(&Digest::of(&swapped)), "two samples swapped");
    let zeros = Digest::of(&[0.0; 10]);
    assert!(zeros.near(&zeros) && !zeros.near(&Digest::of(&[1e-9; 10])));
}

#[test]
fn verdicts_name_the_remedy() {
    let rows = |version: u32, what: &str, x: f64| -> Rows {
        let key = |what: &str| ("Gain".to_owned(), version, 0, what.to_owned());
        [(key(PARAMETERS), Digest::of(&[1.0])), (key(what), Digest::of(&[x, 0.5]))].into()
    };
    let golden = rows(1, "audio.", 1.0);
    assert_eq!(verdict("Gain", 1, &golden, &golden), None);
    let message = |version, now: &Rows| verdict("Gain", version, &golden, now).unwrap();
    assert!(message(1, &rows(1, "audio.", 1.001)).contains("Raise VERSION"));
    assert!(message(2, &rows(2, "audio.", 1.001)).contains("its entry version 1"));
    assert!(message(1, &rows(1, "other", 1.0)).contains("`audio.` of trial 0"));
    assert!(message(1, &rows(1, PARAMETERS, 3.0)).contains("other parameters"));
    assert!(verdict("Gain", 1, &Rows::new(), &golden).unwrap().contains("no entry"));
    let again = read(&write(&golden));
    assert_eq!(verdict("Gain", 1, &again, &golden), None);
}
