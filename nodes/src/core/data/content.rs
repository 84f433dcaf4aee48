//! Digests of the contents of artefacts and recordings, which detect changes.

use serde::Serialize;

/// Digest of an artefact whose own digest is left empty.
///
/// `later` are fields that came after the first such digests, written as JSON writes them where they hold nothing, with the comma
/// behind: they count only where they hold something, so that the digest of older files does not change.
#[must_use]
pub fn content_digest(artefact: &impl Serialize, later: &[&str]) -> String {
    // Numbers are written so that they are read as the same ones again.
    let text = serde_json::to_string(artefact).unwrap_or_default();
    // Quotes inside of a text are escaped: a field's name with quotes stands nowhere else.
    let text = later.iter().fold(text, |text, field| text.replacen(field, "", 1));
    blake3::hash(text.as_bytes()).to_hex()[..16].to_owned()
}

/// Digest of the decoded samples of a recording, independent of the name of its file.
#[must_use]
pub fn audio_digest(rate: u32, channels: usize, samples: &[f32]) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&rate.to_le_bytes()).update(&(channels as u64).to_le_bytes());
    let mut bytes = Vec::with_capacity(4 * 4096);
    for part in samples.chunks(4096) {
        bytes.clear();
        bytes.extend(part.iter().flat_map(|x| x.to_le_bytes()));
        hasher.update(&bytes);
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// Returns an error message if an artefact was changed after it was written: its digest differs from that of what
/// it holds. `remedy` states how to make another one: `fit it`.
#[must_use]
pub fn altered_content(found: &str, wanted: &str, remedy: &str) -> Option<String> {
    (!found.is_empty() && found != wanted).then(|| {
        let found: String = found.chars().take(40).collect();
        format!(
            "`content` is {found:?}, but the digest of the contents of the file is {wanted:?}: it was changed by hand; {remedy} again, \
             or leave `content` out"
        )
    })
}
