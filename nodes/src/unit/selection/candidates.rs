//! Units of a database that a node may choose from, and the errors of databases and targets that do not match.

use std::sync::Arc;

use super::selector::{MAX_DIMS, Units};
use crate::core::fault::{Fault, Reject};
use crate::core::params::Text;
use crate::core::ports::In;
use crate::feature::{FeatureFormat, Features};
use crate::unit::UnitDatabase;

/// True for each unit that the tags allow.
pub(super) fn allowed(db: &UnitDatabase, tags: &[Text]) -> Vec<bool> {
    let allows = |tag: &str| tags.is_empty() || tags.iter().any(|allowed| allowed.0 == tag);
    let mut out = vec![false; db.len()];
    for segment in &db.segments {
        if db.sources.get(segment.source as usize).is_some_and(|source| allows(&source.tag)) {
            out[segment.range()].fill(true);
        }
    }
    out
}

/// Units that the tags allow, or an error that lists the existing tags.
pub(crate) fn check_tags(db: &UnitDatabase, tags: &[Text]) -> Result<Vec<bool>, Reject> {
    let allowed = allowed(db, tags);
    if allowed.contains(&true) {
        return Ok(allowed);
    }
    let mut known: Vec<&str> = db.sources.iter().map(|source| source.tag.as_str()).collect();
    known.sort_unstable();
    known.dedup();
    let wanted: Vec<&str> = tags.iter().map(|tag| tag.0.as_str()).collect();
    let message = format!("no recording of the database has a tag of {wanted:?}");
    Err(Reject::new("F101", message).at("tags").help(format!("it has {known:?}")))
}

/// Refuses features that cannot be compared with a database.
pub(crate) fn comparable(
    format: &FeatureFormat,
    db: Option<Arc<UnitDatabase>>,
    tags: &[Text],
) -> Result<(), Reject> {
    if format.dims() > MAX_DIMS {
        let message =
            format!("feature vectors of {} numbers; at most {MAX_DIMS} are searched", format.dims());
        return Err(Reject::new("F051", message).at("features"));
    }
    if let Some(db) = db {
        format.conventions.check("features", &db.conventions, "database")?;
        check_tags(&db, tags)?;
    }
    Ok(())
}

/// The units of a valid database whose features have the same conventions.
pub(crate) fn units<'a>(
    format: &FeatureFormat,
    db: &'a UnitDatabase,
    tags: &[Text],
) -> Result<Units<'a>, Fault> {
    format.conventions.check("features", &db.conventions, "database")?;
    db.validate().map_err(|e| Fault::new("F101", e.to_string()).at("database"))?;
    Ok(Units { allowed: check_tags(db, tags)?, ..Units::from(db) })
}

/// The fault of a database without units to choose from.
pub(crate) fn no_unit() -> Fault {
    Fault::new("F101", "there is no unit to choose from").at("database")
}

/// Warning about a database with no more units than `cool_off` excludes.
pub(super) fn few_units_warning(units: &Units<'_>, look: usize, cool_off: usize) -> Option<String> {
    let whole = units.segments.iter().flat_map(|(start, len)| *start..start + len.saturating_sub(look));
    let found = units.different(whole);
    (cool_off > 0 && found <= cool_off).then(|| {
        format!(
            "{found} units can be chosen, and each is excluded for {cool_off} units after its use (`cool_off`), so that they play in \
             turn: give longer recordings, or lower `cool_off`"
        )
    })
}

/// The fault of a target with a number that is not finite.
pub(super) fn not_finite(features: &In<'_, Features>, at: i64) -> Fault {
    Fault::new("F102", format!("a feature of unit {at} of the target is not a finite number"))
        .at("features")
        .when(features.rate().tick(at))
}
