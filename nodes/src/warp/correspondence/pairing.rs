//! From marked stretches to pairs of units.

use std::fmt;
use std::ops::Range;

use super::set::{Correspondence, CorrespondenceSet, SourceName};
use crate::artefact::text::Location;
use crate::unit::{Segment, UnitDatabase};
use crate::warp::spline::Pair;

/// Fraction of a unit by which an interval may miss it: times in files are decimals.
const SLACK: f64 = 1e-6;

/// Pairing of the units of both sides of a correspondence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairing {
    /// The first with the first, and so on; the longer side loses its end.
    InOrder,
    /// One pair: the mean of each side.
    Centroid,
    /// By dynamic time warping of their features, for gestures of different speed.
    Dtw,
}

/// A correspondence that does not fit the target or the database.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{location}: {message}")]
pub struct SetError {
    /// The file.
    pub file: String,
    /// Location in the file.
    pub location: Location,
    /// Description of the mistake, and of the correct form.
    pub message: String,
}

/// All correspondences of a set that do not fit, in order; never none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SetErrors(pub Vec<SetError>);

/// The most that are reported in words.
const MAX_LISTED: usize = 20;

impl fmt::Display for SetErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [only] = &self.0[..] {
            return only.fmt(f);
        }
        write!(f, "{} correspondences do not fit", self.0.len())?;
        self.0.iter().take(MAX_LISTED).try_for_each(|e| write!(f, "; {e}"))?;
        if self.0.len() > MAX_LISTED { write!(f, "; and {} more", self.0.len() - MAX_LISTED) } else { Ok(()) }
    }
}

impl std::error::Error for SetErrors {}

/// The units of a correspondence, for one vector of the target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interval {
    /// Index in the set.
    pub correspondence: usize,
    /// Vector (channel) of the target.
    pub vector: usize,
    /// Units of the target.
    pub target: Range<usize>,
    /// Units of the database.
    pub database: Range<usize>,
}

/// Format of a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Units.
    pub units: usize,
    /// Feature vectors per unit.
    pub vectors: usize,
    /// Units per second.
    pub rate: f64,
}

/// The whole units inside of `[start, start + length)`, all in units.
///
/// 0.1 s holds 24 units of 1/240 s where it begins with one, otherwise 23.
#[must_use]
pub fn whole_units(start: f64, length: f64) -> Range<usize> {
    let from = (start - SLACK).ceil().max(0.0);
    let to = (start + length + SLACK).floor().max(from);
    from as usize..to as usize
}

/// A stretch of a segment in units from its start, or a description of the mismatch.
fn within(segment: &Segment, start: f64, length: f64) -> Option<Range<usize>> {
    let units = whole_units(start, length);
    let fits = start >= -SLACK && units.end <= segment.units as usize;
    let first = segment.start as usize;
    fits.then(|| first + units.start..first + units.end)
}

fn of_source(
    c: &Correspondence,
    name: &SourceName,
    vector: usize,
    db: &UnitDatabase,
) -> Result<Range<usize>, String> {
    let index = match name {
        SourceName::Index(index) => *index as usize,
        SourceName::Provenance(text) => {
            let found = db.sources.iter().position(|source| source.provenance == *text);
            found.ok_or_else(|| {
                let names: Vec<_> = db.sources.iter().map(|s| format!("{:?}", s.provenance)).collect();
                format!("the database has no recording {text:?}; it has {}", names.join(", "))
            })?
        }
    };
    let all: Vec<&Segment> = db.originals().filter(|s| s.source as usize == index).collect();
    if all.is_empty() {
        return Err(format!("the database has no recording {index}; it has {}", db.sources.len()));
    }
    let channel = c.channel.map_or(vector as u32, |channel| channel);
    let own: Vec<&Segment> = all.iter().filter(|s| s.channel == channel).copied().collect();
    let segments = if own.is_empty() { all } else { own };
    let unit = db.unit() as f64;
    let fs = db.conventions.rate.as_f64();
    let start = |s: &Segment| (c.database * fs - s.offset as f64) / unit;
    let length = c.duration * fs / unit;
    if let Some(found) = segments.iter().find_map(|s| within(s, start(s), length)) {
        return Ok(found);
    }
    let parts: Vec<_> = segments
        .iter()
        .map(|s| {
            let from = s.offset as f64 / fs;
            format!("{from:.3} to {:.3} s", from + f64::from(s.units) * unit / fs)
        })
        .collect();
    Err(format!(
        "{:.3} to {:.3} s is not inside of one stretch of recording {index}; these are {}",
        c.database,
        c.database + c.duration,
        parts.join(", ")
    ))
}

