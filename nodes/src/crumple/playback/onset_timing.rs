//! The times at which samples begin.

use crate::choices;
use crate::core::time::{Rate, Tick, ticks};

choices! {
    /// How much later than its event a sample begins.
    pub enum Jitter {
        /// Anything from 0 to the shortest whole number of frames that is no less than `jitter_time`: only whole frames hide the
        /// frame rate of the motion completely.
        WholeFrames,
        /// As much, but around the event: half of the samples begin before it.
        Centred,
        /// Anything from 0 to `jitter_time`, as the paper may be read.
        Fixed,
        /// Not at all: all samples of a frame begin at once.
        Off,
    }
}

/// The longest that a frame of the motion may last for whole frames of jitter, s.
const SLOWEST: f64 = 0.1;
/// When samples begin and how loud they are.
#[derive(Clone, Debug)]
pub(super) struct Timing {
    pub jitter: Jitter,
    pub jitter_time: f64,
    pub gain: f32,
    pub match_gain: bool,
    pub max_voices: usize,
    pub rate: Rate,
}

impl Timing {
    /// Ticks that a player looks ahead: for samples that begin before their event, and for what is heard `lead` frames before that.
    pub fn ahead(&self, lead: usize) -> Tick {
        let before = match self.jitter {
            Jitter::Centred => ticks(0.5 * (self.jitter_time + SLOWEST)),
            _ => 0,
        };
        before + if lead > 0 { self.rate.span(lead + 1) } else { 0 }
    }

    /// Spread of the beginnings for frames of `interval` ticks.
    pub fn spread(&self, interval: Tick) -> Tick {
        let time = ticks(self.jitter_time);
        match self.jitter {
            Jitter::Off => 0,
            Jitter::Fixed => time,
            Jitter::WholeFrames | Jitter::Centred => {
                let frame = interval.clamp(1, ticks(SLOWEST));
                let frames = (time as f64 / frame as f64 - 1e-6).ceil().max(0.0) as Tick;
                frame * frames
            }
        }
    }
}
