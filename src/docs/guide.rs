//! The pages of the book that people write, in the program.

/// Names and texts of the pages, in the order of the book.
pub const GUIDE: &[(&str, &str)] = &[
    ("introduction", include_str!("../../docs/src/introduction.md")),
    ("first-sound", include_str!("../../docs/src/first-sound.md")),
    ("tutorial_cloth", include_str!("../../docs/src/tutorial_cloth.md")),
    ("tutorial_material", include_str!("../../docs/src/tutorial_material.md")),
    ("tutorial_grains", include_str!("../../docs/src/tutorial_grains.md")),
    ("tutorial_numbers", include_str!("../../docs/src/tutorial_numbers.md")),
    ("tutorial_texture", include_str!("../../docs/src/tutorial_texture.md")),
    ("graphs", include_str!("../../docs/src/graphs.md")),
    ("editors", include_str!("../../docs/src/editors.md")),
    ("running", include_str!("../../docs/src/running.md")),
    ("watching", include_str!("../../docs/src/watching.md")),
    ("live", include_str!("../../docs/src/live.md")),
    ("time", include_str!("../../docs/src/time.md")),
    ("taps", include_str!("../../docs/src/taps.md")),
    ("probing", include_str!("../../docs/src/probing.md")),
    ("cloth", include_str!("../../docs/src/cloth.md")),
    ("crumple", include_str!("../../docs/src/crumple.md")),
    ("impact", include_str!("../../docs/src/impact.md")),
    ("material", include_str!("../../docs/src/material.md")),
    ("damping_experiments", include_str!("../../docs/src/damping_experiments.md")),
    ("shape_to_modes", include_str!("../../docs/src/shape_to_modes.md")),
    ("texture", include_str!("../../docs/src/texture.md")),
    ("contacts", include_str!("../../docs/src/contacts.md")),
    ("scraping", include_str!("../../docs/src/scraping.md")),
    ("grains", include_str!("../../docs/src/grains.md")),
    ("numbers", include_str!("../../docs/src/numbers.md")),
    ("mixing", include_str!("../../docs/src/mixing.md")),
    ("levels", include_str!("../../docs/src/levels.md")),
    ("writing-a-node", include_str!("../../docs/src/writing-a-node.md")),
    ("library", include_str!("../../docs/src/library.md")),
    ("performance", include_str!("../../docs/src/performance.md")),
    ("from-another-tool", include_str!("../../docs/src/from-another-tool.md")),
    ("promises", include_str!("../../docs/src/promises.md")),
    ("limits", include_str!("../../docs/src/limits.md")),
    ("glossary", include_str!("../../docs/src/glossary.md")),
];

/// The title of a page: its first heading.
#[must_use]
pub fn title(text: &str) -> &str {
    text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_page_of_the_guide_is_in_the_program_with_a_title() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src");
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        let names = files.filter_map(|name| Some(name.to_str()?.strip_suffix(".md")?.to_owned()));
        let on_disk: BTreeSet<String> = names.filter(|name| name != "SUMMARY").collect();
        let embedded: BTreeSet<String> = GUIDE.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(on_disk, embedded);
        assert!(GUIDE.iter().all(|(_, text)| !title(text).is_empty()));
    }
}