fn of_units(c: &Correspondence, db: &UnitDatabase) -> Result<Range<usize>, String> {
    let rate = db.conventions.rate.as_f64() / db.unit() as f64;
    let (start, length) = (c.database * rate, c.duration * rate);
    let found = db.originals().find_map(|s| within(s, start - f64::from(s.start), length));
    found.ok_or_else(|| {
        let end = db.recorded() as f64 / rate;
        let (from, to) = (c.database, c.database + c.duration);
        if to > end + SLACK / rate {
            format!("{from:.3} to {to:.3} s is outside of the database, which holds {end:.3} s")
        } else {
            format!("{from:.3} to {to:.3} s of the database runs across a join of two recordings")
        }
    })
}

/// The units of all correspondences that count.
///
/// # Errors
/// Names file, line and column of each one that lies outside of the target or the recordings, runs across a join, names a
/// channel that is not there, or holds no whole unit.
pub fn intervals(
    set: &CorrespondenceSet,
    target: Target,
    db: &UnitDatabase,
) -> Result<Vec<Interval>, SetErrors> {
    let (mut all, mut wrong) = (Vec::new(), Vec::new());
    for (index, c) in set.pairs.iter().enumerate().filter(|(_, c)| c.enabled) {
        match of_one(index, c, target, db) {
            Ok(found) => all.extend(found),
            Err(message) => wrong.push(SetError {
                file: set.file.clone(),
                location: c.location,
                message: format!("{}: {message}", c.name(index)),
            }),
        }
    }
    if wrong.is_empty() { Ok(all) } else { Err(SetErrors(wrong)) }
}

/// The units of one correspondence, in each vector of the target that it is for.
fn of_one(
    index: usize,
    c: &Correspondence,
    target: Target,
    db: &UnitDatabase,
) -> Result<Vec<Interval>, String> {
    let mut all = Vec::new();
    if let Some(channel) = c.channel.filter(|channel| *channel as usize >= target.vectors) {
        let message =
            format!("there is no channel {channel}; the features have {}, counted from 0", target.vectors);
        return Err(message);
    }
    let units = whole_units(c.target * target.rate, c.duration * target.rate);
    if units.end > target.units {
        let end = target.units as f64 / target.rate;
        let message = format!(
            "{:.3} to {:.3} s is outside of the target, which lasts {end:.3} s",
            c.target,
            c.target + c.duration
        );
        return Err(message);
    }
    for vector in (0..target.vectors).filter(|v| c.channel.is_none_or(|channel| channel as usize == *v)) {
        let database = match &c.source {
            Some(name) => of_source(c, name, vector, db),
            None => of_units(c, db),
        }?;
        if units.is_empty() || database.is_empty() {
            let side = if units.is_empty() { "target" } else { "database" };
            let message =
                format!("{} s hold no whole unit of the {side}; a longer duration is needed", c.duration);
            return Err(message);
        }
        all.push(Interval { correspondence: index, vector, target: units.clone(), database });
    }
    Ok(all)
}

/// Mean of vectors.
pub(crate) fn mean<'a>(vectors: impl Iterator<Item = &'a [f32]>, d: usize) -> Vec<f64> {
    let (mut sum, mut count) = (vec![0.0; d], 0.0_f64);
    for vector in vectors {
        sum.iter_mut().zip(vector).for_each(|(s, x)| *s += f64::from(*x));
        count += 1.0;
    }
    sum.iter().map(|s| s / count.max(1.0)).collect()
}

