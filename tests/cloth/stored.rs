//! The files of correspondences and of warps that ship are those that the examples make today, which [`check`] compares where all examples are run: a change
//! of what they were made of that leaves them behind is seen here.

use crate::common::{all_graphs, foley, graphs, is_whole};
use foley_nodes::unit::UnitDatabase;
use foley_nodes::warp::{CorrespondenceSet, Warp, read_correspondences};
use std::collections::HashSet;
use std::path::Path;

fn run(folder: &Path, graph: &str, taps: &[(&str, &str)]) -> serde_json::Value {
    let graph = graphs().join(graph).display().to_string();
    let taps: Vec<String> =
        taps.iter().map(|(tap, file)| format!("{tap}={}", folder.join(file).display())).collect();
    let mut arguments = vec!["run", &graph];
    taps.iter().for_each(|tap| arguments.extend(["--tap", tap]));
    foley(folder, &arguments)
}

fn asset(name: &str) -> Vec<u8> {
    std::fs::read(graphs().join("assets/cloth").join(name)).unwrap()
}

/// Warps that ship: the example that fits each, its tap, and the file.
const WARPS: [(&str, &str, &str); 6] = [
    ("cloth/sheet.ron", "cotton.recomposed.fit.warp", "cotton.warp.json"),
    ("cloth/polyester_sheet.ron", "polyester.recomposed.fit.warp", "polyester.warp.json"),
    ("cloth/windbreaker.ron", "windbreaker.recomposed.fit.warp", "windbreaker.warp.json"),
    ("cloth/corduroy.ron", "corduroy.recomposed.fit.warp", "corduroy.warp.json"),
    ("cloth/live_warp.ron", "fit.warp", "cotton_live.warp.json"),
    ("cloth/warp.ron", "fit.warp", "rustle.warp"),
];

/// Correspondences that ship, and the examples that suggest them.
const CORRESPONDENCES: [(&str, &[&str]); 2] = [
    ("cloth/suggest.ron", &["sheet"]),
    ("cloth/suggest_more.ron", &["windbreaker", "corduroy", "polyester", "itself", "cover", "folds"]),
];

/// The file of the tap of a warp.
const TAPPED: &str = "stored.warp.json";

fn warp_of(graph: &Path) -> Option<(&'static str, &'static str)> {
    let (_, tap, name) = WARPS.into_iter().find(|(of, ..)| graph.ends_with(of))?;
    Some((tap, name))
}

/// Taps that write the artefacts of an example, which [`check`] compares with the files that ship.
pub fn taps(graph: &Path) -> Vec<String> {
    warp_of(graph).into_iter().map(|(tap, _)| format!("{tap}={TAPPED}")).collect()
}

/// Compares what an example has written into a folder with the files that ship, and removes what only the taps have written.
pub fn check(graph: &Path, out: &Path) {
    for (_, names) in CORRESPONDENCES.iter().filter(|(of, _)| graph.ends_with(of)) {
        names.iter().for_each(|name| check_correspondences(&format!("{name}.correspondences.ron"), out));
    }
    if let Some((_, name)) = warp_of(graph) {
        let tapped = out.join(TAPPED);
        check_warp(name, &std::fs::read(&tapped).unwrap());
        std::fs::remove_file(tapped).unwrap();
    }
}

fn check_correspondences(name: &str, out: &Path) {
    let read = |bytes: Vec<u8>| -> CorrespondenceSet {
        let mut set = read_correspondences(std::str::from_utf8(&bytes).unwrap()).unwrap();
        // A comment stands above those in the file.
        set.pairs.iter_mut().for_each(|c| c.location = Default::default());
        set
    };
    let made = read(std::fs::read(out.join(name)).unwrap());
    assert!(made.pairs.len() == 12, "{name}");
    assert_eq!(read(asset(name)), made, "{name}: suggest it anew");
}

fn check_warp(name: &str, made: &[u8]) {
    let read = |bytes: &[u8]| serde_json::from_slice::<Warp>(bytes).unwrap();
    let (made, stored) = (read(made), read(&asset(name)));
    assert!(stored.fault().is_none() && stored.altered().is_none(), "{name}");
    assert_eq!(stored.conventions, made.conventions, "{name}: fit it anew");
    assert_eq!(stored.maps.len(), made.maps.len(), "{name}: fit it anew");
    for (stored, made) in stored.maps.iter().zip(&made.maps) {
        let (a, b) = (&stored.spline, &made.spline);
        assert_eq!((a.nodes.len(), a.weights.len()), (b.nodes.len(), b.weights.len()), "{name}");
        let far = a.nodes.iter().zip(&b.nodes).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(far < 1e-3, "{name}: nodes are {far} away from where they are today; fit it anew");
    }
}

#[test]
fn the_examples_of_stored_files_are_run() {
    let graphs: Vec<_> = all_graphs().into_iter().filter(|graph| is_whole(graph)).collect();
    let of = WARPS.iter().map(|(of, ..)| of).chain(CORRESPONDENCES.iter().map(|(of, _)| of));
    of.for_each(|of| assert!(graphs.iter().any(|graph| graph.ends_with(of)), "{of}"));
}

#[test]
fn databases_of_the_examples_hold_several_recordings_loud_and_soft_and_what_is_nearly_silent() {
    // Those of the other graphs are of the same recordings.
    for graph in ["cloth/units.ron", "cloth/warp.ron"] {
        let out = tempfile::tempdir().unwrap();
        run(out.path(), graph, &[("database", "units.bin")]);
        let db = UnitDatabase::from_bytes(&std::fs::read(out.path().join("units.bin")).unwrap()).unwrap();
        let sources: HashSet<u32> = db.segments.iter().map(|s| s.source).collect();
        assert!(sources.len() >= 3 && db.segments.len() >= sources.len(), "{graph}: {sources:?}");
        assert!(db.sources.iter().all(|s| !s.content.is_empty() && !s.tag.is_empty()), "{graph}");
        let level = |unit: &[f32]| {
            let square: f64 = unit.iter().map(|x| f64::from(*x).powi(2)).sum();
            10.0 * (square / unit.len() as f64 + 1e-12).log10()
        };
        let mut levels: Vec<f64> = db.channel(0).chunks_exact(db.unit()).map(level).collect();
        levels.sort_unstable_by(f64::total_cmp);
        let [soft, middle, loud] =
            [20, 2, 1].map(|k| levels[if k == 1 { levels.len() - 1 } else { levels.len() / k }]);
        println!(
            "{graph}: {} units of {} recordings, {soft:.0}, {middle:.0} and {loud:.0} dB",
            levels.len(),
            sources.len()
        );
        assert!(
            levels.len() > 200 && soft < middle - 10.0 && middle < loud - 10.0,
            "{graph}: {soft} {middle} {loud}"
        );
    }
}
