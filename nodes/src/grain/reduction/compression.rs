//! Bytes and errors of recordings that are stored as grains.

use super::clusters::{Reduced, merged, substitutes};
use super::similarity::{norms, similar_pairs};
use super::subset::{reduced, retained_bytes, retained_grains};
use crate::core::random::Random;
use crate::grain::Distortion;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::{GrainRecording, GrainRecordings};
use crate::grain::synthesis::{GapRule, sequence, sound_of, walk};
use crate::plot::{Chart, Line};
use crate::statistics::mean_and_deviation;
use crate::table::{Cell, ResultTable};
use rayon::prelude::*;

/// Settings that are compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompressionRules {
    /// Numbers of bits of the samples.
    pub bits: Vec<u32>,
    /// Minimum correlations of grains that are merged.
    pub merge: Vec<f64>,
    /// Shares of the bytes of the grains that are the budget of a subset.
    pub shares: Vec<f64>,
    /// Random subsets that each budgeted one is compared with.
    pub random_sets: usize,
    /// Grains that each grain is compared with.
    pub neighbours: usize,
    /// Samples stored around grains without neighbours.
    pub margin: usize,
}

/// One point of the curves of bytes and errors.
struct Point {
    /// Grains, if there are any.
    grains: Option<usize>,
    /// Bytes of the grains, and of the patterns.
    bytes: [usize; 2],
    /// Segmental signal-to-noise ratio and log-spectral distance, dB.
    figures: [f64; 2],
    /// Standard deviation of both over several sets of grains.
    deviations: [Option<f64>; 2],
}

/// The table with its curves.
struct Curves {
    table: ResultTable,
    /// Bytes of the recordings.
    whole: usize,
    /// Points of each method: share of the bytes, and both figures.
    points: Vec<(&'static str, Vec<[f64; 3]>)>,
}

impl Curves {
    /// The table with the recordings themselves.
    fn new(recordings: &GrainRecordings) -> Self {
        let samples = |r: &GrainRecording| r.len() * r.parts.first().map_or(1, |part| part.channels.len());
        let whole = 2 * recordings.recordings.iter().map(samples).sum::<usize>();
        let mut table = ResultTable::new(&[
            "method",
            "setting",
            "grains",
            "grain_bytes",
            "pattern_bytes",
            "share_of_recordings",
            "segmental_snr_db",
            "log_spectral_distance_db",
            "snr_deviation_db",
            "distance_deviation_db",
        ]);
        table.push(
            ["recordings".into(), Cell::Empty, Cell::Empty, whole.into(), 0_usize.into(), 1.0.into()]
                .into_iter()
                .chain([const { Cell::Empty }; 4]),
        );
        Self { table, whole, points: Vec::new() }
    }

    fn add(&mut self, method: &'static str, setting: Option<f64>, point: &Point) {
        let share = (point.bytes[0] + point.bytes[1]) as f64 / self.whole.max(1) as f64;
        let ([ratio, distance], [of_ratio, of_distance]) = (point.figures, point.deviations);
        self.table.push([
            method.into(),
            setting.into(),
            point.grains.map_or(Cell::Empty, Cell::from),
            point.bytes[0].into(),
            point.bytes[1].into(),
            share.into(),
            ratio.into(),
            distance.into(),
            of_ratio.into(),
            of_distance.into(),
        ]);
        let at = self.points.iter().position(|(name, _)| *name == method).unwrap_or(self.points.len());
        if at == self.points.len() {
            self.points.push((method, Vec::new()));
        }
        self.points[at].1.push([share, ratio, distance]);
    }

