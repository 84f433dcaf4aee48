//! The sound of every example is loud, bright and free of inaudible bass as its graph intends: a table in the book holds the
//! figures, and stated bounds hold for each family.

use foley::cli::{HEADING, measure, row};
use foley_nodes::dsp::SoundFigures;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/src/levels.md");

/// Figures of the sounds that an example wrote into a folder, by folder and file of the example.
pub fn sounds_of(example: &Path, folder: &Path) -> Vec<(String, SoundFigures)> {
    let family = example.parent().unwrap().file_name().unwrap().to_string_lossy().into_owned();
    let graph = example.file_stem().unwrap().to_string_lossy().into_owned();
    let mut sounds: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    sounds.retain(|sound| sound.extension().is_some_and(|e| e == "wav"));
    sounds.sort();
    let named = sounds.iter().map(|sound| {
        let stem = sound.file_stem().unwrap().to_string_lossy().into_owned();
        let name = if stem == graph { graph.clone() } else { format!("{graph}: {stem}") };
        (format!("{family}/{name}"), measure(sound).unwrap())
    });
    named.collect()
}

/// Bounds of a family: largest share below 60 Hz, softest A-weighted level at a peak of -6 dB, centroids in Hz.
struct Bounds {
    low: f64,
    dba: f64,
    centroid: [f64; 2],
}

fn bounds(name: &str) -> Option<Bounds> {
    let family = name.split('/').next()?;
    match family {
        // Scrapes, impacts and what rolls.
        "texture" | "impact" => Some(Bounds { low: 0.05, dba: -35.0, centroid: [400.0, 6000.0] }),
        // A log in real time begins with a second of silence at most; friction holds the bass of its recordings, and tension the tone
        // of its sheet.
        "cloth" => Some(Bounds { low: 0.30, dba: -42.0, centroid: [150.0, 5000.0] }),
        _ => None,
    }
}

/// Panics where a sound is outside the bounds of its family, or differs from the table of the book.
pub fn check(all: &[(String, SoundFigures)]) {
    assert!(all.len() > 40, "{} sounds", all.len());
    let mut wrong = String::new();
    for (name, f) in all {
        // `live` waits for input, and has one impact without it.
        let Some(bounds) = bounds(name).filter(|_| name != "texture/live" && name != "impact/live") else {
            continue;
        };
        let dba = f.dba - f.peak_db - 6.0;
        let fits = f.peak_db <= -0.1
            && f.below_60_hz <= bounds.low
            && dba >= bounds.dba
            && (bounds.centroid[0]..=bounds.centroid[1]).contains(&f.centroid_hz);
        if !fits {
            let _ = writeln!(wrong, "{}   ({dba:.1} dBA at a peak of -6 dB)", row(name, f));
        }
    }
    let table: String = all.iter().map(|(name, f)| row(name, f) + "\n").collect();
    let table = format!("{HEADING}\n{table}");
    let page = fs::read_to_string(Path::new(PAGE)).unwrap();
    let (head, stored) = page.split_at(page.find(HEADING).expect("the page has the table"));
    if std::env::var_os("FOLEY_LEVELS").is_some_and(|value| value == "write") {
        fs::write(PAGE, format!("{head}{table}")).unwrap();
    } else {
        // Machines round differently, so the figures may differ a little.
        let cells =
            |line: &str| -> Vec<String> { line.split('|').map(|cell| cell.trim().to_owned()).collect() };
        for (stored, found) in stored.lines().zip(table.lines()).skip(2) {
            let [a, b] = [cells(stored), cells(found)];
            let number = |cell: &str| cell.trim_end_matches(" %").parse::<f64>().ok();
            let near = a.len() == b.len()
                && a[1] == b[1]
                && (2..a.len() - 1).all(|k| match (number(&a[k]), number(&b[k])) {
                    (Some(x), Some(y)) => (x - y).abs() <= if k == 9 { 0.1 * x.abs() } else { 1.0 },
                    _ => a[k] == b[k],
                });
            if !near {
                let _ = writeln!(wrong, "stored {stored}\nfound  {found}");
            }
        }
        if stored.lines().count() != table.lines().count() {
            let _ = writeln!(
                wrong,
                "the table has {} lines, not {}",
                stored.lines().count(),
                table.lines().count()
            );
        }
    }
    assert!(
        wrong.is_empty(),
        "{wrong}If these are intended, FOLEY_LEVELS=write cargo test --test suite every_example_graph writes the table of {PAGE}"
    );
}
