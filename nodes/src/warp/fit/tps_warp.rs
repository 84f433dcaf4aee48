//! A warp applied to the features of a target, as a node.

use super::warp::Warp;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Stream, Value};
use crate::core::shape::{Build, Ends, Shape};
use crate::feature::{FeatureFormat, Features};
use crate::unit::database::{UnitDatabase, file_names};
use crate::warp::spline::Warper;
use crate::{archive_state, params, ports};

params! {
    /// Warps features of a target to those of similar sounds in a database.
    ///
    /// The warp comes from `TpsFit` or `WarpFile`, and must have been fitted to features of the same conventions: after the same
    /// `TemporalGaussian`. It has one map for all channels, or one each. With the `database` that units are chosen from, a warning
    /// names a warp that was fitted to other recordings. Recordings are compared by the digests of their contents, or by their
    /// file names if digests are missing.
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
            /// The warped features.
            warped: Stream<Features>,
        }
    }
}

/// The node over [`Warper`].
#[derive(Debug)]
pub struct TpsWarp {
    maps: Vec<Warper>,
    dims: usize,
    /// Warning about a warp that was fitted to another database.
    mismatch: Option<String>,
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

/// Returns the difference between the recordings of a warp and of a database, if there is one: by content, in any
/// order, if both store it that, else by their names.
fn mismatch(warp: &Warp, db: &UnitDatabase) -> Option<String> {
    let (fitted, found) = (file_names(warp.recordings.iter().map(String::as_str)), db.recordings());
    let (mut then, mut now) =
        (warp.contents.clone(), Vec::from_iter(db.sources.iter().map(|s| s.content.clone())));
    then.sort_unstable();
    now.sort_unstable();
    let known =
        then.len() == warp.recordings.len() && then.iter().chain(&now).all(|content| !content.is_empty());
    let same = if known { then == now } else { fitted == found };
    let changed = if fitted == found { ", some with other contents than at the fit" } else { "" };
    (!warp.recordings.is_empty() && !same).then(|| {
        format!(
            "`recordings` of the warp are {fitted:?}; the database has {found:?}{changed}: the warp does not apply, fit it to these \
             recordings (TpsFit)"
        )
    })
}

impl Node for TpsWarp {
    type Params = TpsWarpParams;
    type Ports = TpsWarpPorts;
    const NAME: &'static str = "TpsWarp";
    const VERSION: u32 = 3;
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
        let mismatch = database.and_then(|db| mismatch(&warp, &db));
        Ok(Self { maps: (0..features.vectors).filter_map(map).collect(), dims: features.dims(), mismatch })
    }

    fn run(&mut self, mut io: TpsWarpIo<'_>) -> Result<(), Fault> {
        let d = self.dims.max(1);
        let vectors = io.features.items().chunks_exact(d).zip(io.warped.items().chunks_exact_mut(d));
        for ((from, to), map) in vectors.zip((0..self.maps.len()).cycle()) {
            self.maps[map].warp(from, to);
        }
        Ok(())
    }

    fn finish(&mut self, _: TpsWarpIo<'_>) -> Result<Summary, Fault> {
        Ok(self.mismatch.take().map(|text| ("warning", text.into())).into_iter().collect())
    }

    archive_state!(mismatch);
}
