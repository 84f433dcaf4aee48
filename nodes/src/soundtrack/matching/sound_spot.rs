//! The node `SoundSpot`.

use super::matches::MotionMatches;
use super::spotting::{SpotMode, spots};
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::soundtrack::wavelet::WaveletTree;
use crate::{params, ports};

params! {
    /// Finds the passages of a recording that sound like one of it.
    ///
    /// Link `spots` to a `MatchScore`: all passages together are its sound. Mel cepstra of the passage are compared with all parts from half to
    /// twice its length, by dynamic time warping or as strings. The passage itself is the first.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 5.2, after Spevak and Polfreman, "Sound spotting - a
    /// frame-based approach" (ISMIR 2001).
    pub struct SoundSpotParams {
        /// The recording, by the end of its path; empty for the first of the tree.
        recording: Text = "".into();
        /// Start of the passage.
        from: f64, unit "s", range 0.0..=86_400.0;
        /// End of the passage.
        to: f64, unit "s", range 0.0..=86_400.0;
        /// Method of the comparison of passages.
        mode: SpotMode = SpotMode::Warping;
        /// Greatest number of passages.
        count: usize = 8, unit "", range 1..=10_000;
        /// Least similarity: 1 for the passage itself, 0.37 for the middle of the recording.
        least: f64 = 0.5, unit "", range 0.0..=1.0;
    }
}
ports! {
    pub struct SoundSpotPorts / SoundSpotIo {
        in {
            /// The tree of the recording.
            tree: Value<WaveletTree>,
        }
        out {
            /// The passages, in order of time.
            spots: Value<MotionMatches>,
        }
    }
}

/// The node over [`spots`].
#[derive(Debug)]
pub struct SoundSpot;

impl Func for SoundSpot {
    type Params = SoundSpotParams;
    type Ports = SoundSpotPorts;
    const NAME: &'static str = "SoundSpot";

    fn eval(p: &SoundSpotParams, _: &Build<'_>, mut io: SoundSpotIo<'_>) -> Result<Summary, Fault> {
        let tree = io.tree;
        let source =
            tree.find(&p.recording.0).map_err(|e| Fault::new("F156", e.to_string()).at("recording"))?;
        let channels = tree.channels_of(source);
        let frames = channels.first().map_or(0, Vec::len);
        let mean = |k: usize| channels.iter().map(|x| x[k]).sum::<f32>() / channels.len() as f32;
        let mono: Vec<f32> = (0..frames).map(mean).collect();
        let mut matches = spots(&mono, tree.rate, (p.from, p.to), p.mode, p.count, p.least)
            .map_err(|e| Fault::new("F156", e.to_string()).at("from"))?;
        matches.sort_by(|a, b| a.from.total_cmp(&b.from));
        let summary = vec![("spots", matches.len().into())];
        io.spots.set(MotionMatches { query: (p.from, p.to), threshold: p.least, matches });
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (SoundSpotParams, MemoryFiles) {
        let from = rng.between(0.0, 0.02);
        let p = SoundSpotParams::trial(rng);
        (
            SoundSpotParams { recording: "".into(), from, to: from + rng.between(0.03, 0.05), count: 5, ..p },
            MemoryFiles::default(),
        )
    }
}
