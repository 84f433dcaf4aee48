//! The node `PathScore`.

use super::path::FragmentPath;
use crate::artefact::text::Location;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Text;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::soundtrack::score::{Outside, ScoreSource, ScoreTarget, SoundScore, WeightCurve};
use crate::soundtrack::wavelet::WaveletTree;
use crate::{params, ports};
use std::collections::BTreeMap;

params! {
    /// Makes the score of a new animation from the soundtrack of an earlier one: the sound of each fragment is wanted where a fragment like it is.
    ///
    /// Each fragment of the target has the interval of the soundtrack under its fragment of the source, with a weight from `least` to `greatest`
    /// by the level of the interval relative to the loudest. Fragments are divided into pieces, so that a fragment sounds from its beginning to its
    /// end and not in any order.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 5.3. The pieces are an addition.
    pub struct PathScoreParams {
        /// The soundtrack, by the end of its path; empty for the first recording of the tree.
        recording: Text = "".into();
        /// Weight of silence.
        least: f64 = 0.02, unit "", range 0.0..=1.0;
        /// Weight of the loudest interval.
        greatest: f64 = 0.3, unit "", range 0.0..=1.0;
        /// Longest piece of a fragment; None for whole fragments.
        piece: Option<f64> = Some(0.1), unit "s", range 0.01..=60.0;
        /// Time by which the sound follows the picture in the soundtrack.
        av_offset: f64 = 0.0, unit "s", range -60.0..=60.0;
    }
}
ports! {
    pub struct PathScorePorts / PathScoreIo {
        in {
            /// The path.
            path: Value<FragmentPath>,
            /// The tree of the soundtrack of the source.
            tree: Value<WaveletTree>,
        }
        out {
            /// The score.
            score: Value<SoundScore>,
        }
    }
}

/// Shortest interval of a soundtrack that becomes a target, s.
const SHORTEST: f64 = 0.005;

/// The number of pieces of a fragment and of its target, none of them longer than `longest` nor shorter than [`SHORTEST`].
fn pieces(interval: (f64, f64), target: (f64, f64), longest: Option<f64>) -> usize {
    let (a, b) = (interval.1 - interval.0, target.1 - target.0);
    let wanted = longest.map_or(1.0, |longest| (a.max(b) / longest - 1e-9).ceil());
    wanted.min((a.min(b) / SHORTEST).floor()).max(1.0) as usize
}

/// One of equal pieces of an interval.
fn part((from, to): (f64, f64), piece: usize, pieces: usize) -> (f64, f64) {
    let at = |k: usize| if k == pieces { to } else { from + (to - from) * k as f64 / pieces as f64 };
    (at(piece), at(piece + 1))
}

/// Root of the mean square of an interval, over all channels.
fn level(channels: &[Vec<f32>], rate: f64, (from, to): (f64, f64)) -> f64 {
    let at = |t: f64, x: &[f32]| ((t * rate).round().max(0.0) as usize).min(x.len());
    let parts = channels.iter().map(|x| &x[at(from, x)..at(to, x).max(at(from, x))]);
    let (sum, count) = parts.flatten().fold((0.0, 0_usize), |(s, n), x| (s + f64::from(*x).powi(2), n + 1));
    if count > 0 { (sum / count as f64).sqrt() } else { 0.0 }
}

/// Rules by which a path becomes a score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathScoreRules {
    /// Weight of silence.
    pub least: f64,
    /// Weight of the loudest interval.
    pub greatest: f64,
    /// Longest piece of a fragment, s; `None` for whole fragments.
    pub piece: Option<f64>,
    /// Time by which the sound follows the picture in the soundtrack, s.
    pub av_offset: f64,
}

