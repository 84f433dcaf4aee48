//! Scores and edit lists: rejected with a location, or scores that are written and read again.
#![no_main]

use foley_nodes::soundtrack::score::{EditRules, edits_to_score, read_edits, read_score, write_score};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(list) = read_edits(bytes, 25.0)
        && let Ok(score) = edits_to_score(&list.edits, &EditRules::default())
    {
        assert!(read_score(&write_score(&score, &[])).is_ok());
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(score) = read_score(text) {
        let again = read_score(&write_score(&score, &[])).map(|s| (s.sources.len(), s.targets.len()));
        assert_eq!(again, Ok((score.sources.len(), score.targets.len())));
    }
});
