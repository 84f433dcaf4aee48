//! Fitting a warp, as a node.

use std::sync::Arc;

use super::artefact::{WARP_VERSION, Warp, WarpMap};
use super::fit::{Pair, Stiffness};
use super::pairing::{Pairing, Stretch, Target, pairs, stretches};
use super::set::CorrespondenceSet;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::shape::{Build, Ends, Incoming, Shape};
use crate::feature::{FeatureFormat, Features};
use crate::unit::UnitDatabase;
use crate::{archive_state, choices, impl_state, params, ports};

choices! { @param Pairing {
    /// The first unit with the first and so on, as in the paper; the longer side loses its end.
    InOrder,
    /// One pair of the means of both sides.
    Centroid,
    /// Along the cheapest way through both (dynamic time warping), for gestures of different pace.
    Dtw,
} }

params! {
    /// Fits the warp that leads features of a target to those of a database, through correspondences that somebody marked.
    ///
    /// The spline is the smoothest that comes near all pairs; `lambda` weighs smoothness against nearness, in squared units of the
    /// features: 0 passes through every pair, 1e5 is almost a shift, turn and stretch, and None takes the one of least generalised
    /// cross-validation. The paper's cotton has 1e2, its polyester and windbreaker 1e5, its corduroy 0.
    ///
    /// The summary tells the degrees of freedom (from the number of nodes down to the dimensions and one), what is left at the
    /// nodes, the share of the target where the warp folds over, whether it mirrors most of the target, which alone folds nothing
    /// (few correspondences often turn round what they do not tell apart), and the share that is farther from the middle of the nodes
    /// than twice their radius, where the warp is a guess. A tap of `warp` as SVG draws both worlds before and after. No correspondence
    /// gives a warp that changes nothing. Which ones do not fit is told before the run where the database is known by then; a warning
    /// tells of a file that was marked in another target or in other recordings.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.3, eqs. 7 and 8; Wahba,
    /// "Spline Models for Observational Data" (1990); Belongie, Malik and Puzicha (IEEE PAMI 24(4), 2002), eq. 10, for lambda.
    pub struct TpsFitParams {
        /// Stiffness; None finds one.
        lambda: Option<f64> = None, unit "", range 0.0..=1e12;
        /// Whether `lambda` is in units of the squared mean distance of nodes, so that it does not depend on the features' scale.
        scale_free: bool = false;
        /// How units of both sides become pairs.
        pairing: Pairing = Pairing::InOrder;
    }
}
ports! {
    pub struct TpsFitPorts / TpsFitIo {
        in {
            /// Features of the target, filtered as those of the database.
            features: Stream<Features>,
            /// The database.
            database: Value<UnitDatabase>,
            /// What should sound alike.
            pairs: Value<CorrespondenceSet>,
        }
        out {
            /// The warp, once the target has ended.
            warp: Fold<Warp>,
        }
    }
}

/// A target that has been heard to its end, with what it is compared with.
#[derive(Debug)]
pub(super) struct Heard {
    pub format: FeatureFormat,
    pub rate: f64,
    units: usize,
    pub features: Vec<f32>,
    pub database: Arc<UnitDatabase>,
    pub pairs: Arc<CorrespondenceSet>,
}
impl_state!(Heard { features });

/// The node over [`WarpMap::fit`].
#[derive(Debug)]
pub struct TpsFit {
    heard: Heard,
    params: TpsFitParams,
}

/// Longest target, in units: a day at 240 units per second.
const LONGEST: i64 = 86_400 * 240;

fn target(features: &Incoming<Features>) -> Result<Target, Reject> {
    let units = features.items().filter(|units| *units <= LONGEST).ok_or_else(|| {
        let found = features.items().map_or("do not end".into(), |n| format!("hold {n} units"));
        let message = format!("`features` {found}; a target of at most {LONGEST} units is needed");
        Reject::new("F075", message).at("features").help("cut the stream, or fit offline and use WarpFile")
    })?;
    Ok(Target {
        units: units.max(0) as usize,
        vectors: features.format.vectors,
        rate: features.rate.as_f64(),
    })
}

fn check(
    set: &CorrespondenceSet,
    target: Target,
    features: &FeatureFormat,
    db: &UnitDatabase,
) -> Result<Vec<Stretch>, Reject> {
    db.validate().map_err(|e| Reject::new("F111", e.to_string()).at("database"))?;
    features.conventions.check("features", &db.conventions, "database")?;
    stretches(set, target, db).map_err(|e| Reject::new("F110", e.to_string()).at("pairs"))
}

/// Checks what a fit needs before anything runs.
pub(super) fn checked(
    features: &Incoming<Features>,
    database: Option<Arc<UnitDatabase>>,
    pairs: Option<Arc<CorrespondenceSet>>,
) -> Result<(), Reject> {
    let target = target(features)?;
    if let (Some(database), Some(pairs)) = (database, pairs) {
        check(&pairs, target, &features.format, &database)?;
    }
    Ok(())
}

impl Heard {
    /// Room for a target.
    pub fn new(
        features: Incoming<Features>,
        database: Arc<UnitDatabase>,
        pairs: Arc<CorrespondenceSet>,
    ) -> Result<Self, Reject> {
        let target = target(&features)?;
        check(&pairs, target, &features.format, &database)?;
        Ok(Self {
            rate: target.rate,
            units: target.units,
            features: Vec::with_capacity(target.units * target.vectors * features.format.dims()),
            format: features.format,
            database,
            pairs,
        })
    }

