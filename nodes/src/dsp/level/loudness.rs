//! The node `Loudness`.

use super::loudness_meter::LoudnessMeter;
use super::meter::{Level, LevelMeter};
use super::ramp::linear_to_db;
use super::weighting::{Weighting, WeightingFilter};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, params, ports};
params! {
    /// Measures peak, root mean square and loudness of a whole recording.
    ///
    /// The root mean square is that of the weighted sound, over all channels; the peak has no weight. With `K` the loudness is the
    /// integrated one of ITU-R BS.1770-4 in LUFS, with gates; with `A` and `None` it is the level in dB of full scale.
    ///
    /// The value is known when the recording has ended: nodes that read it run in a later phase.
    ///
    /// # Source
    /// ITU-R BS.1770-4; IEC 61672-1 for `A`.
    pub struct LoudnessParams {
        /// Frequency weighting.
        weighting: Weighting = Weighting::K;
    }
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
pub struct LoudnessNode {
    weighting: Weighting,
    /// Peak, and power without weighting.
    plain: LevelMeter,
    filter: WeightingFilter,
    power: f64,
    samples: u64,
    loudness: LoudnessMeter,
}

impl Node for LoudnessNode {
    type Params = LoudnessParams;
    type Ports = LoudnessPorts;
    const NAME: &'static str = "Loudness";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 12.0;

    fn shape(_: &LoudnessParams, s: &mut Shape<'_, '_, LoudnessPorts>) -> Result<(), Reject> {
        let _ = s.input(LoudnessPorts::audio);
        Ok(())
    }

    fn build(p: &LoudnessParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(LoudnessPorts::audio);
        let (rate, channels) = (audio.rate.as_f64(), usize::from(audio.format.0));
        Ok(Self {
            weighting: p.weighting,
            plain: LevelMeter::default(),
            filter: p.weighting.filter(rate, channels),
            power: 0.0,
            samples: 0,
            loudness: LoudnessMeter::new(rate, channels),
        })
    }

    fn run(&mut self, io: LoudnessIo<'_>) -> Result<(), Fault> {
        let (samples, channels) = (io.audio.items(), io.audio.width().max(1));
        self.plain.process(samples);
        match self.weighting {
            Weighting::None => return Ok(()),
            Weighting::K => self.loudness.process(samples),
            Weighting::A => {}
        }
        for frame in samples.chunks_exact(channels) {
            for (k, x) in frame.iter().enumerate() {
                self.power += self.filter.tick(k, *x).powi(2);
                self.samples += 1;
            }
        }
        Ok(())
    }

    fn finish(&mut self, mut io: LoudnessIo<'_>) -> Result<Summary, Fault> {
        let plain = self.plain.level();
        let weighted = (self.power / self.samples.max(1) as f64).sqrt();
        let (rms, loudness) = match self.weighting {
            Weighting::None => (plain.rms, linear_to_db(plain.rms)),
            Weighting::A => (weighted, linear_to_db(weighted)),
            Weighting::K => (weighted, self.loudness.integrated()),
        };
        io.level.set(Level { rms, ..plain });
        Ok(vec![("peak", plain.peak.into()), ("rms", rms.into()), ("loudness", loudness.into())])
    }

    archive_state!(plain, filter, power, samples, loudness);
}
