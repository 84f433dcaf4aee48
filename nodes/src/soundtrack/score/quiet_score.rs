//! The node `QuietScore`.

use super::model::SoundScore;
use super::quiet::{quiet_passages, share_within};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::soundtrack::wavelet::WaveletTree;
use crate::{params, ports};

params! {
    /// Lowers the weights of targets whose sounds are nearly silent, so that others are satisfied better.
    ///
    /// Silence is found nearly everywhere, and need not be requested. A passage is quiet if it is below -60 dB of full scale, or less than 6 dB
    /// above the quietest tenth of its recording.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 8, which names this as future work.
    pub struct QuietScoreParams {
        /// Factor on the weights of quiet targets.
        factor: f64 = 0.25, unit "", range 0.0..=1.0;
        /// Minimum share of a sound that counts as quiet.
        share: f64 = 0.9, unit "", range 0.0..=1.0;
    }
}
ports! {
    pub struct QuietScorePorts / QuietScoreIo {
        in {
            /// The score.
            score: Value<SoundScore>,
            /// The tree of its recordings.
            tree: Value<WaveletTree>,
        }
        out {
            /// The score with lower weights.
            lowered: Value<SoundScore>,
        }
    }
}

/// The node over [`quiet_passages`].
#[derive(Debug)]
pub struct QuietScore;

impl Func for QuietScore {
    type Params = QuietScoreParams;
    type Ports = QuietScorePorts;
    const NAME: &'static str = "QuietScore";

    fn eval(p: &QuietScoreParams, _: &Build<'_>, mut io: QuietScoreIo<'_>) -> Result<Summary, Fault> {
        let tree = io.tree;
        let passages: Vec<Vec<(f64, f64)>> =
            (0..tree.sources.len()).map(|k| quiet_passages(&tree.channels_of(k), tree.rate)).collect();
        let is_quiet: Vec<bool> = io
            .score
            .sources
            .iter()
            .map(|source| {
                let recording = tree.find(source.recording.as_deref().unwrap_or_default());
                recording.is_ok_and(|k| share_within(&source.segments, &passages[k]) > p.share)
            })
            .collect();
        let mut score = io.score.clone();
        let (mut targets, mut seconds) = (0_usize, 0.0);
        for target in &mut score.targets {
            if !target.sources.iter().all(|k| is_quiet.get(*k) == Some(&true)) {
                continue;
            }
            let points = &mut target.curve.points;
            points.iter_mut().for_each(|(_, weight)| *weight *= p.factor);
            targets += 1;
            if let (Some(first), Some(last)) = (points.first(), points.last()) {
                seconds += last.0 - first.0;
            }
        }
        io.lowered.set(score);
        let sounds = is_quiet.iter().filter(|quiet| **quiet).count();
        Ok(vec![("quiet_sounds", sounds.into()), ("targets", targets.into()), ("seconds", seconds.into())])
    }
}