    /// Adds a window, without what stands after the end of the target.
    pub fn add(&mut self, items: &[f32]) {
        let most = self.units * self.format.vectors * self.format.dims();
        let left = most - self.features.len().min(most);
        self.features.extend(items.iter().take(left));
    }

    /// The pairs of every vector, each with its correspondence.
    pub fn pairs(&self, pairing: Pairing) -> Result<Vec<Vec<(usize, Pair)>>, Fault> {
        let (vectors, d) = (self.format.vectors, self.format.dims().max(1));
        if let Some(bad) = self.features.iter().position(|x| !x.is_finite()) {
            let message =
                format!("features of unit {} hold {}", bad / (vectors * d).max(1), self.features[bad]);
            return Err(Fault::new("F111", message).at("features"));
        }
        let units = self.features.len() / (vectors * d).max(1);
        let target = Target { units, vectors, rate: self.rate };
        let found = check(&self.pairs, target, &self.format, &self.database)?;
        let of =
            |vector| pairs(&found, vector, pairing, &self.pairs, (&self.features, vectors), &self.database);
        Ok((0..vectors).map(of).collect())
    }

    /// Length of the target, s.
    pub fn seconds(&self) -> f64 {
        self.units as f64 / self.rate
    }

    /// Warnings of correspondences that were marked in another target or in other recordings.
    pub fn strange(&self) -> Summary {
        let (set, mut told) = (&*self.pairs, Summary::new());
        // Two units: how many the end of a sound makes depends on its rate.
        if let Some(length) = set.length.filter(|length| (length - self.seconds()).abs() * self.rate > 2.0) {
            let text = format!(
                "{} was marked in {:?}, which lasts {length:.3} s; this target lasts {:.3} s: other moments may be marked. Mark \
                 them anew, or change `length` there",
                set.file,
                set.target,
                self.seconds()
            );
            told.push(("warning", text.into()));
        }
        let recordings = self.database.recordings();
        if !set.database.is_empty() && set.database != recordings {
            let text = format!(
                "{} was marked in the recordings {:?}; the database has {recordings:?}: other moments may be marked. Mark them anew, \
                 or change `database` there",
                set.file, set.database
            );
            told.push(("warning", text.into()));
        }
        told
    }

    /// Features of one vector of all units, `[units, d]`.
    pub fn vector(&self, vector: usize) -> Vec<f32> {
        let (vectors, d) = (self.format.vectors.max(1), self.format.dims().max(1));
        self.features.chunks_exact(d).skip(vector).step_by(vectors).flatten().copied().collect()
    }
}

impl Node for TpsFit {
    type Params = TpsFitParams;
    type Ports = TpsFitPorts;
    const NAME: &'static str = "TpsFit";
    const VERSION: u32 = 6;
    const CLASS: Class = Class::Offline;

    fn shape(_: &TpsFitParams, s: &mut Shape<'_, '_, TpsFitPorts>) -> Result<(), Reject> {
        checked(
            &s.input(TpsFitPorts::features),
            s.value(TpsFitPorts::database),
            s.value(TpsFitPorts::pairs),
        )?;
        s.when_ended(TpsFitPorts::features, Ends::Stop);
        Ok(())
    }

    fn build(p: &TpsFitParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let features = cx.input(TpsFitPorts::features);
        let heard = Heard::new(features, cx.value(TpsFitPorts::database), cx.value(TpsFitPorts::pairs))?;
        Ok(Self { heard, params: p.clone() })
    }

    fn run(&mut self, io: TpsFitIo<'_>) -> Result<(), Fault> {
        self.heard.add(io.features.items());
        Ok(())
    }

    fn finish(&mut self, mut io: TpsFitIo<'_>) -> Result<Summary, Fault> {
        let warp = self.warp()?;
        let mut summary = warp.summary();
        summary.extend(self.heard.strange());
        io.warp.set(warp);
        Ok(summary)
    }

    archive_state!(heard);
}

/// The stiffness that parameters ask for.
pub(super) fn stiffness(lambda: Option<f64>, scale_free: bool) -> Stiffness {
    match (lambda, scale_free) {
        (None, _) => Stiffness::Auto,
        (Some(lambda), false) => Stiffness::Lambda(lambda),
        (Some(lambda), true) => Stiffness::ScaleFree(lambda),
    }
}

impl TpsFit {
    fn warp(&self) -> Result<Warp, Fault> {
        let (heard, d) = (&self.heard, self.heard.format.dims());
        let stiffness = stiffness(self.params.lambda, self.params.scale_free);
        let map = |(vector, pairs): (usize, Vec<_>)| {
            let pairs: Vec<Pair> = pairs.into_iter().map(|(_, pair)| pair).collect();
            WarpMap::fit(&pairs, d, stiffness, &heard.vector(vector), &heard.database.features)
                .map_err(|e| Fault::new("F111", e.to_string()).at("pairs"))
        };
        Ok(Warp {
            version: WARP_VERSION,
            conventions: heard.database.conventions.clone(),
            maps: heard
                .pairs(self.params.pairing)?
                .into_iter()
                .enumerate()
                .map(map)
                .collect::<Result<_, _>>()?,
            correspondences: heard.pairs.file.clone(),
            recordings: heard.database.sources.iter().map(|s| s.provenance.clone()).collect(),
            contents: heard.database.sources.iter().map(|s| s.content.clone()).collect(),
            correspondences_content: heard.pairs.content(),
            content: String::new(),
        }
        .sealed())
    }
}
