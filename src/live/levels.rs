//! Levels of a graph that plays, in a file beside it for other programs, such as the language server.

use crate::memo::temporary_path;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use std::{fs, io};

/// Age at which levels count as those of a graph that no longer plays, s.
const MAX_AGE: f64 = 3.0;

/// The levels of a graph that plays, as `foley live` and `foley watch --live` write them beside it while they play.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Levels {
    /// Name of the file of the graph.
    pub graph: String,
    /// Seconds since 1970.
    pub at: f64,
    /// Seconds that the graph has played.
    pub played: f64,
    /// Peak of the sound in the last second, dB of full scale; `None` for silence.
    pub out: Option<f64>,
    /// Peak and root mean square of each meter, by its name.
    pub meters: BTreeMap<String, (f64, f64)>,
    /// Peak of each node with audio, by its id, dB; `None` for silence.
    #[serde(default)]
    pub nodes: BTreeMap<String, Option<f64>>,
}

impl Levels {
    /// The file of the levels of a graph.
    #[must_use]
    pub fn path(graph: &Path) -> PathBuf {
        graph.parent().unwrap_or(Path::new("")).join(".foley").join("playing.json")
    }

    /// The levels of a graph, if it plays now.
    #[must_use]
    pub fn beside(graph: &Path) -> Option<Self> {
        let bytes = fs::read(Self::path(graph)).ok()?;
        let levels: Self = serde_json::from_slice(&bytes).ok()?;
        let name = graph.file_name()?.to_str()?;
        let is_new = (0.0..MAX_AGE).contains(&(now() - levels.at));
        (levels.graph == name && is_new).then_some(levels)
    }

    /// Writes the levels beside a graph. A reader never sees a part of them.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, graph: &Path) -> io::Result<()> {
        let path = Self::path(graph);
        let part = temporary_path(&path)?;
        fs::write(&part, serde_json::to_vec(self)?)?;
        fs::rename(&part, &path).inspect_err(|_| drop(fs::remove_file(&part)))
    }

    /// Removes the file of the levels of a graph that no longer plays.
    pub fn remove(graph: &Path) {
        let _ = fs::remove_file(Self::path(graph));
    }

    /// The level of a node in words: that of the meter with the second name, else that of its own audio, else that of what is heard.
    #[must_use]
    pub fn describe(&self, id: &str, meter: &str) -> String {
        let peak = |peak: Option<f64>| peak.map_or("silence".to_owned(), |peak| format!("{peak:.1} dB peak"));
        let level = match (self.meters.get(meter), self.nodes.get(id)) {
            (Some((peak, rms)), _) => format!("now: {peak:.1} dB peak, {rms:.1} dB RMS"),
            (None, Some(own)) => format!("now: {}", peak(*own)),
            (None, None) => format!("heard now: {}", peak(self.out)),
        };
        format!("{level}, {:.0} s into the piece", self.played)
    }
}

/// Seconds since 1970.
#[must_use]
pub fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_those_of_a_graph_that_plays_now() {
        let folder = tempfile::tempdir().unwrap();
        let graph = folder.path().join("a.ron");
        let meters = BTreeMap::from([("force".to_owned(), (-6.0, -9.0))]);
        let nodes = BTreeMap::from([("loud".to_owned(), Some(-1.0)), ("soft".to_owned(), None)]);
        let mut levels =
            Levels { graph: "a.ron".into(), at: now(), played: 2.0, out: Some(-3.0), meters, nodes };
        assert_eq!(Levels::beside(&graph), None);
        levels.write(&graph).unwrap();
        assert_eq!(Levels::beside(&graph), Some(levels.clone()));
        assert_eq!(Levels::beside(&folder.path().join("b.ron")), None);
        assert_eq!(levels.describe("loud", "force"), "now: -6.0 dB peak, -9.0 dB RMS, 2 s into the piece");
        assert_eq!(levels.describe("loud", "loud"), "now: -1.0 dB peak, 2 s into the piece");
        assert_eq!(levels.describe("soft", "soft"), "now: silence, 2 s into the piece");
        assert_eq!(levels.describe("out", "out"), "heard now: -3.0 dB peak, 2 s into the piece");
        levels.at -= 10.0;
        levels.write(&graph).unwrap();
        assert_eq!(Levels::beside(&graph), None, "it plays no more");
        Levels::remove(&graph);
        assert!(!Levels::path(&graph).exists());
    }
}
