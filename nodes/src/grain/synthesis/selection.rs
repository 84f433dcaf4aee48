//! The patterns of one recording, and sources by tags.

use crate::core::fault::Fault;
use crate::grain::correlation::{CorrelationPatterns, Pattern};

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
