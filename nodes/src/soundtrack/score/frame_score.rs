//! The node `FrameScore`.

use super::edit_list::{Edit, EditRules, edits_to_score};
use super::model::SoundScore;
use crate::artefact::value_file::Artefact;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::soundtrack::motion::MotionCurve;
use crate::{params, ports};

params! {
    /// Makes a score of the frames that a new picture shows of its source, one number for each of its frames: the sound follows the picture.
    ///
    /// Such numbers come from a video texture or a motion graph, or from the path of a `FragmentPath`. Frames that follow each other at the speed of
    /// the source are one target, whose sound is that of these frames.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 8, names video textures (Schödl et al., SIGGRAPH 2000) as
    /// future work.
    pub struct FrameScoreParams {
        /// The channel of the numbers.
        channel: usize = 0, unit "", range 0..=1024;
        /// Frames per second of the source; None for those of the new picture.
        fps: Option<f64> = None, unit "Hz", range 1.0..=1000.0;
        /// Longest target: within one, the sound of its frames may come in any order. None for no limit.
        longest: Option<f64> = Some(0.1), unit "s", range 0.001..=86_400.0;
        /// Deviation from the speed of the source within one target.
        tolerance: f64 = 0.5, unit "frames", range 0.0..=1000.0;
        /// Time of a sound in the recording after that of its picture in the source.
        av_offset: f64 = 0.0, unit "s", range -60.0..=60.0;
        /// Weight of the targets: 1 for hard inclusion of their sound, less for a probability.
        weight: f64 = 1.0, unit "", range 0.0..=1.0;
    }
}
ports! {
    pub struct FrameScorePorts / FrameScoreIo {
        in {
            /// For each frame of the new picture, the number of the frame of the source, from 0.
            frames: Value<MotionCurve>,
        }
        out {
            /// The score.
            score: Value<SoundScore>,
        }
    }
}

/// The edits of frames: one for each stretch in which each frame is within the tolerance of where the first leads.
/// Frames in gaps have none.
fn edits(curve: &MotionCurve, p: &FrameScoreParams) -> Vec<Edit> {
    let frames = curve.channel(p.channel);
    let fps = p.fps.unwrap_or(curve.rate);
    let step = fps / curve.rate;
    let most = p.longest.map_or(frames.len(), |longest| ((longest * curve.rate).round() as usize).max(1));
    let is_gap = |k: usize| {
        let next = curve.gaps.partition_point(|(_, to)| *to <= k);
        curve.gaps.get(next).is_some_and(|(from, _)| *from <= k)
    };
    let mut all = Vec::new();
    let mut first = 0;
    while first < frames.len() {
        if is_gap(first) {
            first += 1;
            continue;
        }
        let goes_on = |k: &usize| {
            let expected = frames[first] + (k - first) as f64 * step;
            !is_gap(*k) && (frames[*k] - expected).abs() <= p.tolerance
        };
        let end = first + 1 + (first + 1..frames.len().min(first + most)).take_while(goes_on).count();
        let (from, to) = (first as f64 / curve.rate, end as f64 / curve.rate);
        // Frames at another speed, within the tolerance, have the sound of these frames.
        let last = frames[first..end].iter().fold(frames[first], |most, x| x.max(most));
        let [start, stop] = [frames[first].max(0.0), last.max(0.0) + 1.0].map(|frame| frame / fps);
        all.push(Edit {
            target: (from, to),
            source: (start, stop),
            name: format!("frame {:.0}", frames[first].max(0.0)),
            line: first as u32,
            ..Edit::default()
        });
        first = end;
    }
    all
}

/// The node over [`edits_to_score`].
#[derive(Debug)]
pub struct FrameScore;

impl Func for FrameScore {
    type Params = FrameScoreParams;
    type Ports = FrameScorePorts;
    const NAME: &'static str = "FrameScore";

