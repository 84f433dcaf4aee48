//! The files of correspondences and of warps that ship are those that the documented commands write today: a change of what they were
//! made of that leaves them behind is seen here.

use crate::common::{foley, graphs};
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

#[test]
fn stored_correspondences_are_those_that_are_suggested() {
    let out = tempfile::tempdir().unwrap();
    run(out.path(), "cloth/suggest.ron", &[]);
    run(out.path(), "cloth/suggest_more.ron", &[]);
    for name in ["sheet", "windbreaker", "corduroy", "polyester", "itself", "cover", "folds"] {
        let name = format!("{name}.correspondences.ron");
        let read = |bytes: Vec<u8>| -> CorrespondenceSet {
            let mut set = read_correspondences(std::str::from_utf8(&bytes).unwrap()).unwrap();
            // A comment stands above those in the file.
            set.pairs.iter_mut().for_each(|c| c.location = Default::default());
            set
        };
        let made = read(std::fs::read(out.path().join(&name)).unwrap());
        assert!(made.pairs.len() == 12, "{name}");
        assert_eq!(read(asset(&name)), made, "{name}: suggest it anew");
    }
}

#[test]
fn stored_warps_are_those_that_are_fitted() {
    for (graph, tap, name) in [
        ("cloth/sheet.ron", "cotton.recomposed.fit.warp", "cotton.warp.json"),
        ("cloth/polyester_sheet.ron", "polyester.recomposed.fit.warp", "polyester.warp.json"),
        ("cloth/windbreaker.ron", "windbreaker.recomposed.fit.warp", "windbreaker.warp.json"),
        ("cloth/corduroy.ron", "corduroy.recomposed.fit.warp", "corduroy.warp.json"),
        ("cloth/live_warp.ron", "fit.warp", "cotton_live.warp.json"),
        ("cloth/warp.ron", "fit.warp", "rustle.warp"),
    ] {
        let out = tempfile::tempdir().unwrap();
        run(out.path(), graph, &[(tap, "warp.json")]);
        let read = |bytes: &[u8]| serde_json::from_slice::<Warp>(bytes).unwrap();
        let (made, stored) =
            (read(&std::fs::read(out.path().join("warp.json")).unwrap()), read(&asset(name)));
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
