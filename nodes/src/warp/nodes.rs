//! Files of correspondences and of warps, and the warp itself, as nodes.

use super::artefact::Warp;
use super::set::{CorrespondenceSet, read_correspondences, write_correspondences};
use super::tps::Warper;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Data;
use crate::core::node::{Class, Func, Node, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::feature::{FeatureFormat, Features};
use crate::unit::database::{UnitDatabase, file_names};
use crate::{archive_state, params, ports};

params! {
    /// Moments of a target and of a database that should sound alike, from a file that people write.
    ///
    /// The file is RON: `Correspondences(pairs: [(label: "slow drag", target: 1.25, source: 0, database: 3.4, duration: 0.1)])`. `target` is
    /// the start in the target and `database` that in the recording `source` (its number, or its path in quotes), or without
    /// one in the database, whose units stand one after the other; all in seconds. Further there may be `channel` (from 0; all
    /// where none is given), `weight` (1), `enabled` (true) and `label`. Mark 0.1 or 0.2 s; 5 to 15 pairs are usual, silence being
    /// one. What does not fit the target or the database is named with line and column where they meet, in `TpsFit`. The file
    /// may say `version`, which is 1, the `target` in words with its `length` in s, and the file names of the recordings of the
    /// `database`, as `CorrespondenceSuggester` writes them: `length: 7.6, database: "drag.wav, fold.wav"`. Where the target or the
    /// recordings are others when the warp is fitted, a warning says so.
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
        files.insert("set.ron", write_correspondences(&CorrespondenceSet::trial(rng)));
        (CorrespondencesParams { path: "set.ron".into() }, files)
    }
}

params! {
    /// A warp from a file: JSON as a tap of `TpsFit` writes it.
    ///
    /// Its `content` is a digest of all else that it holds; a warp that was changed by hand under it is refused, one without it is
    /// taken as it is.
    pub struct WarpFileParams {
        /// The file.
        path: AssetPath;
    }
}
ports! {
    pub struct WarpFilePorts / WarpFileIo {
        in {}
        out {
            /// The warp.
            warp: Value<Warp>,
        }
    }
}

/// The node `WarpFile`.
#[derive(Debug)]
pub struct WarpFile;

fn read_warp(path: &str, bytes: &[u8]) -> Result<Warp, Reject> {
    let wrong = |message: String| Reject::new("F111", format!("{path:?}: {message}")).at("path");
    let warp: Warp = serde_json::from_slice(bytes).map_err(|e| wrong(format!("this is no warp: {e}")))?;
    warp.fault().or_else(|| warp.altered()).map_or(Ok(warp), |fault| Err(wrong(fault)))
}

impl Func for WarpFile {
    type Params = WarpFileParams;
    type Ports = WarpFilePorts;
    const NAME: &'static str = "WarpFile";
    const VERSION: u32 = 5;

    fn check(p: &WarpFileParams, s: &mut Shape<'_, '_, WarpFilePorts>) -> Result<(), Reject> {
        read_warp(&p.path.0, &s.bytes("path", &p.path.0)?).map(|_| ())
    }

