//! The patterns of one recording, and sources by tags.

use crate::core::fault::Fault;
use crate::core::time::Rate;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;

/// Returns the patterns of a recording: of the first one whose file name contains `name`, or of the first of all.
///
/// # Errors
/// A name that occurs in none.
pub(super) fn patterns_of<'a>(
    patterns: &'a CorrelationPatterns,
    name: &str,
) -> Result<Vec<&'a Pattern>, Fault> {
    let found = patterns.patterns.iter().find(|p| p.name.contains(name)).map(|p| p.name.as_str());
    let Some(found) = found else {
        let mut names: Vec<&str> =
            patterns.patterns.iter().map(|p| p.name.rsplit('/').next().unwrap_or_default()).collect();
        names.dedup();
        names.truncate(12);
        let message = format!("no recording is named {name:?}");
        return Err(Fault::new("F151", message)
            .at("recording")
            .help(format!("there are {}", names.join(", "))));
    };
    Ok(patterns.patterns.iter().filter(|p| p.name == found).collect())
}

/// Checks that patterns are valid and belong to a dictionary.
///
/// # Errors
/// The first thing found.
pub(crate) fn check_patterns(
    patterns: &CorrelationPatterns,
    dictionary: &GrainDictionary,
) -> Result<(), Fault> {
    patterns.validate(dictionary).map_err(|e| Fault::new("F151", e.to_string()).at("patterns"))
}

/// Checks that a dictionary has the rate of an output.
pub(crate) fn check_rate(dictionary: &GrainDictionary, rate: Rate) -> Result<(), Fault> {
    if (dictionary.rate - rate.as_f64()).abs() < 1e-9 {
        return Ok(());
    }
    let message = format!("the grains have {} Hz, `rate` is {} Hz", dictionary.rate, rate.as_f64());
    let help = "set `rate` to that of the grains, or `rate` of GrainRecordings to this one";
    Err(Fault::new("F150", message).at("rate").help(help))
}