/// The score of a path over a soundtrack, and the number of fragments without a sound because the soundtrack ends before them.
///
/// # Complexity
/// Linear in the soundtrack and in the pieces.
#[must_use]
pub fn path_to_score(
    path: &FragmentPath,
    (recording, channels, rate): (&str, &[Vec<f32>], f64),
    rules: &PathScoreRules,
) -> (SoundScore, usize) {
    let end = channels.first().map_or(0.0, |x| x.len() as f64 / rate);
    // The interval of the soundtrack of each fragment, and its level.
    let mut used: BTreeMap<usize, ((f64, f64), f64)> = BTreeMap::new();
    for fragment in &path.path {
        let (from, to) = path.source_interval(*fragment);
        let interval = ((from + rules.av_offset).clamp(0.0, end), (to + rules.av_offset).clamp(0.0, end));
        used.entry(*fragment).or_insert_with(|| (interval, level(channels, rate, interval)));
    }
    used.retain(|_, ((from, to), _)| *to - *from >= SHORTEST);
    let loudest = used.values().map(|(_, level)| *level).fold(0.0, f64::max);
    let weight = |level: f64| {
        let relative = if loudest > 0.0 { level / loudest } else { 0.0 };
        rules.least + (rules.greatest - rules.least) * relative
    };
    let (mut sources, mut targets): (Vec<ScoreSource>, Vec<ScoreTarget>) = (Vec::new(), Vec::new());
    // The first piece of a fragment in so many pieces.
    let mut index: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut silent = 0;
    for (k, fragment) in path.path.iter().enumerate() {
        let target = path.target_interval(k);
        let Some((interval, level)) = used.get(fragment).filter(|_| target.1 > target.0) else {
            silent += 1;
            continue;
        };
        let pieces = pieces(*interval, target, rules.piece);
        let first = *index.entry((*fragment, pieces)).or_insert_with(|| {
            let first = sources.len();
            sources.extend((0..pieces).map(|piece| ScoreSource {
                name: if pieces == 1 {
                    format!("fragment {fragment}")
                } else {
                    format!("fragment {fragment}, {piece} of {pieces}")
                },
                recording: Some(recording.to_owned()),
                segments: vec![part(*interval, piece, pieces)],
                outside: Outside::None,
                location: Location::default(),
            }));
            first
        });
        targets.extend((0..pieces).map(|piece| {
            let (from, to) = part(target, piece, pieces);
            ScoreTarget {
                sources: vec![first + piece],
                curve: WeightCurve::constant(from, to, weight(*level)),
                location: Location::default(),
            }
        }));
    }
    let duration = path.target_cuts.last().map(|k| *k as f64 / path.rates.1);
    (SoundScore { duration, sources, targets, ..SoundScore::default() }, silent)
}

/// The node over [`path_to_score`].
#[derive(Debug)]
pub struct PathScore;

impl Func for PathScore {
    type Params = PathScoreParams;
    type Ports = PathScorePorts;
    const NAME: &'static str = "PathScore";

    fn eval(p: &PathScoreParams, _: &Build<'_>, mut io: PathScoreIo<'_>) -> Result<Summary, Fault> {
        let tree = io.tree;
        if p.least > p.greatest {
            let message = format!("`least` is {}, and `greatest` is {}", p.least, p.greatest);
            return Err(Fault::new("F156", message).at("least").help("`least` must be at most `greatest`"));
        }
        let source =
            tree.find(&p.recording.0).map_err(|e| Fault::new("F156", e.to_string()).at("recording"))?;
        let rules =
            PathScoreRules { least: p.least, greatest: p.greatest, piece: p.piece, av_offset: p.av_offset };
        let soundtrack = (tree.sources[source].name.as_str(), &tree.channels_of(source)[..], tree.rate);
        let (score, silent) = path_to_score(io.path, soundtrack, &rules);
        let mut summary: Summary =
            vec![("sounds", score.sources.len().into()), ("targets", score.targets.len().into())];
        if silent > 0 {
            let text = format!("{silent} fragments have no sound: the soundtrack ends before the motion");
            summary.push(("warning", text.into()));
        }
        io.score.set(score);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (PathScoreParams, MemoryFiles) {
        let (least, greatest) = (rng.between(0.0, 0.3), rng.between(0.3, 1.0));
        let p = PathScoreParams {
            recording: "".into(),
            least,
            greatest,
            piece: Some(rng.between(0.02, 0.5)),
            av_offset: rng.between(-0.1, 0.1),
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_those_of_the_interval() {
        let x = vec![vec![1.0_f32; 50], vec![0.0; 50]];
        assert!((level(&x, 10.0, (1.0, 3.0)) - 0.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(pieces((0.0, 0.3), (1.0, 1.55), Some(0.1)), 6);
        assert_eq!(
            (pieces((0.0, 0.3), (1.0, 1.5), None), pieces((0.0, 0.012), (1.0, 1.5), Some(0.1))),
            (1, 2)
        );
        assert_eq!((part((1.0, 3.0), 0, 4), part((1.0, 3.0), 3, 4)), ((1.0, 1.5), (2.5, 3.0)));
        assert_eq!((level(&x, 10.0, (9.0, 10.0)), level(&x, 10.0, (3.0, 1.0))), (0.0, 0.0));
    }
}