fn standard(vectors: &[&[f32]], d: usize) -> Vec<Vec<f64>> {
    let middle = mean(vectors.iter().copied(), d);
    let centred: Vec<Vec<f64>> =
        vectors.iter().map(|v| v.iter().zip(&middle).map(|(x, m)| f64::from(*x) - m).collect()).collect();
    let square: f64 = centred.iter().flatten().map(|x| x * x).sum();
    let deviation = (square / (vectors.len() * d).max(1) as f64).sqrt();
    let scale = if deviation > 1e-9 { 1.0 / deviation } else { 0.0 };
    centred.into_iter().map(|v| v.into_iter().map(|x| x * scale).collect()).collect()
}

/// The cheapest path through two sequences, which are compared after removal of their own mean and spread.
///
/// # Source
/// Sakoe and Chiba, "Dynamic programming algorithm optimization for spoken word recognition" (IEEE ASSP 26(1), 1978).
fn time_warp(a: &[&[f32]], b: &[&[f32]], d: usize) -> Vec<(usize, usize)> {
    let (n, m) = (a.len(), b.len());
    let (a, b) = (standard(a, d), standard(b, d));
    let cost = |i: usize, j: usize| a[i].iter().zip(&b[j]).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
    let mut total = vec![f64::INFINITY; n * m];
    let before = |total: &[f64], i: usize, j: usize| {
        let steps = [(1, 1), (1, 0), (0, 1)].into_iter().filter(|(p, q)| i >= *p && j >= *q);
        let steps = steps.map(|(p, q)| (i - p, j - q)).filter(|s| *s != (i, j));
        steps.min_by(|s, t| total[s.0 * m + s.1].total_cmp(&total[t.0 * m + t.1]))
    };
    for i in 0..n {
        for j in 0..m {
            total[i * m + j] = cost(i, j) + before(&total, i, j).map_or(0.0, |(p, q)| total[p * m + q]);
        }
    }
    let mut path = vec![(n - 1, m - 1)];
    while let Some(step) = path.last().and_then(|(i, j)| before(&total, *i, *j)) {
        path.push(step);
    }
    path.reverse();
    path
}

