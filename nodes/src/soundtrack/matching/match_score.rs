//! The node `MatchScore`.

use super::matches::{MotionMatches, match_weight};
use crate::artefact::text::Location;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::{Many, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::soundtrack::score::{Outside, ScoreSource, ScoreTarget, SoundScore, WeightCurve};
use crate::{params, ports};

params! {
    /// Makes a score in which one sound is wanted at all matches of a motion.
    ///
    /// The sound is one or more intervals of a recording: `segments`, and those that a `SoundSpot` has found. A match of similarity `s` has the weight
    /// `weight ((s - threshold) / (1 - threshold) proportion + 1 - proportion)`, with a soft beginning and end.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 5.2.
    pub struct MatchScoreParams {
        /// Name of the sound.
        name: Text = "sound".into();
        /// The recording, by the end of its path; empty for the first of the model.
        recording: Text = "".into();
        /// Start and end of each interval of the recording.
        segments: Vec<[f64; 2]> = Vec::new(), unit "s", range 0.0..=86_400.0;
        /// Weight of a match with similarity 1.
        weight: f64 = 1.0, unit "", range -1.0..=1.0;
        /// Share of the weight that falls with the similarity.
        proportion: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Length of the soft beginning and end of a match.
        pad: f64 = 0.05, unit "s", range 0.0..=10.0;
        /// Time by which the sound follows the motion; negative to precede it.
        delay: f64 = 0.0, unit "s", range -60.0..=60.0;
        /// Constraint on the sound outside of the matches.
        outside: Outside = Outside::None;
    }
}
ports! {
    pub struct MatchScorePorts / MatchScoreIo {
        in {
            /// The matches of the motion.
            matches: Value<MotionMatches>,
            /// More intervals of the recording.
            spots: Many<Value<MotionMatches>>,
        }
        out {
            /// The score.
            score: Value<SoundScore>,
        }
    }
}

/// The node `MatchScore`.
#[derive(Debug)]
pub struct MatchScore;

/// A weight from one time to another that begins and ends softly.
fn trapezoid(from: f64, to: f64, weight: f64, pad: f64) -> WeightCurve {
    let pad = pad.min((to - from) / 2.0);
    WeightCurve { points: vec![(from, 0.0), (from + pad, weight), (to - pad, weight), (to, 0.0)] }
}

impl Func for MatchScore {
    type Params = MatchScoreParams;
    type Ports = MatchScorePorts;
    const NAME: &'static str = "MatchScore";

    fn check(p: &MatchScoreParams, s: &mut Shape<'_, '_, MatchScorePorts>) -> Result<(), Reject> {
        if let Some([from, to]) = p.segments.iter().find(|[from, to]| to <= from) {
            let message = format!("a segment is from {from} s to {to} s; its end must be after its start");
            return Err(Reject::new("F156", message).at("segments"));
        }
        if p.segments.is_empty() && !s.linked(MatchScorePorts::spots) {
            let reject = Reject::new("F156", "the sound has no segment").at("segments");
            return Err(reject.help("give intervals of the recording, as in [(3.2, 4.05)], or link `spots`"));
        }
        Ok(())
    }

    fn eval(p: &MatchScoreParams, _: &Build<'_>, mut io: MatchScoreIo<'_>) -> Result<Summary, Fault> {
        let mut segments: Vec<(f64, f64)> = p.segments.iter().map(|[from, to]| (*from, *to)).collect();
        segments.extend(io.spots.iter().flat_map(|spots| &spots.matches).map(|m| (m.from, m.to)));
        if segments.is_empty() {
            return Err(Fault::new("F156", "the sound has no segment").at("segments"));
        }
        segments.sort_by(|a, b| a.0.total_cmp(&b.0));
        let source = ScoreSource {
            name: p.name.0.clone(),
            recording: (!p.recording.0.is_empty()).then(|| p.recording.0.clone()),
            segments,
            outside: p.outside,
            location: Location::default(),
        };
        let target = |m: &super::matches::MotionMatch| {
            let weight = match_weight(p.weight, m.similarity, io.matches.threshold, p.proportion);
            let (from, to) = ((m.from + p.delay).max(0.0), m.to + p.delay);
            (to > from).then(|| ScoreTarget {
                sources: vec![0],
                curve: trapezoid(from, to, weight, p.pad),
                location: Location::default(),
            })
        };
        let targets: Vec<ScoreTarget> = io.matches.matches.iter().filter_map(target).collect();
        let summary = vec![("targets", targets.len().into()), ("segments", source.segments.len().into())];
        io.score.set(SoundScore { sources: vec![source], targets, pad: Some(0.0), ..SoundScore::default() });
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (MatchScoreParams, MemoryFiles) {
        let from = rng.between(0.0, 1.0);
        let p = MatchScoreParams {
            segments: vec![[from, from + rng.between(0.1, 1.0)]],
            pad: rng.between(0.0, 0.1),
            delay: rng.between(-0.1, 0.1),
            ..MatchScoreParams::trial(rng)
        };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_meet_in_the_middle_of_short_matches() {
        assert_eq!(trapezoid(1.0, 2.0, 0.5, 0.25).points, [(1.0, 0.0), (1.25, 0.5), (1.75, 0.5), (2.0, 0.0)]);
        assert_eq!(trapezoid(1.0, 1.5, 1.0, 1.0).points, [(1.0, 0.0), (1.25, 1.0), (1.25, 1.0), (1.5, 0.0)]);
    }
}
