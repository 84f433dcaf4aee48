//! Times at which samples begin.

use crate::core::time::{Rate, Tick, ticks};
use crate::{choices, params};

choices! {
    /// Delay of a sample after its event.
    pub enum Jitter {
        /// Uniform from 0 to `jitter_time` rounded up to whole frames. Only whole frames hide the
        /// frame rate of the motion completely.
        WholeFrames,
        /// As `WholeFrames`, but centred at the event: half of the samples begin before it.
        Centred,
        /// Uniform from 0 to `jitter_time`, one reading of the paper.
        Fixed,
        /// No delay: all samples of a frame begin at once.
        Off,
    }
}

/// Maximum frame interval for whole frames of jitter, s.
const MAX_FRAME_INTERVAL: f64 = 0.1;

params! {
    /// Delays of samples after their events.
    pub struct JitterParams {
        /// Delay of a sample after its event.
        jitter: Jitter = Jitter::WholeFrames;
        /// Range of the delays.
        jitter_time: f64 = 0.033333333333333, unit "s", range 0.0..=0.2;
    }
}

impl JitterParams {
    /// Returns the look-ahead in ticks: for samples that begin before their event, and for output up to `lead` frames
    /// of a rate before a sample begins.
    pub(super) fn ahead(&self, lead: usize, rate: Rate) -> Tick {
        let early = match self.jitter {
            Jitter::Centred => ticks(0.5 * (self.jitter_time + MAX_FRAME_INTERVAL)),
            _ => 0,
        };
        early + if lead > 0 { rate.span(lead + 1) } else { 0 }
    }

    /// Returns the range of delays in ticks, for frames of `interval` ticks.
    pub(super) fn spread(&self, interval: Tick) -> Tick {
        let time = ticks(self.jitter_time);
        match self.jitter {
            Jitter::Off => 0,
            Jitter::Fixed => time,
            Jitter::WholeFrames | Jitter::Centred => {
                let frame = interval.clamp(1, ticks(MAX_FRAME_INTERVAL));
                let frames = (time as f64 / frame as f64 - 1e-6).ceil().max(0.0) as Tick;
                frame * frames
            }
        }
    }
}
