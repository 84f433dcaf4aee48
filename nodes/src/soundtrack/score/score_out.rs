//! The node `ScoreOut`.

use super::model::SoundScore;
use super::text::write_score;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::params::OutPath;
use crate::core::ports::Value;
use crate::core::shape::{Build, Shape};
use crate::io::text_output::TextOutput;
use crate::{params, ports};

params! {
    /// Writes a score to a file to edit, which `ScoreFile` reads.
    pub struct ScoreOutParams {
        /// The file, such as `auto.score.ron`.
        path: OutPath;
    }
}
ports! {
    pub struct ScoreOutPorts / ScoreOutIo {
        in {
            /// The score.
            score: Value<SoundScore>,
        }
        out {}
    }
}

/// The node over [`write_score`].
#[derive(Debug)]
pub struct ScoreOut {
    file: TextOutput,
    text: String,
}

impl Node for ScoreOut {
    type Params = ScoreOutParams;
    type Ports = ScoreOutPorts;
    const NAME: &'static str = "ScoreOut";
    const CLASS: Class = Class::Offline;

    fn shape(_: &ScoreOutParams, s: &mut Shape<'_, '_, ScoreOutPorts>) -> Result<(), Reject> {
        s.ends(Some(0));
        Ok(())
    }

    fn build(p: &ScoreOutParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let score = cx.value(ScoreOutPorts::score);
        let text = write_score(
            &score,
            &["Times are in s; 1 is hard inclusion, -1 hard exclusion, 0 no constraint."],
        );
        Ok(Self { file: TextOutput::create(cx, "path", &p.path)?, text })
    }

    fn run(&mut self, _: ScoreOutIo<'_>) -> Result<(), Fault> {
        Ok(())
    }

    fn finish(&mut self, _: ScoreOutIo<'_>) -> Result<Summary, Fault> {
        let mut summary = Summary::new();
        self.file.write(&self.text, &mut summary)?;
        Ok(summary)
    }
}
