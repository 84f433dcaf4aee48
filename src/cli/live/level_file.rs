//! The present levels, in a file beside the graph.

use crate::live::input::MeterReadings;
use crate::live::{Levels, now};
use foley_nodes::dsp::linear_to_db;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval between two states of the file.
const INTERVAL: Duration = Duration::from_secs(1);

/// Writes the levels of a graph that plays once a second.
#[derive(Debug)]
pub(super) struct LevelFile {
    graph: PathBuf,
    written: Instant,
    /// Peak since then.
    peak: f32,
    /// The last reading of each meter: peak and root mean square, dB.
    meters: BTreeMap<String, (f64, f64)>,
}

impl LevelFile {
    /// The file of a graph.
    pub fn new(graph: &Path) -> Self {
        Self { graph: graph.to_owned(), written: Instant::now(), peak: 0.0, meters: BTreeMap::new() }
    }

    /// Adds the peak of what was heard since the last call, and readings of meters. A folder in which nothing can be written has no
    /// file of levels.
    pub fn add(&mut self, peak: f32, readings: &[MeterReadings], played: f64) {
        self.peak = self.peak.max(peak);
        for meter in readings {
            if let Some(last) = meter.readings.last() {
                let level =
                    (linear_to_db(f64::from(last.peak)).max(-200.0), linear_to_db(last.rms).max(-200.0));
                self.meters.insert(meter.name.clone(), level);
            }
        }
        if self.written.elapsed() < INTERVAL {
            return;
        }
        self.written = Instant::now();
        let peak = std::mem::take(&mut self.peak);
        let graph = self.graph.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let out = (peak > 0.0).then(|| linear_to_db(f64::from(peak)));
        let levels = Levels { graph, at: now(), played, out, meters: std::mem::take(&mut self.meters) };
        let _ = levels.write(&self.graph);
    }

    /// Removes the file.
    pub fn end(&self) {
        Levels::remove(&self.graph);
    }
}