    fn eval(p: &WarpFileParams, cx: &Build<'_>, mut io: WarpFileIo<'_>) -> Result<Summary, Fault> {
        let warp = read_warp(&p.path.0, &cx.bytes("path", &p.path.0)?)?;
        let summary = warp.summary();
        io.warp.set(warp);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (WarpFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        // Writing to a vector does not fail.
        files.insert("trial.warp", serde_json::to_vec(&<Warp as Data>::trial(rng)).unwrap_or_default());
        (WarpFileParams { path: "trial.warp".into() }, files)
    }
}

params! {
    /// Warps features of a target to where a database has the like.
    ///
    /// The warp comes from `TpsFit` or `WarpFile`, and must have been made for features of the same conventions: after the same
    /// `TemporalGaussian`. It has one map for all channels, or one each. With the `database` that units are chosen from, a note tells of a
    /// warp that was fitted in other recordings: it leads to where those have the like. Recordings are known by what they hold,
    /// whatever their files are called; those of a warp or a database that does not tell, by their names.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.3, eq. 8.
    pub struct TpsWarpParams {}
}
ports! {
    pub struct TpsWarpPorts / TpsWarpIo {
        in {
            /// Features of the target.
            features: Stream<Features>,
            /// The warp.
            warp: Value<Warp>,
            /// The database that the features are for.
            database: Option<Value<UnitDatabase>>,
        }
        out {
            /// Features where the database has them.
            warped: Stream<Features>,
        }
    }
}

/// The node over [`Warper`].
#[derive(Debug)]
pub struct TpsWarp {
    maps: Vec<Warper>,
    dims: usize,
    /// In what way the warp is one of another database.
    strange: Option<String>,
}

fn check(warp: &Warp, features: &FeatureFormat) -> Result<(), Reject> {
    if let Some(fault) = warp.fault() {
        return Err(Reject::new("F111", fault).at("warp"));
    }
    features.conventions.check("features", &warp.conventions, "warp")?;
    if ![1, features.vectors].contains(&warp.maps.len()) {
        let message = format!(
            "the warp has maps for {} channels; the features have {} vectors per unit",
            warp.maps.len(),
            features.vectors
        );
        return Err(Reject::new("F111", message).at("warp").help("fit it with features of as many channels"));
    }
    Ok(())
}

/// How a warp is one of other recordings than those of a database, where it tells: by what they hold, in any order, where both know
/// that, else by their names.
fn strange(warp: &Warp, db: &UnitDatabase) -> Option<String> {
    let (fitted, found) = (file_names(warp.recordings.iter().map(String::as_str)), db.recordings());
    let (mut then, mut now) =
        (warp.contents.clone(), Vec::from_iter(db.sources.iter().map(|s| s.content.clone())));
    then.sort_unstable();
    now.sort_unstable();
    let known =
        then.len() == warp.recordings.len() && then.iter().chain(&now).all(|content| !content.is_empty());
    let same = if known { then == now } else { fitted == found };
    let changed = if fitted == found { ", of which some hold other sound than they did" } else { "" };
    (!warp.recordings.is_empty() && !same).then(|| {
        format!(
            "`recordings` of the warp are {fitted:?}; the database has {found:?}{changed}: the warp leads elsewhere, fit it to these \
             recordings (TpsFit)"
        )
    })
}

impl Node for TpsWarp {
    type Params = TpsWarpParams;
    type Ports = TpsWarpPorts;
    const NAME: &'static str = "TpsWarp";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 250.0;

    fn shape(_: &TpsWarpParams, s: &mut Shape<'_, '_, TpsWarpPorts>) -> Result<(), Reject> {
        let features = s.input(TpsWarpPorts::features);
        if let Some(warp) = s.value(TpsWarpPorts::warp) {
            check(&warp, &features.format)?;
        }
        s.when_ended(TpsWarpPorts::features, Ends::Stop);
        s.output(TpsWarpPorts::warped, features.rate, features.format);
        Ok(())
    }

    fn build(_: &TpsWarpParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (features, warp) = (cx.input(TpsWarpPorts::features).format, cx.value(TpsWarpPorts::warp));
        check(&warp, &features)?;
        let map = |k: usize| warp.maps.get(k).or(warp.maps.first()).map(|map| Warper::new(&map.spline));
        let database = cx.optional_value(TpsWarpPorts::database);
        let strange = database.and_then(|db| strange(&warp, &db));
        Ok(Self { maps: (0..features.vectors).filter_map(map).collect(), dims: features.dims(), strange })
    }

    fn run(&mut self, mut io: TpsWarpIo<'_>) -> Result<(), Fault> {
        let d = self.dims.max(1);
        let vectors = io.features.items().chunks_exact(d).zip(io.warped.items().chunks_exact_mut(d));
        for ((from, to), place) in vectors.zip((0..self.maps.len()).cycle()) {
            self.maps[place].warp(from, to);
        }
        Ok(())
    }

    fn finish(&mut self, _: TpsWarpIo<'_>) -> Result<Summary, Fault> {
        Ok(self.strange.take().map(|text| ("warning", text.into())).into_iter().collect())
    }

    archive_state!(strange);
}

#[cfg(test)]
mod tests;
