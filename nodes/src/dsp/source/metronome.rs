//! The node `Metronome`.

use super::output::ends_after;
use super::trigger::Trigger;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{seconds, ticks};
use crate::{params, ports};
params! {
    /// Emits triggers at equal intervals from time zero on, without drift.
    pub struct MetronomeParams {
        /// Time between two triggers.
        interval: f64 = 0.5, unit "s", range 0.001..=3600.0;
        /// Amplitude factor of each trigger.
        gain: f32 = 1.0, unit "", range 0.0..=100.0_f32;
        /// Length; None is endless.
        duration: Option<f64> = None, unit "s", range 0.0..=86_400.0;
    }
}
ports! {
    /// Ports of `Metronome`.
    pub struct MetronomePorts / MetronomeIo {
        in {}
        out {
            /// The triggers.
            beats: Events<Trigger>,
        }
    }
}

/// The node `Metronome`.
#[derive(Debug)]
pub struct MetronomeNode(MetronomeParams);

impl Node for MetronomeNode {
    type Params = MetronomeParams;
    type Ports = MetronomePorts;
    const NAME: &'static str = "Metronome";
    const CLASS: Class = Class::Audio;
    const VERSION: u32 = 2;

    fn shape(p: &MetronomeParams, s: &mut Shape<'_, '_, MetronomePorts>) -> Result<(), Reject> {
        s.ends(ends_after(p.duration));
        Ok(())
    }

    fn build(p: &MetronomeParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self(p.clone()))
    }

    fn run(&mut self, mut io: MetronomeIo<'_>) -> Result<(), Fault> {
        let MetronomeParams { interval, gain, .. } = self.0;
        let (from, to) = io.beats.window();
        // One trigger early, since the division may round up.
        let first = (seconds(from) / interval).floor() as i64 - 1;
        let times = (first.max(0)..).map(|k| ticks(k as f64 * interval));
        for tick in times.skip_while(|t| *t < from).take_while(|t| *t < to) {
            io.beats.push(tick, Trigger::of(gain));
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (MetronomeParams, MemoryFiles) {
        let params = MetronomeParams::trial(rng);
        let (interval, duration) = (rng.between(0.005, 0.2), params.duration.map(|_| rng.between(0.0, 1.0)));
        (MetronomeParams { interval, duration, ..params }, MemoryFiles::default())
    }
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    #[test]
    fn triggers_are_at_multiples_of_the_interval() {
        let params = MetronomeParams { interval: 0.1, gain: 0.5, duration: Some(0.35) };
        let beats = Standalone::new::<MetronomeNode>(params).window(ticks(0.013)).run().unwrap();
        let beats = beats.events(MetronomePorts::beats);
        let expected: Vec<_> = [0.0, 0.1, 0.2, 0.3].map(|t| (ticks(t), Trigger::of(0.5))).into();
        assert_eq!(beats, expected);
    }
}
