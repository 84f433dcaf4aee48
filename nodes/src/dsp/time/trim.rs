//! The node `Trim`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::dsp::nearest_items;
use crate::{params, ports};

params! {
    /// Extracts a part of audio; the part begins at time zero.
    ///
    /// The node looks ahead by `start` and holds as much audio in memory; `WavIn` cuts a file without that.
    pub struct TrimParams {
        /// Start of the part, to the nearest sample.
        start: f64 = 0.0, unit "s", range 0.0..=3600.0;
        /// Longest duration of the part; None extends it to the end of the audio.
        duration: Option<f64> = None, unit "s", range 0.0..=86_400.0;
    }
}
ports! {
    /// Ports of `Trim`.
    pub struct TrimPorts / TrimIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
        }
        out {
            /// The part.
            out: Stream<f32>,
        }
    }
}

/// The node `Trim`.
#[derive(Debug)]
pub struct TrimNode {
    skip: usize,
}

impl Node for TrimNode {
    type Params = TrimParams;
    type Ports = TrimPorts;
    const NAME: &'static str = "Trim";
    const CLASS: Class = Class::Audio;

    fn shape(p: &TrimParams, s: &mut Shape<'_, '_, TrimPorts>) -> Result<(), Reject> {
        let audio = s.input(TrimPorts::audio);
        let skip = nearest_items(audio.rate, p.start);
        let remaining = audio.items().map(|items| items - skip as i64);
        if remaining.is_some_and(|items| items < 0) {
            let length = audio.items().unwrap_or(0) as f64 / audio.rate.as_f64();
            return Err(Reject::new("F051", format!("`audio` ends at {length} s")).at("start"));
        }
        let duration = p.duration.map(|seconds| nearest_items(audio.rate, seconds) as i64);
        let items = remaining.into_iter().chain(duration).min();
        s.lookaround(TrimPorts::audio, 0, skip);
        s.ends(items.map(|items| audio.rate.tick(items)));
        s.output(TrimPorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &TrimParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { skip: nearest_items(cx.input(TrimPorts::audio).rate, p.start) })
    }

    fn run(&mut self, mut io: TrimIo<'_>) -> Result<(), Fault> {
        let out = io.out.items();
        let from = self.skip * io.audio.width();
        out.copy_from_slice(&io.audio.around()[from..from + out.len()]);
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (TrimParams, MemoryFiles) {
        let short = |rng: &mut Rng| rng.between(0.0, 0.2);
        let TrimParams { duration, .. } = TrimParams::trial(rng);
        let params = TrimParams { start: short(rng), duration: duration.map(|_| short(rng)) };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    fn trim(start: f64, duration: Option<f64>) -> Standalone {
        let audio = (0..8).map(|k| k as f32).collect();
        let standalone = Standalone::new::<TrimNode>(TrimParams { start, duration });
        standalone.input(TrimPorts::audio, Rate::hz(100), Channels(1), audio)
    }

    #[test]
    fn a_part_begins_and_ends_at_the_given_times() {
        let cut = |start, duration| trim(start, duration).run().unwrap().stream(TrimPorts::out);
        assert_eq!(cut(0.02, Some(0.03)), [2.0, 3.0, 4.0]);
        assert_eq!(cut(0.05, None), [5.0, 6.0, 7.0]);
        assert_eq!(cut(0.07, Some(9.0)), [7.0]);
        assert!(cut(0.08, None).is_empty());
    }

    #[test]
    fn a_start_after_the_end_is_refused() {
        assert_eq!(trim(0.09, None).shape().unwrap_err().field.as_deref(), Some("start"));
    }
}
