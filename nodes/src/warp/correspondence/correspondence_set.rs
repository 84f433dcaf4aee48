//! Correspondences from a file, as a node.

use super::set::{CorrespondenceSet, read_correspondences, write_correspondences};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Data;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// Moments of a target and of a database that should sound alike, from a file that people write.
    ///
    /// The file is RON: `Correspondences(pairs: [(label: "slow drag", target: 1.25, source: 0, database: 3.4, duration: 0.1)])`. `target` is
    /// the start in the target and `database` that in the recording `source` (its number, or its path in quotes), or without
    /// one in the database, whose units stand one after the other; all in seconds. Further there may be `channel` (from 0; all
    /// where none is named), `weight` (1), `enabled` (true) and `label`. Mark 0.1 or 0.2 s; 5 to 15 pairs are usual,
    /// silence being one. What does not fit the target or the database is named with line and column where they meet,
    /// in `TpsFit`. The file may state `version`, which is 1, the `target` in words with its `length` in s, and the
    /// file names of the recordings of the
    /// `database`, as `CorrespondenceSuggester` writes them: `length: 7.6, database: "drag.wav, fold.wav"`. Where the target or the
    /// recordings are others when the warp is fitted, a warning reports it.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.3.
    pub struct CorrespondencesParams {
        /// The file.
        path: AssetPath;
    }
}
ports! {
    pub struct CorrespondencesPorts / CorrespondencesIo {
        in {}
        out {
            /// The correspondences.
            pairs: Value<CorrespondenceSet>,
        }
    }
}

/// The node `CorrespondenceSet`.
#[derive(Debug)]
pub struct Correspondences;

fn read_set(path: &str, bytes: &[u8]) -> Result<CorrespondenceSet, Reject> {
    let wrong = |message: String| Reject::new("F110", message).at("path");
    let text = std::str::from_utf8(bytes).map_err(|_| wrong(format!("{path:?} is not UTF-8 text")))?;
    let set = read_correspondences(text).map_err(|e| wrong(format!("{path}:{e}")))?;
    Ok(CorrespondenceSet { file: path.to_owned(), ..set })
}

impl Func for Correspondences {
    type Params = CorrespondencesParams;
    type Ports = CorrespondencesPorts;
    const NAME: &'static str = "CorrespondenceSet";
    const VERSION: u32 = 2;
    const EXPOSES_PATHS: bool = true;

    fn check(p: &CorrespondencesParams, s: &mut Shape<'_, '_, CorrespondencesPorts>) -> Result<(), Reject> {
        read_set(&p.path.0, &s.bytes("path", &p.path.0)?).map(|_| ())
    }

    fn eval(
        p: &CorrespondencesParams,
        cx: &Build<'_>,
        mut io: CorrespondencesIo<'_>,
    ) -> Result<Summary, Fault> {
        let set = read_set(&p.path.0, &cx.bytes("path", &p.path.0)?)?;
        let enabled = set.pairs.iter().filter(|c| c.enabled).count();
        let summary = vec![("correspondences", set.pairs.len().into()), ("enabled", enabled.into())];
        io.pairs.set(set);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (CorrespondencesParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("set.ron", write_correspondences(&CorrespondenceSet::trial(rng), &[]));
        (CorrespondencesParams { path: "set.ron".into() }, files)
    }
}
