//! The node `ScoreFile`.

use super::model::SoundScore;
use super::text::write_score;
use crate::artefact::value_file::{Artefact, check, read};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Data;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// Reads a score: the sounds of recordings that are wanted, or not, at times of the output.
    ///
    /// A sound has a name and one or more intervals of a recording. A target has a sound, an interval of the output, and a weight from -1 to 1,
    /// constant or as a curve of times and weights: 1 is hard inclusion of the sound and -1 hard exclusion, between them it is a probability.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 4.1.
    pub struct ScoreFileParams {
        /// The file, in RON.
        path: AssetPath;
    }
}
ports! {
    pub struct ScoreFilePorts / ScoreFileIo {
        in {}
        out {
            /// The score.
            score: Value<SoundScore>,
        }
    }
}

/// The node over [`read_score`](super::text::read_score).
#[derive(Debug)]
pub struct ScoreFile;

impl Func for ScoreFile {
    type Params = ScoreFileParams;
    type Ports = ScoreFilePorts;
    const NAME: &'static str = "ScoreFile";
    // Messages name the file.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &ScoreFileParams, s: &mut Shape<'_, '_, ScoreFilePorts>) -> Result<(), Reject> {
        check::<SoundScore, _>(&p.path, s)
    }

    fn eval(p: &ScoreFileParams, cx: &Build<'_>, mut io: ScoreFileIo<'_>) -> Result<Summary, Fault> {
        let score = SoundScore { file: p.path.0.clone(), ..read::<SoundScore>(&p.path, cx)? };
        let summary = Artefact::summary(&score);
        io.score.set(score);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (ScoreFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        files.insert("battle.score.ron", write_score(&SoundScore::trial(rng), &[]).into_bytes());
        (ScoreFileParams { path: "battle.score.ron".into() }, files)
    }
}
