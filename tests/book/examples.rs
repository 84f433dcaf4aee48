//! Every example graph runs, writes sound, and produces the same bits for any window and thread count; every node type
//! has one.

use crate::common;
use foley::Registry;
use foley::graph::{LoadOptions, load};
use foley::plan::PlanOptions;
use foley_nodes::core::time::ticks;
use std::collections::BTreeSet;

#[test]
fn every_example_graph_gives_the_same_bits_for_any_window_and_threads() {
    for path in common::all_graphs().iter().filter(|p| common::is_whole(p)) {
        // Two seconds hold every kind of event in the examples; `.ci/run` runs the main one whole.
        let until = common::cut(path, 2.0);
        let run = |window: f64, threads| {
            let dir = tempfile::tempdir().unwrap();
            let options = PlanOptions { window: ticks(window), threads, until, ..PlanOptions::default() };
            if let Err(e) = common::run_file(path, &options, dir.path()) {
                panic!("{}: {e}", path.display());
            }
            common::files_below(dir.path())
        };
        let reference = run(0.02, 1);
        assert!(!reference.is_empty(), "{} wrote nothing", path.display());
        assert!(
            reference.iter().all(|(_, bytes)| bytes.len() > 100),
            "{} wrote an empty file",
            path.display()
        );
        assert!(run(0.0071, 2) == reference, "{} differs", path.display());
    }
}

#[test]
fn every_node_type_has_an_example_graph() {
    let mut used = BTreeSet::new();
    for path in common::all_graphs() {
        let loaded = load(&path, &LoadOptions::default());
        used.extend(loaded.graph.into_iter().flat_map(|g| g.nodes).map(|n| n.ty.name));
    }
    let registry = Registry::standard();
    let missing: Vec<&str> = registry.types().iter().map(|t| t.name).filter(|n| !used.contains(n)).collect();
    assert!(missing.is_empty(), "no example graph uses {missing:?}");
}
