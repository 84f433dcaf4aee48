//! Every example graph runs, writes sound, and produces the same bits for any window and thread count; every node type
//! has one.

use crate::common;
use foley::Registry;
use foley::graph::{LoadOptions, load};
use foley::memo::Memo;
use foley::plan::PlanOptions;
use foley_nodes::core::time::ticks;
use std::collections::BTreeSet;

#[test]
fn every_example_graph_gives_the_same_bits_for_any_window_and_threads_and_from_the_cache() {
    for path in common::all_graphs().iter().filter(|p| common::is_whole(p)) {
        // Two seconds hold every kind of event in the examples; `.ci/run` runs the main one whole.
        let until = common::cut(path, 2.0);
        let cache = tempfile::tempdir().unwrap();
        let memo = Memo::new(cache.path().to_owned(), 1 << 30, path).with_policy(common::ALL);
        let run = |window: f64, threads, memo: Option<&Memo>| {
            let dir = tempfile::tempdir().unwrap();
            let window = ticks(window);
            // Several regions for several threads.
            let options =
                PlanOptions { window, threads, until, min_region_ns: 1e4, ..PlanOptions::default() };
            let report = common::run_file_cached(path, &options, memo, dir.path())
                .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            assert!(report.notes.iter().all(|(_, note)| !note.contains("F08")), "{:?}", report.notes);
            let cached = report.nodes.iter().filter(|n| n.cached).count();
            (common::files_below(dir.path()), cached)
        };
        let (reference, _) = run(0.02, 1, None);
        assert!(!reference.is_empty(), "{} wrote nothing", path.display());
        assert!(
            reference.iter().all(|(_, bytes)| bytes.len() > 100),
            "{} wrote an empty file",
            path.display()
        );
        assert!(run(0.0071, 2, Some(&memo)).0 == reference, "{} differs", path.display());
        let (cached, nodes) = run(0.0071, 2, Some(&memo));
        assert!(cached == reference && nodes > 0, "{} differs from the cache", path.display());
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
