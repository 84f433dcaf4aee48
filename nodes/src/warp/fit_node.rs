//! Fitting a warp, as a node.

use std::sync::Arc;

use super::artefact::{WARP_VERSION, Warp, WarpMap};
use super::fit::Stiffness;
use super::pairing::{Pairing, Stretch, Target, pairs, stretches};
use super::set::CorrespondenceSet;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::shape::{Build, Ends, Incoming, Shape};
use crate::feature::{FeatureFormat, Features};
use crate::unit::UnitDatabase;
use crate::{choices, params, ports};

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
    /// nodes, the share of the target where the warp folds over, and the share that is farther from the middle of the nodes than
    /// twice their radius, where the warp is a guess. A tap of `warp` as SVG draws both worlds before and after. No correspondence
    /// gives a warp that changes nothing. Which ones do not fit is told before the run where the database is known by then.
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

/// The node over [`WarpMap::fit`].
#[derive(Debug)]
pub struct TpsFit {
    format: FeatureFormat,
    rate: f64,
    units: usize,
    features: Vec<f32>,
    database: Arc<UnitDatabase>,
    pairs: Arc<CorrespondenceSet>,
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

impl Node for TpsFit {
    type Params = TpsFitParams;
    type Ports = TpsFitPorts;
    const NAME: &'static str = "TpsFit";
    const CLASS: Class = Class::Offline;

    fn shape(_: &TpsFitParams, s: &mut Shape<'_, '_, TpsFitPorts>) -> Result<(), Reject> {
        let features = s.input(TpsFitPorts::features);
        let target = target(&features)?;
        if let (Some(db), Some(set)) = (s.value(TpsFitPorts::database), s.value(TpsFitPorts::pairs)) {
            check(&set, target, &features.format, &db)?;
        }
        s.when_ended(TpsFitPorts::features, Ends::Stop);
        Ok(())
    }

    fn build(p: &TpsFitParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let features = cx.input(TpsFitPorts::features);
        let target = target(&features)?;
        let (database, pairs) = (cx.value(TpsFitPorts::database), cx.value(TpsFitPorts::pairs));
        check(&pairs, target, &features.format, &database)?;
        Ok(Self {
            rate: target.rate,
            units: target.units,
            features: Vec::with_capacity(target.units * target.vectors * features.format.dims()),
            format: features.format,
            database,
            pairs,
            params: p.clone(),
        })
    }

    fn run(&mut self, io: TpsFitIo<'_>) -> Result<(), Fault> {
        let most = self.units * self.format.vectors * self.format.dims();
        let left = most - self.features.len().min(most);
        self.features.extend(io.features.items().iter().take(left));
        Ok(())
    }

    fn finish(&mut self, mut io: TpsFitIo<'_>) -> Result<Summary, Fault> {
        let warp = self.warp()?;
        let summary = warp.summary();
        io.warp.set(warp);
        Ok(summary)
    }
}

impl TpsFit {
    fn warp(&self) -> Result<Warp, Fault> {
        let (vectors, d) = (self.format.vectors, self.format.dims().max(1));
        let units = self.features.len() / (vectors * d).max(1);
        if let Some(bad) = self.features.iter().position(|x| !x.is_finite()) {
            let message = format!("features of unit {} hold {}", bad / (vectors * d), self.features[bad]);
            return Err(Fault::new("F111", message).at("features"));
        }
        let target = Target { units, vectors, rate: self.rate };
        let found = check(&self.pairs, target, &self.format, &self.database)?;
        let stiffness = match (self.params.lambda, self.params.scale_free) {
            (None, _) => Stiffness::Auto,
            (Some(lambda), false) => Stiffness::Lambda(lambda),
            (Some(lambda), true) => Stiffness::ScaleFree(lambda),
        };
        let map = |vector: usize| {
            let features = (&self.features[..], vectors);
            let pairs = pairs(&found, vector, self.params.pairing, &self.pairs, features, &self.database);
            let pairs: Vec<_> = pairs.into_iter().map(|(_, pair)| pair).collect();
            let own: Vec<f32> =
                self.features.chunks_exact(d).skip(vector).step_by(vectors).flatten().copied().collect();
            WarpMap::fit(&pairs, d, stiffness, &own, &self.database.features)
                .map_err(|e| Fault::new("F111", e.to_string()).at("pairs"))
        };
        Ok(Warp {
            version: WARP_VERSION,
            conventions: self.database.conventions.clone(),
            maps: (0..vectors).map(map).collect::<Result<_, _>>()?,
            correspondences: self.pairs.file.clone(),
            recordings: self.database.sources.iter().map(|s| s.provenance.clone()).collect(),
        })
    }
}
