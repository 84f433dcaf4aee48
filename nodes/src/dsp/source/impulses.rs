//! The node `Impulses`.

use super::trigger::Trigger;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::{archive_state, params, ports};
params! {
    /// Generates a click for each trigger, at the first sample at or after it.
    ///
    /// Clicks add up. The peak of a click is the gain of its trigger; it decays exponentially.
    pub struct ImpulsesParams {
        /// Time after which a click has fallen by 60 dB; at 0 it is one sample.
        decay: f64 = 0.0, unit "s", range 0.0..=60.0;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    /// Ports of `Impulses`.
    pub struct ImpulsesPorts / ImpulsesIo {
        in {
            /// Triggers of the clicks.
            events: Events<Trigger>,
        }
        out {
            /// Mono clicks.
            audio: Stream<f32>,
        }
    }
}

/// The node `Impulses`.
#[derive(Debug)]
pub struct ImpulsesNode {
    /// Factor from one sample to the next.
    decay: f64,
    level: f64,
}

impl Node for ImpulsesNode {
    type Params = ImpulsesParams;
    type Ports = ImpulsesPorts;
    const NAME: &'static str = "Impulses";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 3.0;

    fn shape(p: &ImpulsesParams, s: &mut Shape<'_, '_, ImpulsesPorts>) -> Result<(), Reject> {
        // A trigger between the last sample of a window and its end sounds at the first sample of the next window.
        let sample = p.rate.span(1);
        s.lookaround(ImpulsesPorts::events, sample as usize, 0);
        s.tail(ticks(p.decay) + sample);
        s.output(ImpulsesPorts::audio, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &ImpulsesParams, _: &Build<'_>) -> Result<Self, Fault> {
        let frames = p.decay * p.rate.as_f64();
        let decay = if frames > 0.0 { libm::exp(-1000.0_f64.ln() / frames) } else { 0.0 };
        Ok(Self { decay, level: 0.0 })
    }

    fn run(&mut self, mut io: ImpulsesIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.audio.first(), io.audio.rate());
        let events = io.events.events().iter();
        let mut pending =
            events.map(|(tick, t)| (rate.first_at(*tick), t)).skip_while(|e| e.0 < first).peekable();
        for (item, out) in (first..).zip(io.audio.items()) {
            self.level *= self.decay;
            while let Some((_, trigger)) = pending.next_if(|e| e.0 == item) {
                self.level += f64::from(trigger.gain);
            }
            // The tail must not become denormal; this is far below the last bit of any format.
            if self.level.abs() < 1e-30 {
                self.level = 0.0;
            }
            *out = self.level as f32;
        }
        Ok(())
    }

    fn adopt(&mut self, old: &mut Self) {
        self.level = old.level;
    }

    fn trial(rng: &mut Rng) -> (ImpulsesParams, MemoryFiles) {
        let decay = [0.0, rng.between(0.0, 0.3)][rng.below(2)];
        (ImpulsesParams { decay, ..ImpulsesParams::trial(rng) }, MemoryFiles::default())
    }

    archive_state!(level);
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    fn clicks(decay: f64, events: Vec<(i64, f32)>) -> Vec<f32> {
        let params = ImpulsesParams { decay, rate: Rate::hz(1000) };
        let events = events.into_iter().map(|(tick, gain)| (tick, Trigger::of(gain))).collect();
        let standalone =
            Standalone::new::<ImpulsesNode>(params).events(ImpulsesPorts::events, events, ticks(0.01));
        standalone.run().unwrap().stream(ImpulsesPorts::audio)
    }

    #[test]
    fn a_click_is_at_the_first_sample_at_or_after_its_trigger() {
        let audio = clicks(0.0, vec![(ticks(0.003), 1.0), (ticks(0.003) + 1, 0.5), (ticks(0.004), 0.25)]);
        assert_eq!(audio[..6], [0.0, 0.0, 0.0, 1.0, 0.75, 0.0]);
    }

    #[test]
    fn a_negative_trigger_clicks_downwards() {
        assert_eq!(clicks(0.0, vec![(0, -0.5)])[..2], [-0.5, 0.0]);
    }

    #[test]
    fn a_click_falls_by_60_db_in_its_decay() {
        let audio = clicks(0.02, vec![(0, 1.0)]);
        assert!((audio[20] - 0.001).abs() < 1e-6 && (audio[10] - 0.001_f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_trigger_after_the_last_sample_of_its_window_still_sounds() {
        assert_eq!(clicks(0.0, vec![(ticks(0.01) - 1, 1.0)])[10], 1.0);
    }
}
