//! The node `LikenessReport`.

use super::comparison::{LikenessRules, compare};
use super::repeats::RepeatRules;
use super::report::Likeness;
use super::takes::Take;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::{Fold, Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, seconds};
use crate::dsp::channel_mean;
use crate::feature::UnitLength;
use crate::io::{MaxLength, RecordingParam, trial_wav};
use crate::table::ResultTable;
use crate::unit::{PickFormat, Picks, UnitDatabase};
use crate::{archive_state, params, ports};

params! {
    /// Measures the likeness of a sound and the recordings that it was made of, or should resemble.
    ///
    /// **Repeats**: the share of active frames of 25 ms that repeat the sound of the last two seconds, and their times. **Lines**: the envelope of
    /// a sound that is joined at the rate of its units has lines at this rate and its multiples. **Joins**: the energy above 8 kHz in 5 ms
    /// around each, beside that of the recordings. **Statistics**: spread of level, thirds of an octave, kurtosis by octave and modulation from
    /// 0.5 to 200 Hz by octave, each beside its range over the recordings.
    ///
    /// A frame of a tone correlates with all of its past without being a copy: frames that correlate with themselves within 25 ms are
    /// counted as periodic, not as repeated. The share of repeats of the recordings themselves is the baseline, which is reported beside it.
    ///
    /// Recordings are those of `database`, then those of `recordings`. With `picks` the report has the joins. The length of a unit is `unit`, or
    /// that of `picks` or `database`. Channels are averaged, sounds are high-passed at 100 Hz, and levels are relative to the level of each
    /// sound: a gain after the concatenation changes nothing. Of a single recording of at least a second, ranges are
    /// over its halves and quarters.
    ///
    /// # Source
    /// McDermott and Simoncelli, "Sound texture perception via statistics of the auditory periphery" (Neuron 71, 2011), for kurtosis and
    /// modulation by band; the rest is an own measure.
    pub struct LikenessReportParams {
        /// Recordings to compare with, besides those of `database`.
        recordings: Vec<AssetPath> = Vec::new();
        /// Length of the units: a fraction of a second such as "1/240", or "200 samples"; None for that of `picks` or `database`.
        unit: Option<UnitLength> = None;
        /// Time before each frame in which it is searched.
        window: f64 = 2.0, unit "s", range 0.05..=60.0;
        /// Normalised correlation above which a frame is repeated.
        threshold: f64 = 0.9, unit "", range 0.1..=1.0;
    }
}
ports! {
    pub struct LikenessReportPorts / LikenessReportIo {
        in {
            /// The sound.
            audio: Stream<f32>,
            /// The units that it was made of.
            picks: Option<Stream<Picks>>,
            /// The database that they are of, whose recordings are compared.
            database: Option<Value<UnitDatabase>>,
        }
        out {
            /// The report: JSON, and an SVG with the spectrogram.
            report: Fold<Likeness>,
            /// Its values as a table.
            table: Fold<ResultTable>,
        }
    }
}

/// Longest sound, s.
const LONGEST: f64 = 600.0;

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F101", max: MaxLength::Seconds(600) };

/// The node over [`compare`].
#[derive(Debug)]
pub struct LikenessReport {
    rate: Rate,
    rules: RepeatRules,
    unit: Option<f64>,
    takes: Vec<Take>,
    has_picks: bool,
    sound: Vec<f32>,
    /// The units of the last pick, and times of joins.
    last: Vec<i32>,
    joins: Vec<f64>,
}

/// Samples of each recording of a database, with its channels averaged.
fn takes_of(database: &UnitDatabase, rate: Rate) -> Result<Vec<Take>, Fault> {
    let unit = database.unit();
    let units = database.len() * unit;
    let of_source =
        |source: usize| {
            let name = database.sources.get(source).map_or("", |s| s.provenance.as_str());
            let name = name.rsplit(['/', '\\']).next().filter(|name| !name.is_empty());
            let name = name.map_or_else(|| format!("recording {}", source + 1), str::to_owned);
            let segments: Vec<_> = database.originals().filter(|s| s.source as usize == source).collect();
            // Segments of other channels hold the same times.
            let mut starts: Vec<(u64, Vec<usize>)> = Vec::new();
            for segment in &segments {
                let start = segment.start as usize * unit;
                match starts.iter_mut().find(|(offset, _)| *offset == segment.offset) {
                    Some((_, all)) => all.push(start),
                    None => starts.push((segment.offset, vec![start])),
                }
            }
            let mut samples = Vec::new();
            for (offset, all) in &starts {
                let length =
                    segments.iter().filter(|s| s.offset == *offset).map(|s| s.units as usize * unit).min();
                let all: Vec<usize> =
                    all.iter().flat_map(|at| (0..database.channels()).map(move |c| c * units + at)).collect();
                samples.extend((0..length.unwrap_or(0)).map(|k| {
                    all.iter().map(|at| database.audio[at + k]).sum::<f32>() / all.len().max(1) as f32
                }));
            }
            Take::resampled(&name, samples, database.conventions.rate, rate)
                .map_err(|e| Fault::new("F101", format!("{name}: {e}")).at("database"))
        };
    (0..database.sources.len())
        .map(of_source)
        .filter(|take| !matches!(take, Ok(t) if t.samples.is_empty()))
        .collect()
}

impl Node for LikenessReport {
    type Params = LikenessReportParams;
    type Ports = LikenessReportPorts;
    const NAME: &'static str = "LikenessReport";
    const CLASS: Class = Class::Offline;

