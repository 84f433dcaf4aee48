//! The tutorials: their whole graphs run, and what they name exists.

use crate::common::graphs;
use foley::Session;
use std::fs;
use std::path::Path;

/// Names and texts of the tutorials.
fn tutorials() -> Vec<(String, String)> {
    let pages = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src")).unwrap();
    let mut found: Vec<(String, String)> = pages
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), path))
        .filter(|(name, _)| name.starts_with("tutorial_") && name.ends_with(".md"))
        .map(|(name, path)| (name, fs::read_to_string(path).unwrap()))
        .collect();
    found.sort();
    assert!(found.len() >= 5, "only {} tutorials", found.len());
    found
}

/// Blocks of code of one language, each with the line before it.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<(&'a str, String)> {
    let lines: Vec<&str> = page.lines().collect();
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(open) = (at..lines.len()).find(|k| lines[*k].starts_with("```")) {
        let close = (open + 1..lines.len()).find(|k| lines[*k] == "```").unwrap();
        if lines[open] == format!("```{language}") {
            found.push((lines[open.max(1) - 1], lines[open + 1..close].join("\n")));
        }
        at = close + 1;
    }
    found
}

/// Paths of graphs in a text.
fn paths(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c.is_whitespace() || "`'\"(),:;=[]".contains(c))
        .filter(|word| word.starts_with("graphs/") && word.ends_with(".ron"))
}

/// True for a graph that ships, and for one that the reader writes, `my_*.ron` in a folder of graphs that ship.
fn is_there(path: &str) -> bool {
    let file = graphs().parent().unwrap().join(path);
    let own = file.file_name().unwrap().to_string_lossy().starts_with("my_");
    if own { file.parent().unwrap().is_dir() } else { file.is_file() }
}

#[test]
fn whole_graphs_of_the_tutorials_run_and_write_sound() {
    for (name, page) in tutorials() {
        let whole: Vec<_> =
            blocks(&page, "ron").into_iter().filter(|(_, text)| text.starts_with("#![schema")).collect();
        assert!(!whole.is_empty(), "{name} has no whole graph");
        for (before, text) in whole {
            let folder = before.strip_prefix("<!-- graphs/").and_then(|rest| rest.strip_suffix(" -->"));
            let folder = folder.unwrap_or_else(|| panic!("{name}: no folder before a graph: {before}"));
            // A marked part of a motion must not be cut.
            let until = (!text.contains("MotionQuery(")).then_some(1.0);
            let session = Session::from_text(text, graphs().join(folder)).with_until(until).with_quiet(true);
            let (report, _) = session.render_to_memory().unwrap_or_else(|e| panic!("{name}: {e}"));
            let peaks = report.outputs.iter().filter_map(|output| output.facts.get("peak")?.as_f64());
            assert!(peaks.fold(0.0, f64::max) > 1e-3, "{name} is silent");
        }
    }
}

#[test]
fn graphs_that_the_tutorials_name_exist() {
    for (name, page) in tutorials() {
        for path in paths(&page).filter(|path| !path.ends_with(".test.ron")) {
            assert!(is_there(path), "{name}: there is no {path}");
        }
        let texts = blocks(&page, "text");
        let mut count = 0;
        for command in
            texts.iter().flat_map(|(_, text)| text.lines()).filter(|line| line.starts_with("foley "))
        {
            let words: Vec<&str> = command.split([' ', '=']).collect();
            for path in words.iter().filter(|word| word.starts_with("graphs/") && !word.contains('*')) {
                assert!(is_there(path), "{name}: there is no {path}: {command}");
            }
            if ["run", "probe", "test", "graph", "check"].contains(&words[1]) {
                assert!(words[2].ends_with(".ron") && is_there(words[2]), "{name}: no graph: {command}");
                count += 1;
            }
        }
        assert!(count >= 5, "{name} has {count} commands");
    }
}
