//! Bytes and errors of recordings that are stored as grains.

use super::clusters::{Reduced, merged, substitutes};
use super::similarity::{norms, similar_pairs};
use super::subset::{reduced, retained_grains};
use crate::core::random::Random;
use crate::grain::Distortion;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::{GrainRecording, GrainRecordings};
use crate::grain::synthesis::{GapRule, sequence, sound_of, walk};
use crate::plot::{Chart, Line};
use crate::table::{Cell, ResultTable};
use rayon::prelude::*;

/// What is compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompressionRules {
    /// Numbers of bits of the samples.
    pub bits: Vec<u32>,
    /// Correlations from which on grains are merged.
    pub merge: Vec<f64>,
    /// Shares of the bytes of the grains that are the budget of a subset.
    pub shares: Vec<f64>,
    /// Random subsets that each budgeted one is compared with.
    pub random_sets: usize,
    /// Grains that each grain is compared with.
    pub neighbours: usize,
    /// Samples stored around grains without neighbours.
    pub margin: usize,
    /// Bytes of the same recordings after another coder, if they are compared too.
    pub coded_bytes: Option<u64>,
}

/// One line of the table.
struct Point {
    grains: usize,
    bytes: [usize; 2],
    error: Distortion,
}

/// The grains of the walk through each pattern, and no others.
fn walked(patterns: &CorrelationPatterns, dictionary: &GrainDictionary) -> CorrelationPatterns {
    let of_pattern =
        |pattern: &Pattern| sequence(pattern, &walk(pattern, dictionary, GapRule::Extend), pattern.frames);
    CorrelationPatterns { patterns: patterns.patterns.iter().map(of_pattern).collect(), ..patterns.clone() }
}

/// Plays all recordings from their patterns, and compares.
fn measure(originals: &[Vec<f32>], names: &[&str], stored: &Reduced) -> Point {
    let Reduced { dictionary, patterns } = stored;
    let of_recording = |(x, name): (&Vec<f32>, &&str)| {
        let mut y = vec![0.0; x.len()];
        for pattern in patterns.patterns.iter().filter(|pattern| pattern.name == **name) {
            let part = sound_of(dictionary, &walk(pattern, dictionary, GapRule::Extend), x.len());
            y.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
        }
        let mut error = Distortion::default();
        error.add(x, &y, dictionary.rate);
        error
    };
    let all: Vec<Distortion> = originals.par_iter().zip(names).map(of_recording).collect();
    let bytes = |file: Result<Vec<u8>, String>| file.map_or(0, |bytes| bytes.len());
    Point {
        grains: dictionary.len(),
        bytes: [bytes(dictionary.to_bytes()), bytes(patterns.to_bytes())],
        error: all.into_iter().fold(Distortion::default(), Distortion::with),
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
        if dictionary.subset(&of_first(count), margin).bytes() <= budget {
            fits = count
        } else {
            exceeds = count
        }
    }
    of_first(fits)
}

