//! Onsets of real recordings that were labelled by hand, beside librosa and aubio.
//!
//! Run with `cargo bench -p foley-nodes -- onsets`. The labels, `onsets/onsets.csv`, are 219 onsets in 257 spans of 70 recordings,
//! 59 s. An onset is a new impact or excitation that stands out by about 6 dB in an octave; times were read off waveforms and spectrograms,
//! and what was doubtful is outside of the spans. 22 of the recordings are in `graphs/assets`; the others are read from `recordings` of the
//! folder that `FOLEY_DATA` names, and left out if they are not there. librosa and aubio run in Python if it has them.

use foley_nodes::feature::{FluxFrames, ONSET_RISE, onsets};
use foley_nodes::io::AudioReader;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Greatest distance of an onset that is found from its label, s.
const TOLERANCE: f64 = 0.025;
/// Distance from the ends of a span below which onsets do not count, s.
const EDGE: f64 = 0.01;

/// Spans and labels of a recording.
#[derive(Default)]
struct Labelled {
    spans: Vec<[f64; 2]>,
    onsets: Vec<f64>,
}

fn rows(name: &str) -> Vec<Vec<String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/onsets").join(name);
    let mut reader = csv::Reader::from_path(path).expect("the labels");
    reader.records().map(|row| row.expect("a row").iter().map(str::to_owned).collect()).collect()
}

fn find(name: &str) -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = match name.strip_prefix("shared/") {
        Some(rest) => {
            let beside = || root.join("../../shared/data");
            std::env::var_os("FOLEY_DATA").map_or_else(beside, PathBuf::from).join("recordings").join(rest)
        }
        None => root.join("../graphs/assets").join(name),
    };
    path.is_file().then_some(path)
}

/// Number of pairs of both within the tolerance, one to one in order of time.
fn pairs(labels: &[f64], found: &[f64]) -> usize {
    let (mut i, mut j, mut count) = (0, 0, 0);
    while i < labels.len() && j < found.len() {
        if found[j] < labels[i] - TOLERANCE {
            j += 1;
        } else if found[j] > labels[i] + TOLERANCE {
            i += 1;
        } else {
            (i, j, count) = (i + 1, j + 1, count + 1);
        }
    }
    count
}

pub fn bench() {
    let mut all: BTreeMap<String, Labelled> = BTreeMap::new();
    for row in rows("spans.csv") {
        let number = |k: usize| row[k].parse().expect("a number");
        all.entry(row[0].clone()).or_default().spans.push([number(1), number(2)]);
    }
    for row in rows("onsets.csv") {
        all.entry(row[0].clone()).or_default().onsets.push(row[1].parse().expect("a number"));
    }
    let total = all.len();
    let (mut right, mut wrong, mut missed, mut seconds, mut files) = (0, 0, 0, 0.0, 0);
    let list = std::env::temp_dir().join("foley_onsets.csv");
    let mut out = File::create(&list).expect("a list of files");
    for (name, labelled) in &all {
        let Some(path) = find(name) else { continue };
        writeln!(out, "{name},{}", path.display()).expect("the list");
        let mut reader = AudioReader::open(Box::new(File::open(path).expect("a file"))).expect("a recording");
        let (x, rate) = (reader.read_mono().expect("samples"), f64::from(reader.info().rate));
        let found: Vec<f64> = onsets(&x, FluxFrames::at_rate(rate), rate, ONSET_RISE)
            .into_iter()
            .map(|t| t as f64 / rate)
            .collect();
        let counts = |t: &f64| {
            let within = |[s, e]: &[f64; 2]| (*s == 0.0 || *t >= s + EDGE) && *t <= e - EDGE;
            labelled.spans.iter().any(within)
        };
        let inside: Vec<f64> = found.iter().copied().filter(counts).collect();
        let hits = pairs(&labelled.onsets, &found);
        right += hits;
        wrong += inside.len() - pairs(&labelled.onsets, &inside);
        missed += labelled.onsets.len() - hits;
        seconds += labelled.spans.iter().map(|[s, e]| e - s).sum::<f64>();
        files += 1;
    }
    let [precision, recall] = [wrong, missed].map(|other| right as f64 / (right + other).max(1) as f64);
    let f = 2.0 * precision * recall / (precision + recall).max(1e-9);
    println!("{files} of {total} recordings, {seconds:.1} s, {} labels, 25 ms", right + missed);
    println!("foley: F {f:.3}, precision {precision:.3}, recall {recall:.3}");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/onsets/compare.py");
    let python = Command::new("python3").arg(script).arg(&list).status();
    if !python.is_ok_and(|status| status.success()) {
        println!("librosa and aubio: Python has not both, with soundfile");
    }
}
