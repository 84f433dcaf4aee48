//! Digests of what artefacts hold, so that a change by hand is seen.

use serde::Serialize;

/// Digest of an artefact whose own digest is left empty.
#[must_use]
pub fn content_digest(artefact: &impl Serialize) -> String {
    // Numbers are written so that they are read as the same ones again.
    let text = serde_json::to_vec(artefact).unwrap_or_default();
    blake3::hash(&text).to_hex()[..16].to_owned()
}

/// What tells that an artefact of a file is not the one that was written, if anything: the digest that it carries is not that of what
/// it holds. `remedy` says how another one is made: `fit it`.
#[must_use]
pub fn altered_content(found: &str, wanted: &str, remedy: &str) -> Option<String> {
    (!found.is_empty() && found != wanted).then(|| {
        let found: String = found.chars().take(40).collect();
        format!(
            "`content` is {found:?}, and the digest of what the file holds is {wanted:?}: it was changed by hand; {remedy} again, or \
             leave `content` out"
        )
    })
}
