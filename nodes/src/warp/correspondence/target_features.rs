//! Features of a target, gathered to its end, with the database and the correspondences that they are compared with.

use std::sync::Arc;

use super::pairing::{Interval, Pairing, Target, intervals, pairs};
use super::set::CorrespondenceSet;
use crate::core::fault::{Fault, Reject};
use crate::core::node::Summary;
use crate::core::shape::Incoming;
use crate::feature::{FeatureFormat, Features};
use crate::impl_state;
use crate::unit::UnitDatabase;
use crate::warp::spline::Pair;

/// Features of a target up to its end, with its database and correspondences.
#[derive(Debug)]
pub(in crate::warp) struct TargetFeatures {
    pub format: FeatureFormat,
    pub rate: f64,
    units: usize,
    pub features: Vec<f32>,
    pub database: Arc<UnitDatabase>,
    pub pairs: Arc<CorrespondenceSet>,
}
impl_state!(TargetFeatures { features });

/// Longest target, in units: a day at 240 units per second.
const MAX_UNITS: i64 = 86_400 * 240;

fn target(features: &Incoming<Features>) -> Result<Target, Reject> {
    let units = features.items().filter(|units| *units <= MAX_UNITS).ok_or_else(|| {
        let found = features.items().map_or("do not end".into(), |n| format!("hold {n} units"));
        let message = format!("`features` {found}; a target of at most {MAX_UNITS} units is needed");
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
) -> Result<Vec<Interval>, Reject> {
    db.validate().map_err(|e| Reject::new("F111", e.to_string()).at("database"))?;
    features.conventions.check("features", &db.conventions, "database")?;
    intervals(set, target, db).map_err(|e| Reject::new("F110", e.to_string()).at("pairs"))
}

/// Checks the requirements of a fit before anything runs.
pub(in crate::warp) fn checked(
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

impl TargetFeatures {
    /// Allocates memory for a target.
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

    /// Adds a window, without items after the end of the target.
    pub fn add(&mut self, items: &[f32]) {
        let capacity = self.units * self.format.vectors * self.format.dims();
        let left = capacity - self.features.len().min(capacity);
        self.features.extend(items.iter().take(left));
    }

    /// The pairs of all vectors in one list, or with `per_channel` in one list for each vector; each pair with its correspondence.
    pub fn pairs(&self, pairing: Pairing, per_channel: bool) -> Result<Vec<Vec<(usize, Pair)>>, Fault> {
        let (vectors, d) = (self.format.vectors, self.format.dims().max(1));
        if let Some(bad) = self.features.iter().position(|x| !x.is_finite()) {
            let message =
                format!("features of unit {} hold {}", bad / (vectors * d).max(1), self.features[bad]);
            return Err(Fault::new("F111", message).at("features"));
        }
        let units = self.features.len() / (vectors * d).max(1);
        let target = Target { units, vectors, rate: self.rate };
        let found = check(&self.pairs, target, &self.format, &self.database)?;
        let of = |intervals: &[Interval]| {
            pairs(intervals, pairing, &self.pairs, (&self.features, vectors), &self.database)
        };
        if !per_channel {
            return Ok(vec![of(&found)]);
        }
        let own = |vector| found.iter().filter(|s| s.vector == vector).cloned().collect::<Vec<_>>();
        Ok((0..vectors).map(|vector| of(&own(vector))).collect())
    }

    /// Length of the target, s.
    pub fn seconds(&self) -> f64 {
        self.units as f64 / self.rate
    }

    /// Warnings about correspondences that were marked in another target or in other recordings.
    pub fn mismatch_warnings(&self) -> Summary {
        let (set, mut warnings) = (&*self.pairs, Summary::new());
        // Two units: how many the end of a sound makes depends on its rate.
        if let Some(length) = set.length.filter(|length| (length - self.seconds()).abs() * self.rate > 2.0) {
            let text = format!(
                "{} was marked in {:?}, which lasts {length:.3} s; this target lasts {:.3} s: other moments may be marked. Mark \
                 them again, or change `length` there",
                set.file,
                set.target,
                self.seconds()
            );
            warnings.push(("warning", text.into()));
        }
        let recordings = self.database.recordings();
        if !set.database.is_empty() && set.database != recordings {
            let text = format!(
                "{} was marked in the recordings {:?}; the database has {recordings:?}: other moments may be marked. Mark them again, \
                 or change `database` there",
                set.file, set.database
            );
            warnings.push(("warning", text.into()));
        }
        warnings
    }

    /// Features of one vector of all units, `[units, d]`.
    pub fn vector(&self, vector: usize) -> Vec<f32> {
        let (vectors, d) = (self.format.vectors.max(1), self.format.dims().max(1));
        self.features.chunks_exact(d).skip(vector).step_by(vectors).flatten().copied().collect()
    }
}
