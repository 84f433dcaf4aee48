//! Every example graph runs, writes sound at its levels, and produces the same bits for any window and thread count; every node
//! type has one.

use super::levels;
use crate::cloth::stored;
use crate::common;
use foley::Registry;
use foley::graph::{LoadOptions, load};
use foley::memo::Memo;
use foley::plan::PlanOptions;
use foley_nodes::core::time::ticks;
use foley_nodes::dsp::SoundFigures;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Examples whose warps are without a fault.
const RECOMPOSED: [&str; 13] = [
    "sheet",
    "couch",
    "live",
    "first_person",
    "windbreaker",
    "corduroy",
    "two_materials",
    "polyester_sheet",
    "polyester_couch",
    "exercises",
    "jogging",
    "boxing",
    "first_person_boxing",
];

/// Sounds of an example that is run whole, and writes the files that ship as they ship; then shorter runs give the same bits for any window and threads, and from the cache that the
/// whole runs filled with values. What two examples have in common is computed by the first one.
fn try_example(path: &Path, cache: &Path) -> Vec<(String, SoundFigures)> {
    let memo = Memo::new(cache.to_owned(), 4 << 30, path);
    let name = path.display();

    let dir = tempfile::tempdir().unwrap();
    let options = PlanOptions { threads: 2, ..PlanOptions::default() };
    let mut whole = None;
    let taps = stored::taps(path);
    let sounds = match common::run_file_unmeasured(path, &options, &taps, Some(&memo), dir.path()) {
        // It plays live input, which has no end.
        Err(e) if e.contains("F048") => Vec::new(),
        Err(e) => panic!("{name}: {e}"),
        Ok(report) => {
            let warnings: Vec<_> =
                report.notes.iter().filter(|(_, note)| !note.contains("samples")).collect();
            let recomposed = RECOMPOSED.iter().any(|name| path.ends_with(format!("cloth/{name}.ron")));
            assert!(!recomposed || warnings.is_empty(), "{name} is warned of its warp: {warnings:?}");
            // Those that wait for messages are silent here.
            let silent: Vec<_> = report
                .notes
                .iter()
                .filter(|(_, note)| note.contains("silent throughout") && !note.contains("foley live"))
                .collect();
            assert!(silent.is_empty() || path.to_string_lossy().contains("live"), "{name}: {silent:?}");
            stored::check(path, dir.path());
            whole = Some(common::files_below(dir.path()));
            levels::sounds_of(path, dir.path())
        }
    };

    // Two seconds hold every kind of event in the examples.
    let until = common::cut(path, 2.0);
    let memo = memo.with_policy(common::ALL);
    let run = |window: f64, threads, memo: Option<&Memo>| {
        let dir = tempfile::tempdir().unwrap();
        let window = ticks(window);
        // Several regions for several threads.
        let options = PlanOptions { window, threads, until, min_region_ns: 1e4, ..PlanOptions::default() };
        let report = common::run_file_cached(path, &options, memo, dir.path())
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(report.notes.iter().all(|(_, note)| !note.contains("F08")), "{name}: {:?}", report.notes);
        let cached = report.nodes.iter().filter(|n| n.cached).count();
        (common::files_below(dir.path()), cached)
    };
    // A piece that is not cut has run on two threads already.
    let (reference, threads) = match whole.filter(|_| until.is_none()) {
        Some(files) => (files, 1),
        None => (run(0.02, 1, None).0, 2),
    };
    assert!(!reference.is_empty(), "{name} wrote nothing");
    assert!(reference.iter().all(|(_, bytes)| bytes.len() > 100), "{name} wrote an empty file");
    assert!(run(0.0071, threads, Some(&memo)).0 == reference, "{name} differs");
    let (cached, nodes) = run(0.0071, 2, Some(&memo));
    assert!(cached == reference && nodes > 0, "{name} differs from the cache");
    sounds
}

#[test]
fn every_example_graph_is_heard_at_its_levels_and_gives_the_same_bits_for_any_window_and_threads_and_from_the_cache()
 {
    let mut paths = common::all_graphs();
    paths.retain(|path| common::is_whole(path));
    let found: Vec<Mutex<Vec<_>>> = paths.iter().map(|_| Mutex::default()).collect();
    let (next, cache) = (AtomicUsize::new(0), tempfile::tempdir().unwrap());
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from).min(4) {
            scope.spawn(|| {
                while let Some((path, found)) = {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    paths.get(k).zip(found.get(k))
                } {
                    *found.lock().unwrap() = try_example(path, cache.path());
                }
            });
        }
    });
    let sounds: Vec<_> = found.into_iter().flat_map(|sounds| sounds.into_inner().unwrap()).collect();
    levels::check(&sounds);
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
