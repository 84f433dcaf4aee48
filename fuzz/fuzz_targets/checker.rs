//! Any text as a graph: it is valid, or there is at least one error; all locations are in the text; drawing it works.
#![no_main]

use foley::diag::{any_error, json, render};
use foley::draw::{Drawing, svg};
use foley::graph::{LoadOptions, load_text};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    let loaded = load_text("graph.ron", text, Path::new("no-such-folder/graph.ron"), &LoadOptions::default());
    assert_eq!(loaded.graph.is_none(), any_error(&loaded.diagnostics));
    let _ = render(&loaded.diagnostics, &loaded.sources, false);
    let _ = json(&loaded.diagnostics, &loaded.sources);
    for location in loaded.diagnostics.iter().filter_map(|d| d.location.as_ref()) {
        if let Some(source) = loaded.sources.get(location.file) {
            assert!(source.text.get(location.span.clone()).is_some());
        }
    }
    if let Some(graph) = loaded.graph {
        let _ = svg(&Drawing::of(&graph, None));
    }
});
