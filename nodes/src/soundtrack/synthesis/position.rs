//! Positions in recordings that the sounds of an output come from.

use crate::core::item::Item;
use crate::core::random::Rng;
use serde::{Deserialize, Serialize};

/// The origin of two samples of an output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SourcePosition {
    /// The recording.
    pub recording: u32,
    /// The first of the samples in the recording.
    pub frame: u32,
    /// Its time, s.
    pub seconds: f32,
}

/// The origins of the samples of an output, in pairs.
#[derive(Debug)]
pub struct SourcePositions;

impl Item for SourcePositions {
    type Elem = SourcePosition;
    type Format = ();
    const NAME: &'static str = "source position";
    const COLUMNS: &'static [&'static str] = &["recording", "seconds"];

    fn width((): &()) -> usize {
        1
    }

    fn describe((): &()) -> String {
        "two samples each".into()
    }

    fn trial_format(_: &mut Rng) {}

    fn trial((): &(), _: usize, rng: &mut Rng) -> SourcePosition {
        let frame = rng.below(4000) as u32;
        SourcePosition { recording: rng.below(2) as u32, frame, seconds: frame as f32 / 8000.0 }
    }

    fn finite(position: &SourcePosition) -> bool {
        position.seconds.is_finite()
    }

    fn poison() -> SourcePosition {
        SourcePosition { recording: u32::MAX, frame: u32::MAX, seconds: f32::NAN }
    }

    fn numbers(position: &SourcePosition, out: &mut Vec<f32>) {
        out.extend([position.recording as f32, position.seconds]);
    }
}
