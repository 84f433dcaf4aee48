//! A fixed-seed fuzzer of the checker: damaged graphs never end in a panic, and never in neither a graph nor an error.

use foley::diag::{any_error, json, render};
use foley::draw::{Drawing, svg};
use foley::graph::{DirFiles, Limits, LoadOptions, Override, load_text};
use foley::lang::parse;
use foley::plan::{PlanOptions, sound_shapes};
use foley_nodes::core::random::Rng;
use std::fs;
use std::path::Path;

/// Graphs to damage: the cases of the diagnostics, which hold every part of the format.
fn seeds() -> Vec<String> {
    let mut paths: Vec<_> = fs::read_dir("tests/diagnostics").unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    let texts = paths.iter().filter(|p| p.extension().is_some_and(|e| e == "ron"));
    let mut all: Vec<String> = texts.map(|p| fs::read_to_string(p).unwrap()).collect();
    all.push(foley::cli::template("wind")[0].1.clone());
    all
}

/// The tokens of a text, white space and comments among them.
fn tokens(text: &str) -> Vec<String> {
    let elements = parse(text).syntax().descendants_with_tokens();
    elements.filter_map(|e| e.into_token()).map(|t| t.text().to_owned()).collect()
}

const PIECES: [&str; 24] = [
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "\"",
    "\"out\"",
    "\"$level\"",
    "\"a.b.c\"",
    "Graph",
    "Gain",
    "Mix",
    "nodes",
    "use",
    "params",
    "NaN",
    "-1e308",
    "99999999999999999999",
    "Some(",
    "None",
    "\"\u{0}\u{10FFFF}\"",
];

fn damage(tokens: &[String], pool: &[String], draw: &mut Rng) -> String {
    let mut all = tokens.to_vec();
    for _ in 0..1 + draw.below(4) {
        if all.is_empty() {
            break;
        }
        let (a, b) = (draw.below(all.len()), draw.below(all.len()));
        match draw.below(6) {
            0 => drop(all.remove(a)),
            1 => all.swap(a, b),
            2 => all[a] = pool[draw.below(pool.len())].clone(),
            3 => all.insert(a, PIECES[draw.below(PIECES.len())].to_owned()),
            4 => drop(all.drain(a.min(b)..a.max(b))),
            _ => {
                let part: Vec<String> = all[a.min(b)..a.max(b)].iter().take(40).cloned().collect();
                all.splice(a..a, part);
            }
        }
    }
    all.concat()
}

fn judge(text: &str) -> bool {
    judge_with(text, &[])
}

fn judge_with(text: &str, sets: &[Override]) -> bool {
    let loaded = load_text(
        "graph.ron",
        text,
        Path::new("tests/diagnostics/graph.ron"),
        &LoadOptions::default().overrides(sets.to_vec()),
    );
    assert_eq!(loaded.graph.is_none(), any_error(&loaded.diagnostics), "{text}");
    let reported = render(&loaded.diagnostics, &loaded.sources, false);
    assert_eq!(reported.is_empty(), loaded.diagnostics.is_empty());
    assert_eq!(
        json(&loaded.diagnostics, &loaded.sources).as_array().unwrap().len(),
        loaded.diagnostics.len()
    );
    for location in loaded.diagnostics.iter().filter_map(|d| d.location.as_ref()) {
        let source = loaded.sources.get(location.file).unwrap_or_else(|| panic!("{text}"));
        assert!(source.text.get(location.span.clone()).is_some(), "{location:?} in\n{text}");
    }
    // The rest of a damaged graph can be shaped, and reports its errors with locations.
    assert_eq!(loaded.graph.is_none(), loaded.sound.is_some());
    let files = DirFiles::new(loaded.root, Limits::default());
    for d in loaded.sound.iter().flat_map(|sound| sound_shapes(sound, &files, &PlanOptions::default()).1) {
        assert!(d.location.is_some() && d.node.is_some(), "{d:?} in\n{text}");
    }
    if let Some(graph) = &loaded.graph {
        assert!(svg(&Drawing::of(graph, None)).ends_with("</svg>\n"));
    }
    loaded.graph.is_some()
}

#[test]
fn damaged_graphs_are_graphs_or_have_errors() {
    let seeds: Vec<Vec<String>> = seeds().iter().map(|text| tokens(text)).collect();
    let pool: Vec<String> = seeds.iter().flatten().cloned().collect();
    let mut draw = Rng::new(11);
    let (mut right, mut wrong) = (0, 0);
    for _ in 0..4000 {
        let text = damage(&seeds[draw.below(seeds.len())], &pool, &mut draw);
        if judge(&text) {
            right += 1;
        } else {
            wrong += 1;
        }
    }
    // Damage of both kinds: that which matters, and that which does not.
    assert!(right > 20 && wrong > 1000, "{right} right, {wrong} wrong");
}

#[test]
fn damaged_settings_are_taken_or_refused() {
    let text = foley::cli::template("wind")[0].1.clone();
    assert!(judge(&text));
    // Names of parameters, nodes and fields are all among the words of the graph.
    let is_word = |t: &&String| t.starts_with(|c: char| c == '"' || c.is_alphabetic());
    let words: Vec<String> =
        tokens(&text).iter().filter(is_word).map(|t| t.trim_matches('"').to_owned()).collect();
    let pool = tokens(&text);
    let mut draw = Rng::new(12);
    let (mut right, mut wrong) = (0, 0);
    for _ in 0..4000 {
        let sets: Vec<Override> = (0..1 + draw.below(2))
            .map(|_| {
                let word = |draw: &mut Rng| words[draw.below(words.len())].clone();
                let target = match draw.below(3) {
                    0 => word(&mut draw),
                    1 => damage(&[word(&mut draw), ".".into(), word(&mut draw)], &pool, &mut draw),
                    _ => format!("{}.{}", word(&mut draw), word(&mut draw)),
                };
                let value = match draw.below(3) {
                    0 => "0.5".to_owned(),
                    1 => PIECES[draw.below(PIECES.len())].to_owned(),
                    _ => damage(&pool[draw.below(pool.len())..], &pool, &mut draw),
                };
                Override { target, value }
            })
            .collect();
        if judge_with(&text, &sets) {
            right += 1;
        } else {
            wrong += 1;
        }
    }
    assert!(right > 20 && wrong > 1000, "{right} right, {wrong} wrong");
}

#[test]
fn texts_cut_at_any_byte_are_judged() {
    for text in seeds() {
        for at in (0..text.len()).filter(|at| text.is_char_boundary(*at)).step_by(3) {
            judge(&text[..at]);
        }
    }
}

#[test]
fn deep_and_long_texts_are_judged() {
    assert!(!judge(&"[".repeat(10_000)));
    assert!(!judge(&format!(
        "Graph(nodes: {{\"a\": Mix(inputs: {}1{})}})",
        "[".repeat(5000),
        "]".repeat(5000)
    )));
    let ring = |k: usize| format!("\"n{k}\": Gain(audio: \"n{}\"),\n", (k + 1) % 3000);
    let text = format!("Graph(nodes: {{\n{}}})", (0..3000).map(ring).collect::<String>());
    assert!(!judge(&text));
}