    fn shape(p: &LikenessReportParams, s: &mut Shape<'_, '_, LikenessReportPorts>) -> Result<(), Reject> {
        let audio = s.input(LikenessReportPorts::audio);
        let Some(end) = audio.end else {
            let reject = Reject::new("F075", "`audio` does not end; a report is made of a whole sound");
            return Err(reject.at("audio").help("cut it with Trim"));
        };
        if seconds(end) > LONGEST {
            s.note(format!("of {:.0} s the first {LONGEST} s are compared", seconds(end)));
        }
        let has_recordings = !p.recordings.is_empty() || s.linked(LikenessReportPorts::database);
        if !has_recordings {
            let reject = Reject::new("F101", "there is no recording to compare with").at("recordings");
            return Err(reject.help("give `recordings`, or link the `database` of the units"));
        }
        if s.linked(LikenessReportPorts::picks) && !s.linked(LikenessReportPorts::database) {
            let reject =
                Reject::new("F101", "`picks` needs a database, to find the units that follow each other");
            return Err(reject.at("picks").help("link the `database` of the units"));
        }
        RECORDINGS.check(s, &p.recordings);
        s.ends(audio.end);
        Ok(())
    }

    fn build(p: &LikenessReportParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rate = cx.input(LikenessReportPorts::audio).rate;
        let picks = cx.optional(LikenessReportPorts::picks);
        let database = cx.optional_value(LikenessReportPorts::database);
        let mut takes = Vec::new();
        let mut unit = picks.as_ref().map(|picks| 1.0 / picks.rate.as_f64());
        if let Some(db) = &database {
            db.validate().map_err(|e| Fault::new("F101", e.to_string()).at("database"))?;
            if let Some(PickFormat { conventions, .. }) = picks.as_ref().map(|picks| &picks.format) {
                conventions.check("picks", &db.conventions, "database")?;
            }
            takes = takes_of(db, rate)?;
            unit = unit.or(Some(db.unit() as f64 / db.conventions.rate.as_f64()));
        }
        for (k, AssetPath(path)) in p.recordings.iter().enumerate() {
            let whole = RECORDINGS.read_whole(cx, &format!("recordings[{k}]"), path, rate)?;
            let count = whole.channels.len().max(1) as f32;
            let length = whole.channels.first().map_or(0, Vec::len);
            let mono = |n: usize| whole.channels.iter().map(|channel| channel[n]).sum::<f32>() / count;
            let samples = (0..length).map(mono).collect();
            takes.push(Take {
                name: format!("recording {}", k + 1),
                rate: f64::from(whole.info.rate),
                samples,
            });
        }
        let given = p.unit.map(|unit| f64::from(unit.samples(rate).max(1)) / rate.as_f64());
        Ok(Self {
            rate,
            rules: RepeatRules { window: p.window, threshold: p.threshold },
            unit: given.or(unit),
            takes,
            has_picks: picks.is_some(),
            sound: Vec::new(),
            last: Vec::new(),
            joins: Vec::new(),
        })
    }

    fn run(&mut self, io: LikenessReportIo<'_>) -> Result<(), Fault> {
        let (width, items) = (io.audio.width().max(1), io.audio.items());
        let left = ((LONGEST * self.rate.as_f64()) as usize).saturating_sub(self.sound.len());
        let (start, frames) = (self.sound.len(), (items.len() / width).min(left));
        self.sound.resize(start + frames, 0.0);
        channel_mean(&items[..frames * width], width, &mut self.sound[start..]);
        if let (Some(picks), Some(db)) = (&io.picks, io.database) {
            let rate = picks.rate().as_f64();
            for (k, item) in (picks.first()..).zip(picks.items().chunks_exact(picks.width().max(1))) {
                let follows = |(a, b): (&i32, i32)| {
                    let segment = |unit: i32| usize::try_from(unit).ok().and_then(|unit| db.segment_of(unit));
                    b == a.wrapping_add(1) && segment(*a) == segment(b)
                };
                let is_join = self.last.iter().zip(item).any(|(a, b)| !follows((a, b.unit)));
                if is_join {
                    self.joins.push(k as f64 / rate);
                }
                self.last.clear();
                self.last.extend(item.iter().map(|pick| pick.unit));
            }
        }
        Ok(())
    }

    fn finish(&mut self, mut io: LikenessReportIo<'_>) -> Result<Summary, Fault> {
        let joins = self.has_picks.then(|| std::mem::take(&mut self.joins));
        let rules = LikenessRules { repeats: self.rules, unit: self.unit, joins };
        let found = compare(&self.sound, self.rate.as_f64(), &self.takes, &rules);
        self.sound = Vec::new();
        let summary = found.summary();
        io.table.set(found.table());
        io.report.set(found);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (LikenessReportParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let samples: Vec<f32> = (0..4000).map(|_| rng.between(-0.5, 0.5) as f32).collect();
        files.insert("a.wav", trial_wav(&samples[..2500], 8000));
        files.insert("b.wav", trial_wav(&samples[2500..], 4000));
        let unit = (rng.below(2) == 0).then(|| UnitLength::Samples(20 + rng.below(50) as u32));
        let (window, threshold) = (rng.between(0.05, 0.5), rng.between(0.5, 1.0));
        let recordings = vec!["a.wav".into(), "b.wav".into()];
        (LikenessReportParams { recordings, unit, window, threshold }, files)
    }

    archive_state!(sound, last, joins);
}

#[cfg(test)]
mod tests;
