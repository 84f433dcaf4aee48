//! Everything that the book shows runs: its graphs, their pieces, its commands, and what they print.

use super::reader::follow;
use rayon::prelude::*;
use std::fs;
use std::path::Path;

/// Names and texts of the pages that `wanted` selects; the reference is generated.
fn pages(wanted: impl Fn(&str) -> bool) -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src");
    let mut found: Vec<(String, String)> = (fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), path))
        .filter(|(name, _)| name.ends_with(".md") && wanted(name))
        .map(|(name, path)| (name, fs::read_to_string(path).unwrap()))
        .collect();
    found.sort();
    assert!(!found.is_empty());
    found
}

fn follow_all(pages: Vec<(String, String)>, long: bool) {
    let wrong: Vec<String> =
        pages.par_iter().flat_map_iter(|(name, page)| follow(name, page, long)).collect();
    assert!(wrong.is_empty(), "{} of what these pages show is not so:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn what_the_tutorials_show_runs() {
    follow_all(pages(|name| name.starts_with("tutorial_")), false);
}

#[test]
fn what_the_other_pages_show_runs() {
    follow_all(pages(|name| !name.starts_with("tutorial_")), false);
}

#[test]
#[ignore = "takes several minutes"]
fn the_long_commands_of_the_book_run() {
    follow_all(pages(|_| true), true);
}
