//! Functions shared by several benches.

use foley_nodes::io::AudioReader;
use foley_nodes::mesh::Topology;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

/// Returns the best time of some runs, in ms, which is least affected by other programs.
pub fn best<T>(runs: usize, mut work: impl FnMut() -> T) -> f64 {
    let one = |work: &mut dyn FnMut() -> T| {
        let start = Instant::now();
        black_box(work());
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..runs).map(|_| one(&mut work)).fold(f64::INFINITY, f64::min)
}

/// Returns a flat square of `n` by `n` vertices around the origin, `side` metres wide, in triangles that all turn the same way.
pub fn sheet(n: usize, side: f32) -> Topology {
    let at = |k: usize| (k as f32 / (n - 1) as f32 - 0.5) * side;
    let rest = (0..n * n).map(|v| [at(v % n), at(v / n), 0.0]).collect();
    let mut triangles = Vec::new();
    for corner in (0..n * (n - 1)).filter(|v| v % n < n - 1) {
        let (a, b, c, d) = (corner as u32, corner as u32 + 1, (corner + n) as u32, (corner + n) as u32 + 1);
        triangles.extend([[a, b, d], [a, d, c]]);
    }
    Topology { rest, triangles }
}

/// Returns a folder of the data beside the repository, or at `FOLEY_DATA`.
pub fn folder(name: &str) -> PathBuf {
    let data =
        std::env::var_os("FOLEY_DATA").map_or_else(|| PathBuf::from("../../shared/data"), PathBuf::from);
    data.join(name)
}

/// Reads a recording: its rate, and its samples with channels averaged.
pub fn load(path: PathBuf) -> Option<(f64, Vec<f32>)> {
    let file = std::fs::File::open(path).ok()?;
    let mut reader = AudioReader::open(Box::new(file)).ok()?;
    let samples = reader.read_mono().ok()?;
    Some((f64::from(reader.info().rate), samples))
}

/// Begins a new peak of the memory of this process, and returns the memory that it has, in MB; not a number where the system does not say.
pub fn new_peak() -> f64 {
    match std::fs::write("/proc/self/clear_refs", "5") {
        Ok(()) => memory("VmRSS:"),
        Err(_) => f64::NAN,
    }
}

/// Returns the peak memory since [`new_peak`], in MB.
pub fn peak() -> f64 {
    memory("VmHWM:")
}

fn memory(what: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(what));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    kilobytes.unwrap_or(f64::NAN) / 1024.0
}