    /// The table, with a chart of each figure over the bytes.
    fn finish(mut self) -> ResultTable {
        for (title, k) in [("segmental signal-to-noise ratio, dB", 1), ("log-spectral distance, dB", 2)] {
            let line = |(name, points): &(&str, Vec<[f64; 3]>)| {
                let points: Vec<[f64; 2]> = points.iter().map(|p| [p[0], p[k]]).collect();
                if points.len() > 1 { Line::new(*name, points) } else { Line::dots(*name, points) }
            };
            let lines = self.points.iter().map(line).collect();
            let bytes = ("share of the bytes of the recordings", false);
            self.table.charts.push(Chart::of(title, bytes, (title, false), lines));
        }
        self.table
    }
}

/// The grains of the walk through each pattern, and no others.
fn walked(patterns: &CorrelationPatterns, dictionary: &GrainDictionary) -> CorrelationPatterns {
    let of_pattern =
        |pattern: &Pattern| sequence(pattern, &walk(pattern, dictionary, GapRule::Extend), pattern.frames);
    CorrelationPatterns { patterns: patterns.patterns.iter().map(of_pattern).collect(), ..patterns.clone() }
}

/// The figures of sounds.
fn figures(error: Distortion) -> [f64; 2] {
    [error.segmental_ratio(), error.log_spectral_distance()]
}

/// Plays all recordings from their patterns, and compares.
fn measure(originals: &[Vec<f32>], names: &[&str], stored: &Reduced) -> Point {
    let Reduced { dictionary, patterns } = stored;
    let of_recording = |(x, name): (&Vec<f32>, &&str)| {
        let own = patterns.patterns.iter().filter(|pattern| pattern.name == **name);
        let walks = own.map(|pattern| walk(pattern, dictionary, GapRule::Extend));
        let mut error = Distortion::default();
        error.add(x, &sound_of(dictionary, walks, x.len()), dictionary.rate);
        error
    };
    let all: Vec<Distortion> = originals.par_iter().zip(names).map(of_recording).collect();
    let bytes = |file: Result<Vec<u8>, String>| file.map_or(0, |bytes| bytes.len());
    Point {
        grains: Some(dictionary.len()),
        bytes: [bytes(dictionary.to_bytes()), bytes(patterns.to_bytes())],
        figures: figures(all.into_iter().fold(Distortion::default(), Distortion::with)),
        deviations: [None; 2],
    }
}

/// Grains in random order, as many as fit into a budget.
fn random_grains(
    dictionary: &GrainDictionary,
    budget: usize,
    margin: usize,
    random: impl Fn(u64) -> f64,
) -> Vec<bool> {
    let mut order: Vec<(f64, usize)> = (0..dictionary.len()).map(|k| (random(k as u64), k)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let of_first = |count: usize| {
        let mut retained = vec![false; dictionary.len()];
        order.iter().take(count).for_each(|(_, k)| retained[*k] = true);
        retained
    };
    // The greatest number that fits.
    let (mut fits, mut exceeds) = (0, dictionary.len() + 1);
    while exceeds - fits > 1 {
        let count = fits.midpoint(exceeds);
        if retained_bytes(dictionary, &of_first(count), margin) <= budget {
            fits = count
        } else {
            exceeds = count
        }
    }
    of_first(fits)
}

/// Compares bytes and errors of recordings stored as grains: all grains, grains of fewer bits, grains merged above several correlations,
/// grains under several budgets, and random grains under the same budgets.
///
/// Bytes are those of the files; the patterns have the grains of the walk and no others. Errors are those of the sounds of all recordings,
/// channels averaged. `coded` are the same recordings after another coder, and its bytes. `stop` receives the share of the work that is done,
/// and returns true to stop: then the result is `None`.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 5.1, where 94
/// recordings take 20.1 % fewer bytes.
#[must_use]
pub fn compression_table(
    recordings: &GrainRecordings,
    coded: Option<(&GrainRecordings, u64)>,
    stored: (&GrainDictionary, &CorrelationPatterns),
    rules: &CompressionRules,
    random: Random,
    stop: &dyn Fn(f64) -> bool,
) -> Option<ResultTable> {
    let (dictionary, patterns) = stored;
    let originals: Vec<Vec<f32>> = recordings.recordings.iter().map(GrainRecording::mono).collect();
    let names: Vec<&str> = recordings.recordings.iter().map(|r| r.name.as_str()).collect();
    let steps = 2 + rules.bits.len() + rules.merge.len() + rules.shares.len() * (1 + rules.random_sets);
    let done = std::cell::Cell::new(0);
    let watch = |part: f64| stop((f64::from(done.get()) + part) / steps as f64);
    let advance = || {
        done.set(done.get() + 1);
        (!watch(0.0)).then_some(())
    };
    let mut curves = Curves::new(recordings);
    if let Some((coded, bytes)) = coded {
        let mut error = Distortion::default();
        for (x, other) in originals.iter().zip(&coded.recordings) {
            error.add(x, &other.mono(), recordings.rate);
        }
        let bytes = [bytes as usize, 0];
        let point = Point { grains: None, bytes, figures: figures(error), deviations: [None; 2] };
        curves.add("other coder", None, &point);
    }
    let all = Reduced { dictionary: dictionary.clone(), patterns: walked(patterns, dictionary) };
    curves.add("all grains", None, &measure(&originals, &names, &all));
    advance()?;
    for bits in &rules.bits {
        let mut coarse = all.clone();
        coarse.dictionary.quantise(*bits as u16);
        curves.add("fewer bits", Some(f64::from(*bits)), &measure(&originals, &names, &coarse));
        advance()?;
    }
    let (norms, pairs) = (norms(dictionary), similar_pairs(dictionary, rules.neighbours, &watch)?);
    advance()?;
    for merge in &rules.merge {
        let found = substitutes(&norms, &pairs, patterns, *merge);
        let less = merged(dictionary, &all.patterns, &found, rules.margin);
        curves.add("merged", Some(*merge), &measure(&originals, &names, &less));
        advance()?;
    }
    for (k, part) in rules.shares.iter().enumerate() {
        let budget = (part * dictionary.bytes() as f64) as usize;
        let measure_of = |retained: &[bool]| {
            let left = reduced(dictionary, patterns, retained, rules.margin);
            let patterns = walked(&left.patterns, &left.dictionary);
            measure(&originals, &names, &Reduced { patterns, ..left })
        };
        let retained = retained_grains(dictionary, patterns, &|_| true, budget, rules.margin);
        curves.add("subset", Some(*part), &measure_of(&retained));
        advance()?;
        let mut sets: Vec<Point> = Vec::with_capacity(rules.random_sets);
        for set in 0..rules.random_sets {
            let uniform = |index: u64| random.uniform(set as u32, index, k as u32);
            sets.push(measure_of(&random_grains(dictionary, budget, rules.margin, uniform)));
            advance()?;
        }
        let of = |k: usize| mean_and_deviation(&sets.iter().map(|p| p.figures[k]).collect::<Vec<_>>());
        let ([ratio, of_ratio], [distance, of_distance]) = (of(0), of(1));
        if let (Some(first), Some(ratio), Some(distance)) = (sets.first(), ratio, distance) {
            let mean = Point { figures: [ratio, distance], deviations: [of_ratio, of_distance], ..*first };
            curves.add("random", Some(*part), &mean);
        }
    }
    Some(curves.finish())
}

#[cfg(test)]
mod tests;