/// Pairs of feature vectors, each with its correspondence.
///
/// # Shapes
/// `features: [units, vectors, d]` of the target.
#[must_use]
pub fn pairs(
    intervals: &[Interval],
    pairing: Pairing,
    set: &CorrespondenceSet,
    (features, vectors): (&[f32], usize),
    db: &UnitDatabase,
) -> Vec<(usize, Pair)> {
    let d = db.dims();
    let mut all = Vec::new();
    for interval in intervals {
        let target = |unit: usize| {
            let at = (unit * vectors + interval.vector) * d;
            features.get(at..at + d).unwrap_or_default()
        };
        let weight = set.pairs.get(interval.correspondence).map_or(1.0, |c| c.weight);
        let from: Vec<&[f32]> = interval.target.clone().map(target).collect();
        let to: Vec<&[f32]> = interval.database.clone().map(|unit| db.feature(unit)).collect();
        let wide = |x: &[f32]| x.iter().map(|x| f64::from(*x)).collect::<Vec<_>>();
        let mut add =
            |from: Vec<f64>, to: Vec<f64>| all.push((interval.correspondence, Pair { from, to, weight }));
        match pairing {
            Pairing::InOrder => from.iter().zip(&to).for_each(|(a, b)| add(wide(a), wide(b))),
            Pairing::Centroid => add(mean(from.iter().copied(), d), mean(to.iter().copied(), d)),
            Pairing::Dtw => {
                time_warp(&from, &to, d).into_iter().for_each(|(i, j)| add(wide(from[i]), wide(to[j])))
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::set::read_correspondences;
    use super::*;
    use crate::core::time::Rate;
    use crate::feature::FeatureConventions;
    use crate::unit::UnitSource;
    use crate::unit::database::DATABASE_VERSION;

    /// Two recordings of 1 s and 0.5 s at 240 units of 400 samples per second, the second in two channels.
    fn database() -> UnitDatabase {
        let conventions = FeatureConventions::cloth(Rate::hz(96_000), 400);
        let segment =
            |start, units, source, channel| Segment { start, units, source, channel, ..Segment::default() };
        let units = 480;
        let features: Vec<f32> = (0..units * 3).map(|k| k as f32).collect();
        UnitDatabase {
            version: DATABASE_VERSION,
            conventions,
            floor_energy: 1e-10,
            segments: vec![segment(0, 240, 0, 0), segment(240, 120, 1, 0), segment(360, 120, 1, 1)],
            sources: ["drag.wav", "crumple.wav"]
                .map(|p| UnitSource { provenance: p.into(), ..UnitSource::default() })
                .into(),
            audio: Vec::new(),
            unfiltered: features.clone(),
            features,
        }
    }

    const TARGET: Target = Target { units: 480, vectors: 2, rate: 240.0 };

    fn found(pairs: &str) -> Result<Vec<Interval>, SetErrors> {
        let mut set = read_correspondences(&format!("(pairs: [\n{pairs}\n])")).unwrap();
        set.file = "set.ron".into();
        intervals(&set, TARGET, &database())
    }

    #[test]
    fn an_unaligned_tenth_of_a_second_holds_23_units_and_an_aligned_one_24() {
        let count = |at: f64, seconds: f64, rate: f64| whole_units(at * rate, seconds * rate).len();
        assert_eq!(
            (count(0.1234, 0.1, 240.0), count(0.1234, 0.2, 240.0), count(0.123, 0.1, 60.0)),
            (23, 47, 5)
        );
        assert_eq!(
            (count(0.5, 0.1, 240.0), count(0.0, 0.1, 240.0), count(1.0 / 3.0, 0.1, 240.0)),
            (24, 24, 24)
        );
        // Node counts of the paper's table.
        assert_eq!((2 * 23 + 3 * 47, 7 * 23 + 47, 3 * 5), (187, 208, 15));
    }

    #[test]
    fn stretches_are_found_by_recording_and_by_unit_time() {
        let all = found("(target: 0.5, source: 1, database: 0.25, duration: 0.1)").unwrap();
        assert_eq!((all[0].vector, all[0].target.clone(), all[0].database.clone()), (0, 120..144, 300..324));
        assert_eq!((all[1].vector, all[1].database.clone()), (1, 420..444));
        let one =
            found("(target: 0.5, source: \"drag.wav\", database: 0.0, duration: 0.1, channel: 1)").unwrap();
        assert_eq!((one.len(), one[0].vector, one[0].database.clone()), (1, 1, 0..24));
        let unit = found("(target: 0.0, database: 1.25, duration: 0.1, channel: 0)").unwrap();
        assert_eq!(unit[0].database, 300..324);
        assert_eq!(found("(target: 9.0, database: 99, duration: 0.1, enabled: false)"), Ok(vec![]));
    }

    #[test]
    fn stretches_may_overlap_on_both_sides() {
        let all = found(
            "(target: 0.5, source: 0, database: 0.25, duration: 0.1, channel: 0),
            (target: 0.55, source: 0, database: 0.25, duration: 0.2, channel: 0)",
        )
        .unwrap();
        let places: Vec<_> = all.iter().map(|s| (s.target.clone(), s.database.clone())).collect();
        assert_eq!(places, [(120..144, 60..84), (132..180, 60..108)]);
    }

    #[test]
    fn what_does_not_fit_is_named_with_file_line_and_column() {
        for (pair, part) in [
            ("(target: 1.95, database: 0, duration: 0.1)", "outside of the target, which lasts 2.000 s"),
            ("(target: 0, database: 1.95, duration: 0.1)", "outside of the database, which holds 2.000 s"),
            ("(target: 0, database: 0.95, duration: 0.1)", "across a join"),
            ("(target: 0, source: 1, database: 0.45, duration: 0.1)", "0.000 to 0.500 s"),
            ("(target: 0, source: 2, database: 0.4, duration: 0.1)", "no recording 2"),
            ("(target: 0, source: \"x\", database: 0.4, duration: 0.1)", "\"drag.wav\", \"crumple.wav\""),
            ("(target: 0.001, database: 0, duration: 0.004)", "no whole unit of the target"),
            ("(target: 0, database: 0, duration: 0.1, channel: 2)", "no channel 2"),
        ] {
            let e = found(&format!("(target: 0, database: 0, duration: 0.1),\n  {pair}"))
                .unwrap_err()
                .to_string();
            assert!(e.starts_with("set.ron:3:3: correspondence 1: ") && e.contains(part), "{pair}: {e}");
        }
    }

    #[test]
    fn all_that_do_not_fit_are_reported_at_once() {
        let e = found(
            "(target: 1.95, database: 0, duration: 0.1),\n(target: 0, database: 0, duration: 0.1),\n\
             (label: \"far\", target: 0, database: 9, duration: 0.1),\n(target: 0, source: 7, database: 0, duration: 0.1)",
        )
        .unwrap_err();
        let indices: Vec<u32> = e.0.iter().map(|e| e.location.line).collect();
        assert_eq!(indices, [2, 4, 5]);
        let text = e.to_string();
        for part in [
            "3 correspondences do not fit; set.ron:2:1: correspondence 0: 1.950 to 2.050 s is outside of the target",
            "; set.ron:4:1: correspondence 2 (\"far\"): 9.000 to 9.100 s is outside of the database",
            "; set.ron:5:1: correspondence 3: the database has no recording 7",
        ] {
            assert!(text.contains(part), "{text}");
        }
        let many = "(target: 9, database: 0, duration: 0.1),\n".repeat(25);
        assert!(found(&many).unwrap_err().to_string().ends_with("; and 5 more"));
    }

    #[test]
    fn units_are_paired_in_order_by_their_means_or_along_the_cheapest_path() {
        let set = read_correspondences(
            "(pairs: [(target: 0, source: 0, database: 0.002, duration: 0.05, weight: 2)])",
        )
        .unwrap();
        let target = Target { vectors: 1, ..TARGET };
        let db = database();
        let all = intervals(&set, target, &db).unwrap();
        assert_eq!((all[0].target.len(), all[0].database.clone()), (12, 1..12));
        let features: Vec<f32> = (0..480 * 3).map(|k| (k / 3) as f32).collect();
        let of = |pairing| pairs(&all, pairing, &set, (&features, 1), &db);
        let in_order = of(Pairing::InOrder);
        assert_eq!((in_order.len(), in_order[3].1.from[0], in_order[3].1.to[1]), (11, 3.0, 13.0));
        assert_eq!(in_order[0].1.weight, 2.0);
        let centroid = of(Pairing::Centroid);
        assert_eq!((centroid.len(), centroid[0].1.from[0], centroid[0].1.to[0]), (1, 5.5, 18.0));
        let warped = of(Pairing::Dtw);
        assert!(warped.len() >= 12 && warped.first() == in_order.first());
    }

    #[test]
    fn a_gesture_that_speeds_up_is_met_where_it_is() {
        let at = |t: f32| [(3.0 * t).sin(), t];
        let steady: Vec<[f32; 2]> = (0..20).map(|k| at(k as f32 / 19.0)).collect();
        let faster: Vec<[f32; 2]> = (0..20).map(|k| at((k as f32 / 19.0).powi(2))).collect();
        let rows = |x: &'static [[f32; 2]]| x.iter().map(|r| &r[..]).collect::<Vec<&[f32]>>();
        let (a, b) = (rows(Vec::leak(steady)), rows(Vec::leak(faster)));
        let path = time_warp(&a, &b, 2);
        let late = |(i, j): &(usize, usize)| (*i as f32 / 19.0 - (*j as f32 / 19.0).powi(2)).abs();
        let found = path.iter().map(late).sum::<f32>() / path.len() as f32;
        let in_order = (0..20).map(|k| late(&(k, k))).sum::<f32>() / 20.0;
        assert!(found < 0.5 * in_order, "{found} {in_order}");
    }
}
