//! The present levels, in a file beside the graph.

use crate::live::input::MeterReadings;
use crate::live::{Levels, now};
use foley_nodes::dsp::linear_to_db;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval between two states of the file.
const INTERVAL: Duration = Duration::from_secs(1);
/// Level of a meter that reads nothing, dB.
const LOWEST: f64 = -200.0;

/// Writes the levels of a graph that plays once a second.
#[derive(Debug)]
pub(super) struct LevelFile {
    graph: PathBuf,
    written: Instant,
    /// Peak since then.
    peak: f32,
    /// Peak of each meter since then, and its last root mean square, dB.
    meters: BTreeMap<String, (f64, f64)>,
    /// Peaks of the nodes, as measured last.
    nodes: BTreeMap<String, Option<f64>>,
}

impl LevelFile {
    /// The file of a graph.
    pub fn new(graph: &Path) -> Self {
        Self {
            graph: graph.to_owned(),
            written: Instant::now(),
            peak: 0.0,
            meters: BTreeMap::new(),
            nodes: BTreeMap::new(),
        }
    }

    /// Sets the peaks of the nodes.
    pub fn set_nodes(&mut self, peaks: &BTreeMap<String, f32>) {
        let level = |peak: f32| (peak > 0.0).then(|| linear_to_db(f64::from(peak)));
        self.nodes = peaks.iter().map(|(id, peak)| (id.clone(), level(*peak))).collect();
    }

    /// Adds the peak of the sound since the last call, and readings of meters. A folder in which nothing can be written has no
    /// file of levels.
    pub fn add(&mut self, peak: f32, readings: &[MeterReadings], played: f64) {
        self.peak = self.peak.max(peak);
        for meter in readings {
            for reading in &meter.readings {
                let level = self.meters.entry(meter.name.clone()).or_insert((LOWEST, LOWEST));
                level.0 = level.0.max(linear_to_db(f64::from(reading.peak)));
                level.1 = linear_to_db(reading.rms).max(LOWEST);
            }
        }
        if self.written.elapsed() < INTERVAL {
            return;
        }
        self.written = Instant::now();
        let peak = std::mem::take(&mut self.peak);
        let graph = self.graph.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let out = (peak > 0.0).then(|| linear_to_db(f64::from(peak)));
        let (meters, nodes) = (std::mem::take(&mut self.meters), self.nodes.clone());
        let levels = Levels { graph, at: now(), played, out, meters, nodes };
        let _ = levels.write(&self.graph);
    }

    /// Removes the file.
    pub fn end(&self) {
        Levels::remove(&self.graph);
    }
}