    fn eval(p: &FrameScoreParams, _: &Build<'_>, mut io: FrameScoreIo<'_>) -> Result<Summary, Fault> {
        let curve = io.frames;
        curve.validate().map_err(|e| Fault::new("F157", e.to_string()).at("frames"))?;
        if p.channel >= curve.channels {
            let message = format!(
                "`channel` is {}, and there are {} channels, counted from 0",
                p.channel, curve.channels
            );
            return Err(Fault::new("F157", message).at("frames"));
        }
        let negative = curve.channel(p.channel).iter().position(|x| *x < -p.tolerance.max(0.5));
        if let Some(k) = negative {
            let value = curve.frame(k)[p.channel];
            let message =
                format!("frame {k} shows frame {value} of the source; a number from 0 on is needed");
            return Err(Fault::new("F157", message).at("frames"));
        }
        let all = edits(curve, p);
        let rules =
            EditRules { av_offset: p.av_offset, weight: p.weight, from_zero: false, ..EditRules::default() };
        let score = edits_to_score(&all, &rules)
            .map_err(|e| Fault::new("F156", e.replacen("line", "frame", 1)).at("frames"))?;
        let mut summary = Artefact::summary(&score);
        summary.push(("duration_s", score.duration.into()));
        io.score.set(score);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (FrameScoreParams, MemoryFiles) {
        let p =
            FrameScoreParams { channel: 0, av_offset: 0.0, tolerance: 100.0, ..FrameScoreParams::trial(rng) };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    fn score(p: FrameScoreParams, values: Vec<f32>) -> Result<SoundScore, Fault> {
        let frames = MotionCurve::with_gaps(10.0, 1, values);
        let run = Standalone::func::<FrameScore>(p).value(FrameScorePorts::frames, frames).run()?;
        Ok(run.value(0).unwrap().get::<SoundScore>().unwrap().clone())
    }

    fn params() -> FrameScoreParams {
        FrameScoreParams { longest: None, ..FrameScoreParams::read(&|_| None).unwrap() }
    }

    #[test]
    fn frames_that_follow_each_other_are_one_target() {
        let mut frames: Vec<f32> = (40..55).map(|k| k as f32).collect();
        frames.extend((5..10).map(|k| k as f32));
        // A jump back to where it was, and a frame that stands.
        frames.extend([44.0, 45.0, 45.0]);
        let found = score(params(), frames.clone()).unwrap();
        let of = |score: &SoundScore| -> Vec<(f64, f64, f64, f64)> {
            let round = |x: f64| (1e6 * x).round() / 1e6;
            let own = score
                .targets
                .iter()
                .map(|t| (t.curve.ends().unwrap(), score.sources[t.sources[0]].segments[0]));
            own.map(|((a, b), (c, d))| (round(a), round(b), round(c), round(d))).collect()
        };
        let expected =
            [(0.0, 1.5, 4.0, 5.5), (1.5, 2.0, 0.5, 1.0), (2.0, 2.2, 4.4, 4.6), (2.2, 2.3, 4.5, 4.6)];
        assert_eq!(of(&found), expected);
        assert_eq!(found.duration, Some(2.3));
        let short = score(FrameScoreParams { longest: Some(0.5), ..params() }, frames).unwrap();
        assert_eq!(of(&short)[1], (0.5, 1.0, 4.5, 5.0));
        // At another frame rate of the source, and later sound.
        let twice: Vec<f32> = (0..10).map(|k| 20.0 + 2.4 * k as f32).collect();
        let p = FrameScoreParams { fps: Some(24.0), av_offset: 0.25, ..params() };
        let found = score(p, twice).unwrap();
        let (from, to) = found.sources[0].segments[0];
        assert_eq!((found.targets.len(), from), (1, 20.0 / 24.0 + 0.25));
        assert!((to - (20.0 + 9.0 * 2.4 + 1.0) / 24.0 - 0.25).abs() < 1e-6, "{to}");
    }

    #[test]
    fn gaps_have_no_target_and_wrong_numbers_are_named() {
        let mut frames = vec![3.0, 4.0, 5.0];
        frames.extend([f32::NAN; 4]);
        frames.extend([9.0, 10.0]);
        let found = score(params(), frames).unwrap();
        let ends: Vec<_> = found.targets.iter().map(|t| t.curve.ends().unwrap()).collect();
        assert_eq!(ends, [(0.0, 0.3), (0.7, 0.9)]);
        let e = score(params(), vec![1.0, -3.0]).unwrap_err();
        assert!(e.message.starts_with("frame 1 shows frame -3 of the source"), "{e}");
        let e = score(FrameScoreParams { channel: 2, ..params() }, vec![1.0]).unwrap_err();
        assert!(e.message.contains("`channel` is 2"), "{e}");
    }
}
