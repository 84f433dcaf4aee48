//! `foley likeness`.

use super::Exit;
use super::args::LikenessArgs;
use super::console::stdout;
use super::run::write_whole;
use anyhow::Context as _;
use foley_nodes::core::item::Data as _;
use foley_nodes::core::time::Rate;
use foley_nodes::io::AudioReader;
use foley_nodes::likeness::{LikenessRules, Take, compare};
use std::io::Write as _;
use std::path::Path;

/// All samples of an audio file with its channels averaged, and its rate.
fn read(path: &Path) -> anyhow::Result<(Vec<f32>, Rate)> {
    let name = || path.display().to_string();
    let file = std::fs::File::open(path).with_context(name)?;
    let mut reader = AudioReader::open(Box::new(file)).with_context(name)?;
    let rate = Rate::new(u64::from(reader.info().rate), 1).context("its rate is 0").with_context(name)?;
    Ok((reader.read_mono().with_context(name)?, rate))
}

/// Compares a sound with recordings, as text or as JSON.
///
/// # Errors
/// If a file cannot be read or written, or standard output is closed.
pub fn likeness(args: &LikenessArgs) -> anyhow::Result<Exit> {
    let (sound, rate) = read(&args.sound)?;
    let take = |path: &std::path::PathBuf| {
        let (samples, from) = read(path)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Take::resampled(&name, samples, from, rate).with_context(|| path.display().to_string())
    };
    let takes = args.recordings.iter().map(take).collect::<anyhow::Result<Vec<Take>>>()?;
    let unit = args.unit.map(|unit| f64::from(unit.samples(rate).max(1)) / rate.as_f64());
    let found = compare(&sound, rate.as_f64(), &takes, &LikenessRules { unit, ..LikenessRules::default() });
    if args.json {
        let mut json = serde_json::to_value(&found)?;
        // The curves and the picture are those of the drawing.
        if let Some(fields) = json.as_object_mut() {
            fields.retain(|name, _| name != "charts" && name != "picture");
        }
        writeln!(stdout(), "{json:#}")?;
    } else {
        write!(stdout(), "{}", found.text())?;
    }
    if let Some(path) = &args.svg {
        write_whole(path, &found.plot().unwrap_or_default())?;
    }
    Ok(Exit::Done)
}
