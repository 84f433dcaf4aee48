//! The node `Loudness`.

use super::meter::{Level, LevelMeter};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, params, ports};
params! {
    /// Measures peak and root mean square of a whole recording.
    ///
    /// The value is known when the recording has ended: nodes that read it run in a later phase.
    pub struct LoudnessParams {}
}
ports! {
    /// Ports of `Loudness`.
    pub struct LoudnessPorts / LoudnessIo {
        in {
            /// Audio with an end.
            audio: Stream<f32>,
        }
        out {
            /// Its level.
            level: Fold<Level>,
        }
    }
}

/// The node `Loudness`.
#[derive(Debug)]
pub struct LoudnessNode(LevelMeter);

impl Node for LoudnessNode {
    type Params = LoudnessParams;
    type Ports = LoudnessPorts;
    const NAME: &'static str = "Loudness";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 3.0;

    fn shape(_: &LoudnessParams, s: &mut Shape<'_, '_, LoudnessPorts>) -> Result<(), Reject> {
        let _ = s.input(LoudnessPorts::audio);
        Ok(())
    }

    fn build(_: &LoudnessParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self(LevelMeter::default()))
    }

    fn run(&mut self, io: LoudnessIo<'_>) -> Result<(), Fault> {
        self.0.process(io.audio.items());
        Ok(())
    }

    fn finish(&mut self, mut io: LoudnessIo<'_>) -> Result<Summary, Fault> {
        let level = self.0.level();
        io.level.set(level);
        Ok(vec![("peak", level.peak.into()), ("rms", level.rms.into())])
    }

    archive_state!(0);
}
