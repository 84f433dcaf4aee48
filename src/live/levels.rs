//! Levels of a graph that plays, in a file beside it for other programs, such as the language server.

use crate::memo::temporary_path;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use std::{fs, io};

/// Age from which on levels are those of a graph that plays no more, s.
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
    /// Peak of what was heard in the last second, dB of full scale; `None` for silence.
    pub out: Option<f64>,
    /// Peak and root mean square of each meter, by its name.
    pub meters: BTreeMap<String, (f64, f64)>,
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

    /// Removes the file of the levels of a graph that plays no more.
    pub fn remove(graph: &Path) {
        let _ = fs::remove_file(Self::path(graph));
    }

    /// The level of a meter in words, or of what is heard where there is no meter of this name.
    #[must_use]
    pub fn describe(&self, meter: &str) -> String {
        let played = self.played;
        match (self.meters.get(meter), self.out) {
            (Some((peak, rms)), _) => {
                format!("now: {peak:.1} dB peak, {rms:.1} dB RMS, {played:.0} s into the piece")
            }
            (None, Some(peak)) => format!("heard now: {peak:.1} dB peak, {played:.0} s into the piece"),
            (None, None) => format!("heard now: silence, {played:.0} s into the piece"),
        }
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
        let mut levels = Levels { graph: "a.ron".into(), at: now(), played: 2.0, out: Some(-3.0), meters };
        assert_eq!(Levels::beside(&graph), None);
        levels.write(&graph).unwrap();
        assert_eq!(Levels::beside(&graph), Some(levels.clone()));
        assert_eq!(Levels::beside(&folder.path().join("b.ron")), None);
        assert!(levels.describe("force").starts_with("now: -6.0 dB peak, -9.0 dB RMS"));
        assert!(levels.describe("other").starts_with("heard now: -3.0 dB peak"));
        levels.at -= 10.0;
        levels.write(&graph).unwrap();
        assert_eq!(Levels::beside(&graph), None, "it plays no more");
        Levels::remove(&graph);
        assert!(!Levels::path(&graph).exists());
    }
}
