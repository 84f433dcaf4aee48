//! The book: its links lead somewhere, its graphs are right, and its generated pages are up to date.

use clap::CommandFactory as _;
use foley::cli::Args;
use foley::diag::{Severity, render};
use foley::docs::{anchor, pages};
use foley::graph::{LoadOptions, load_text};
use foley::lang::parse;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn markdown(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            markdown(&path, found);
        } else if path.extension().is_some_and(|e| e == "md") {
            found.push(path);
        }
    }
    found.sort();
}

fn book() -> Vec<(PathBuf, String)> {
    let mut all = Vec::new();
    markdown(&root().join("docs/src"), &mut all);
    all.into_iter().map(|p| (p.clone(), fs::read_to_string(p).unwrap())).collect()
}

/// The text without its blocks of code, and the blocks with their language and text.
fn split(text: &str) -> (String, Vec<(String, String)>) {
    let (mut prose, mut blocks) = (String::new(), Vec::new());
    let mut open: Option<(String, String)> = None;
    for line in text.lines() {
        match (&mut open, line.strip_prefix("```")) {
            (None, Some(mark)) => open = Some((mark.to_owned(), String::new())),
            (None, None) => prose.push_str(&format!("{line}\n")),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some((_, block)), None) => block.push_str(&format!("{line}\n")),
        }
    }
    assert!(open.is_none(), "a block of code has no end");
    (prose, blocks)
}

/// The targets of all links in a text, code spans left out.
fn links(prose: &str) -> Vec<String> {
    let plain: String = prose.split('`').step_by(2).collect();
    plain.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
}

fn anchors(prose: &str) -> BTreeSet<String> {
    prose.lines().filter_map(|l| Some(anchor(l.trim_start_matches('#').strip_prefix(' ')?))).collect()
}

#[test]
fn every_link_in_the_book_leads_somewhere() {
    let mut count = 0;
    for (path, text) in book() {
        for link in links(&split(&text).0) {
            if link.starts_with("https://") {
                continue;
            }
            count += 1;
            let (file, at) = link.split_once('#').unwrap_or((&link, ""));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            assert!(target.is_file(), "{}: {link} leads nowhere", path.display());
            if !at.is_empty() {
                let text = fs::read_to_string(&target).unwrap();
                assert!(
                    anchors(&split(&text).0).contains(at),
                    "{}: {link} has no such heading",
                    path.display()
                );
            }
        }
    }
    assert!(count > 50, "only {count} links were found");
}

#[test]
fn every_page_stands_in_the_summary() {
    let folder = root().join("docs/src");
    let summary = fs::read_to_string(folder.join("SUMMARY.md")).unwrap();
    let listed: BTreeSet<PathBuf> = links(&summary).into_iter().map(|l| folder.join(l)).collect();
    for (path, _) in book() {
        assert!(listed.contains(&path) || path.ends_with("SUMMARY.md"), "{} is not listed", path.display());
    }
}

#[test]
fn graphs_in_the_book_and_in_the_errors_are_right() {
    let mut whole = 0;
    for (path, text) in book() {
        for (mark, block) in split(&text).1 {
            if mark != "ron" {
                continue;
            }
            let entries = format!("#![schema = \"foley:graph/1\"]\nGraph(nodes: {{\n{block}}})");
            let fields = format!("#![schema = \"foley:graph/1\"]\nGraph(\n{block})");
            // A piece that begins with an id is a piece of `nodes`, another one of `Graph`.
            let piece = if block.starts_with('"') { &entries } else { &fields };
            let Some(text) = [&block, piece].into_iter().find(|t| parse(t).is_ok()) else {
                panic!("{}: no RON:\n{block}", path.display());
            };
            whole += usize::from(*text == block);
            // A piece links to nodes outside it, and files are only there in the reader's folder.
            let outside = ["F020", "F021", "F060", "F062"];
            let loaded = load_text("book.ron", text, Path::new("book.ron"), &LoadOptions::default());
            let wrong: Vec<_> = (loaded.diagnostics.into_iter())
                .filter(|d| d.severity == Severity::Error && !outside.contains(&d.code))
                .collect();
            assert!(wrong.is_empty(), "{}:\n{}", path.display(), render(&wrong, &loaded.sources, false));
        }
    }
    assert!(whole > 2);
}

#[test]
fn generated_pages_are_up_to_date() {
    for (path, text) in pages(root(), Args::command(), &foley::Registry::standard()).unwrap() {
        let stored = fs::read_to_string(root().join("docs/src").join(&path)).unwrap_or_default();
        assert!(stored == text, "docs/src/{path} is not up to date: run `foley docs --write`");
    }
}

#[test]
fn the_first_graph_of_the_book_is_that_of_a_new_project() {
    let page = fs::read_to_string(root().join("docs/src/first-sound.md")).unwrap();
    let blocks = split(&page).1;
    let (_, shown) = blocks.iter().find(|(mark, _)| mark == "ron").unwrap();
    let template = foley::cli::template("wind");
    let plain = |text: &str| -> String {
        text.lines().filter(|l| !l.trim_start().starts_with("//")).map(|l| format!("{l}\n")).collect()
    };
    assert_eq!(plain(shown), plain(&template[0].1));
}