/// Mean and standard deviation.
fn mean_and_deviation(x: &[f64]) -> [f64; 2] {
    let n = x.len().max(1) as f64;
    let mean = x.iter().sum::<f64>() / n;
    [mean, (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt()]
}

/// Compares bytes and errors of recordings stored as grains: all grains, grains of fewer bits, grains merged from several correlations on, grains under several
/// budgets, and random grains under the same budgets.
///
/// Bytes are those of the files; the patterns have the grains of the walk and no others. Errors are those of the sounds of all recordings,
/// channels averaged. The second recordings are the first ones after another coder. `stop` receives the share of the work that is done, and returns true to stop: then the result is `None`.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 5.1, where 94
/// recordings take 20.1 % fewer bytes.
#[must_use]
pub fn compression_table(
    [recordings, coded]: [&GrainRecordings; 2],
    dictionary: &GrainDictionary,
    patterns: &CorrelationPatterns,
    rules: &CompressionRules,
    random: Random,
    stop: &dyn Fn(f64) -> bool,
) -> Option<ResultTable> {
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
    let originals: Vec<Vec<f32>> = recordings.recordings.iter().map(GrainRecording::mono).collect();
    let names: Vec<&str> = recordings.recordings.iter().map(|r| r.name.as_str()).collect();
    let samples = |r: &GrainRecording| r.len() * r.parts.first().map_or(1, |part| part.channels.len());
    let whole = 2 * recordings.recordings.iter().map(samples).sum::<usize>();
    let share = |bytes: [usize; 2]| (bytes[0] + bytes[1]) as f64 / whole.max(1) as f64;
    table.push(
        ["recordings".into(), Cell::Empty, Cell::Empty, whole.into(), 0_usize.into(), 1.0.into()]
            .into_iter()
            .chain([const { Cell::Empty }; 4]),
    );
    let row =
        |method: &str, setting: Option<f64>, p: &Point, figures: [f64; 2], deviations: [Option<f64>; 2]| {
            let [ratio, distance] = figures;
            let [of_ratio, of_distance] = deviations;
            [
                method.into(),
                setting.into(),
                p.grains.into(),
                p.bytes[0].into(),
                p.bytes[1].into(),
                share(p.bytes).into(),
                ratio.into(),
                distance.into(),
                of_ratio.into(),
                of_distance.into(),
            ]
        };
    let figures = |p: &Point| [p.error.segmental_ratio(), p.error.log_spectral_distance()];
    let steps =
        (2 + rules.bits.len() + rules.merge.len() + rules.shares.len() * (1 + rules.random_sets)) as f64;
    let mut done = 0.0;
    let mut curves: Vec<(&str, Vec<[f64; 3]>)> = Vec::new();
    let mut advance = || {
        done += 1.0;
        (!stop(done / steps)).then_some(())
    };
    let mut add = |method: &'static str, p: &Point, [ratio, distance]: [f64; 2]| {
        let point = [share(p.bytes), ratio, distance];
        match curves.iter_mut().find(|(name, _)| *name == method) {
            Some((_, points)) => points.push(point),
            None => curves.push((method, vec![point])),
        }
    };
    if let Some(bytes) = rules.coded_bytes {
        let mut error = Distortion::default();
        for (x, other) in originals.iter().zip(&coded.recordings) {
            error.add(x, &other.mono(), recordings.rate);
        }
        let point = Point { grains: 0, bytes: [bytes as usize, 0], error };
        table.push(row("other coder", None, &point, figures(&point), [None; 2]));
        add("other coder", &point, figures(&point));
    }
    let sequences = walked(patterns, dictionary);
    let all =
        measure(&originals, &names, &Reduced { dictionary: dictionary.clone(), patterns: sequences.clone() });
    table.push(row("all grains", None, &all, figures(&all), [None; 2]));
    add("all grains", &all, figures(&all));
    advance()?;
    for bits in &rules.bits {
        let mut coarse = Reduced { dictionary: dictionary.clone(), patterns: sequences.clone() };
        coarse.dictionary.quantise(*bits as u16);
        let point = measure(&originals, &names, &coarse);
        table.push(row("fewer bits", Some(f64::from(*bits)), &point, figures(&point), [None; 2]));
        add("fewer bits", &point, figures(&point));
        advance()?;
    }
    let (norms, pairs) = (norms(dictionary), similar_pairs(dictionary, rules.neighbours, &|_| stop(0.0))?);
    advance()?;
    for merge in &rules.merge {
        let found = substitutes(&norms, &pairs, patterns, *merge);
        let point = measure(&originals, &names, &merged(dictionary, &sequences, &found, rules.margin));
        table.push(row("merged", Some(*merge), &point, figures(&point), [None; 2]));
        add("merged", &point, figures(&point));
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
        let point = measure_of(&retained);
        table.push(row("subset", Some(*part), &point, figures(&point), [None; 2]));
        add("subset", &point, figures(&point));
        advance()?;
        let mut sets: Vec<Point> = Vec::with_capacity(rules.random_sets);
        for set in 0..rules.random_sets {
            let uniform = |index: u64| random.uniform(set as u32, index, k as u32);
            sets.push(measure_of(&random_grains(dictionary, budget, rules.margin, uniform)));
            advance()?;
        }
        let of = |k: usize| mean_and_deviation(&sets.iter().map(|p| figures(p)[k]).collect::<Vec<_>>());
        if let Some(first) = sets.first() {
            let [[ratio, of_ratio], [distance, of_distance]] = [of(0), of(1)];
            let deviations = [Some(of_ratio), Some(of_distance)];
            table.push(row("random", Some(*part), first, [ratio, distance], deviations));
            add("random", first, [ratio, distance]);
        }
    }
    for (title, k) in [("segmental signal-to-noise ratio, dB", 1), ("log-spectral distance, dB", 2)] {
        let line = |(name, points): &(&str, Vec<[f64; 3]>)| {
            let points: Vec<[f64; 2]> = points.iter().map(|p| [p[0], p[k]]).collect();
            if points.len() > 1 { Line::new(*name, points) } else { Line::dots(*name, points) }
        };
        let lines = curves.iter().map(line).collect();
        table.charts.push(Chart::of(
            title,
            ("share of the bytes of the recordings", false),
            (title, false),
            lines,
        ));
    }
    Some(table)
}

#[cfg(test)]
mod tests;
