//! The node `LiveMeter`.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::input::Display;
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::{Params, Text};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::dsp::LevelMeter;
use crate::{params, ports};

params! {
    /// Passes a sound or a force on unchanged and shows its level while the graph plays.
    ///
    /// `foley live` draws the last readings of each meter as a curve beside the status, and lists them with `--json`. In an offline run the
    /// node does nothing; `LevelMeter` measures the same as a stream.
    ///
    /// # Source
    /// The curve of the excitation force in figure 9 of Picard, Tsingos and Faure, "Audio texture synthesis for complex
    /// contact interactions" (VRIPHYS 2008).
    pub struct LiveMeterParams {
        /// Name of the curve.
        name: Text;
        /// Readings per second, each of the peak and the root mean square of all samples and channels since the last one.
        rate: f64 = 30.0, unit "Hz", range 0.1..=240.0;
    }
}
ports! {
    /// Ports of `LiveMeter`.
    pub struct LiveMeterPorts / LiveMeterIo {
        in {
            /// The signal.
            audio: Stream<f32>,
        }
        out {
            /// The same signal.
            out: Stream<f32>,
        }
    }
}

/// The node `LiveMeter`.
pub struct LiveMeter {
    display: Option<Box<dyn Display>>,
    /// Frames between two readings.
    interval: u64,
    /// Frames until the next one.
    left: u64,
    meter: LevelMeter,
}

impl LiveMeter {
    fn measure(&mut self, mut samples: &[f32], channels: usize) {
        let Some(display) = &mut self.display else { return };
        while !samples.is_empty() {
            let frames = (samples.len() / channels) as u64;
            let now = self.left.min(frames);
            let (head, tail) = samples.split_at(now as usize * channels);
            self.meter.process(head);
            (samples, self.left) = (tail, self.left - now);
            if self.left == 0 {
                let level = std::mem::take(&mut self.meter).level();
                display.show(level.peak, level.rms);
                self.left = self.interval;
            }
        }
    }
}

impl Node for LiveMeter {
    type Params = LiveMeterParams;
    type Ports = LiveMeterPorts;
    const NAME: &'static str = "LiveMeter";
    const CLASS: Class = Class::Audio;

    fn shape(_: &LiveMeterParams, s: &mut Shape<'_, '_, LiveMeterPorts>) -> Result<(), Reject> {
        let audio = s.input(LiveMeterPorts::audio);
        let Channels(channels) = audio.format;
        s.output(LiveMeterPorts::out, audio.rate, Channels(channels));
        Ok(())
    }

    fn build(p: &LiveMeterParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let interval = (cx.input(LiveMeterPorts::audio).rate.as_f64() / p.rate).round().max(1.0) as u64;
        let display = cx.inputs.open_display(&p.name.0, p.rate);
        Ok(Self { display, interval, left: interval, meter: LevelMeter::default() })
    }

    fn run(&mut self, mut io: LiveMeterIo<'_>) -> Result<(), Fault> {
        let channels = io.audio.width().max(1);
        let samples = io.audio.items();
        io.out.items().copy_from_slice(samples);
        self.measure(samples, channels);
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (LiveMeterParams, MemoryFiles) {
        (
            LiveMeterParams { rate: rng.between(1.0, 200.0), ..LiveMeterParams::trial(rng) },
            MemoryFiles::default(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dsp::Level;
    use std::sync::{Arc, Mutex};

    struct List(Arc<Mutex<Vec<Level>>>);

    impl Display for List {
        fn show(&mut self, peak: f32, rms: f64) {
            self.0.lock().unwrap().push(Level { peak, rms });
        }
    }

    #[test]
    fn readings_do_not_depend_on_windows() {
        let audio: Vec<f32> = (0..2000).map(|n| ((n * 37) % 101) as f32 * 0.01 - 0.5).collect();
        let read = |window: usize| {
            let list = Arc::new(Mutex::new(Vec::new()));
            let display: Box<dyn Display> = Box::new(List(Arc::clone(&list)));
            let mut node =
                LiveMeter { display: Some(display), interval: 100, left: 100, meter: LevelMeter::default() };
            audio.chunks(2 * window).for_each(|samples| node.measure(samples, 2));
            std::mem::take(&mut *list.lock().unwrap())
        };
        let found = read(1000);
        assert_eq!(found.len(), 10);
        for (reading, samples) in found.iter().zip(audio.chunks(200)) {
            let rms = (samples.iter().map(|x| x * x).sum::<f32>() / 200.0).sqrt();
            let peak = samples.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
            assert!(reading.peak == peak && (reading.rms - f64::from(rms)).abs() < 1e-6);
        }
        assert!(found == read(64) && found == read(7));
    }
}
