//! `foley levels`.

use super::Exit;
use super::args::LevelsArgs;
use super::console::stdout;
use anyhow::Context as _;
use foley_nodes::dsp::{SoundFigures, SoundMeter};
use foley_nodes::io::AudioReader;
use serde_json::json;
use std::io::Write as _;
use std::path::Path;

/// Samples that are read at once.
const BLOCK: usize = 1 << 16;

/// Measures an audio file.
///
/// # Errors
/// When it cannot be read.
pub fn measure(path: &Path) -> anyhow::Result<SoundFigures> {
    let file = std::fs::File::open(path).with_context(|| path.display().to_string())?;
    let mut reader = AudioReader::open(Box::new(file)).with_context(|| path.display().to_string())?;
    let (rate, channels) = (f64::from(reader.info().rate), reader.info().channels);
    let mut meter = SoundMeter::new(rate, channels);
    let mut block = vec![0.0; BLOCK / channels.max(1) * channels];
    loop {
        let frames = reader.read(&mut block).with_context(|| path.display().to_string())?;
        if frames == 0 {
            return Ok(meter.figures());
        }
        meter.process(&block[..frames * channels]);
    }
}

/// The heading of a table of figures.
pub const HEADING: &str = "| sound | s | peak dB | rms dB | dBA | LUFS | below 60 Hz | above 1 kHz | centroid Hz |\n\
                           |---|---|---|---|---|---|---|---|---|";

/// One row of such a table.
#[must_use]
pub fn row(name: &str, f: &SoundFigures) -> String {
    format!(
        "| {name} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} % | {:.1} % | {:.0} |",
        f.seconds,
        f.peak_db,
        f.rms_db,
        f.dba,
        f.lufs,
        100.0 * f.below_60_hz,
        100.0 * f.above_1_khz,
        f.centroid_hz
    )
}

/// Prints levels and spectral figures of audio files, as a table or as JSON.
///
/// # Errors
/// When a file cannot be read, or standard output is closed.
pub fn levels(args: &LevelsArgs) -> anyhow::Result<Exit> {
    let mut all = Vec::new();
    for path in &args.files {
        let figures = measure(path)?;
        all.push((path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), figures));
    }
    if args.json {
        let all: Vec<_> =
            all.iter().map(|(name, figures)| json!({ "sound": name, "figures": figures })).collect();
        writeln!(stdout(), "{:#}", json!(all))?;
    } else {
        writeln!(stdout(), "{HEADING}")?;
        for (name, figures) in &all {
            writeln!(stdout(), "{}", row(name, figures))?;
        }
    }
    Ok(Exit::Done)
}
