//! The node `Mfcc`.

use std::sync::Arc;

use super::conventions::FloorRule;
use super::item::{FeatureFormat, Features};
use super::mel_cepstrum::MelCepstrum;
use crate::archive_state;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::dsp::{Band, Butterworth, Cascade};
use crate::unit::UnitDatabase;
use crate::{choices, feature_params, ports};

choices! {
    /// Treatment of several channels.
    pub enum FeatureChannels {
        /// One vector for each channel; later nodes process them independently.
        Independent,
        /// One vector of the coefficients of all channels in sequence.
        Joint,
        /// One vector of the mean power of all channels: one choice of units for all, to which `InterauralCues` adds the differences.
        SharedMid,
    }
}

feature_params! {
    /// Computes the mel cepstrum of every unit of a sound: a few numbers that describe its level and its spectrum.
    ///
    /// The defaults are those of cloth sounds: three disjoint bands, natural logarithm, with coefficient 0. The usual MFCC of
    /// speech and music are `n: 13, bands: 40, shape: TriangularArea, mel: Slaney, log: Decibel, window: Hann`, a `frame` of
    /// 2048 samples and a `unit` of "512 samples", without a high-pass; `first: 1` omits the coefficient of loudness.
    ///
    /// Unit `i` begins at sample `i` times its length; its window is centred on it. The stream of features holds all parameters, so that
    /// features and databases of other parameters are refused.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.2; Davis and
    /// Mermelstein (1980).
    pub struct MfccParams {
        /// Treatment of several channels.
        channels: FeatureChannels = FeatureChannels::Independent;
    }
}

ports! {
    pub struct MfccPorts / MfccIo {
        in {
            /// The sound.
            audio: Stream<f32>,
            /// Database that contains the lowest energy with `floor_from: Database`.
            database: Option<Value<UnitDatabase>>,
        }
        out {
            /// Features, one item per unit.
            features: Stream<Features>,
        }
    }
}

/// The node `Mfcc`.
pub struct Mfcc {
    cepstrum: MelCepstrum,
    high_pass: Option<Cascade>,
    mode: FeatureChannels,
    /// Coefficients per channel.
    n: usize,
    unit: i64,
    /// Number of samples by which a window begins before its unit.
    window_offset: i64,
    from_database: bool,
    /// Filtered samples per channel, from sample `start` on.
    buffered: Vec<Vec<f32>>,
    start: i64,
    /// Interleaved new samples for the high-pass.
    new_samples: Vec<f32>,
}

/// Returns the number of samples by which a window begins before its unit.
fn window_offset(frame: u32, unit: u32) -> i64 {
    (i64::from(frame) - i64::from(unit)).div_euclid(2)
}

impl Mfcc {
    /// Filters and buffers new samples.
    fn buffer_input(&mut self, around: &[f32], first: i64, channels: usize) {
        let buffered_end = self.start + self.buffered[0].len() as i64;
        if self.buffered[0].is_empty() {
            self.start = first;
        }
        let skip =
            if self.buffered[0].is_empty() { 0 } else { (buffered_end - first).max(0) as usize * channels };
        self.new_samples.clear();
        self.new_samples.extend(around.get(skip..).unwrap_or_default());
        if let Some(filter) = &mut self.high_pass {
            filter.process(&mut self.new_samples);
        }
        for frame in self.new_samples.chunks_exact(channels) {
            for (buffered, &x) in self.buffered.iter_mut().zip(frame) {
                buffered.push(x);
            }
        }
    }

    /// Discards samples before index `before`.
    fn discard(&mut self, before: i64) {
        let count =
            usize::try_from(before - self.start).unwrap_or(0).min(self.buffered[0].len().saturating_sub(1));
        self.buffered.iter_mut().for_each(|buffered| drop(buffered.drain(..count)));
        self.start += count as i64;
    }

    /// Computes the features of one unit.
    fn unit(&mut self, unit: i64, out: &mut [f32]) {
        let from = (unit * self.unit - self.window_offset - self.start).max(0) as usize;
        let to = from + self.cepstrum.frame();
        let frames = self.buffered.iter().map(|buffered| buffered.get(from..to).unwrap_or_default());
        if self.mode == FeatureChannels::SharedMid {
            self.cepstrum.process_mean(frames, out);
        } else {
            frames
                .zip(out.chunks_exact_mut(self.n))
                .for_each(|(frame, out)| self.cepstrum.process(frame, out));
        }
    }
}

impl Node for Mfcc {
    type Params = MfccParams;
    type Ports = MfccPorts;
    const NAME: &'static str = "Mfcc";
    const VERSION: u32 = 2;
    const CLASS: Class = Class::Worker;
    const COST: f64 = 15.0;

    fn shape(p: &MfccParams, s: &mut Shape<'_, '_, MfccPorts>) -> Result<(), Reject> {
        let audio = s.input(MfccPorts::audio);
        let channels = u32::from(audio.format.0);
        let joined = if p.channels == FeatureChannels::Joint { channels } else { 1 };
        let c = p.convention_params(&[], false).conventions(audio.rate, joined)?;
        if c.f_hi > audio.rate.as_f64() / 2.0 + 1.0 {
            s.note(format!(
                "the bands extend to {} Hz, above half the rate of the audio, {}",
                c.f_hi, audio.rate
            ));
        }
        let offset = window_offset(c.frame, c.unit);
        let look_ahead = (i64::from(c.frame) - offset - 1).max(0);
        s.lookaround(MfccPorts::audio, offset.max(0) as usize, look_ahead as usize);
        let vectors = if p.channels == FeatureChannels::Independent { channels as usize } else { 1 };
        let too_long = || Reject::new("F051", format!("units of {} samples are too long", c.unit)).at("unit");
        let rate = c.unit_rate().ok_or_else(too_long)?;
        s.output(MfccPorts::features, rate, FeatureFormat { vectors, conventions: Arc::new(c) });
        Ok(())
    }

    fn build(p: &MfccParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let channels = usize::from(cx.input(MfccPorts::audio).format.0);
        let c = cx.output(MfccPorts::features).format.conventions;
        let floor = match c.floor {
            FloorRule::Level(db) => 10f64.powf(db / 10.0),
            FloorRule::Database => 1e-10,
        };
        let high_pass = match c.high_pass > 0.0 {
            true => {
                let order = c.high_pass_order as usize;
                let design = Butterworth::design(Band::HighPass, order, c.high_pass, c.rate.as_f64());
                Some(Cascade::new(&design.map_err(|e| Reject::from(e).at("high_pass"))?, channels))
            }
            false => None,
        };
        Ok(Self {
            cepstrum: MelCepstrum::new(&c, floor),
            high_pass,
            mode: p.channels,
            n: c.n as usize,
            unit: i64::from(c.unit),
            window_offset: window_offset(c.frame, c.unit),
            from_database: c.floor == FloorRule::Database,
            buffered: vec![Vec::new(); channels],
            start: 0,
            new_samples: Vec::new(),
        })
    }

    fn run(&mut self, mut io: MfccIo<'_>) -> Result<(), Fault> {
        if self.from_database {
            let missing =
                || Fault::new("F051", "`floor_from` is Database, and `database` has no link").at("database");
            self.cepstrum.set_floor(io.database.ok_or_else(missing)?.floor_energy);
        }
        let channels = io.audio.width().max(1);
        let first = io.audio.first() - io.audio.behind() as i64;
        self.buffer_input(io.audio.around(), first, channels);
        let (unit, width) = (io.features.first(), io.features.width().max(1));
        for (unit, out) in (unit..).zip(io.features.items().chunks_exact_mut(width)) {
            self.unit(unit, out);
        }
        let next = io.audio.first() + io.audio.len() as i64;
        self.discard(next - self.window_offset.max(0));
        Ok(())
    }

    archive_state!(each high_pass, buffered, start);

    fn trial(rng: &mut Rng) -> (MfccParams, MemoryFiles) {
        let p = MfccParams::trial(rng);
        let first = p.first % 3;
        let n = 1 + p.n % 4;
        let params = MfccParams {
            first,
            n,
            bands: p.bands.map(|bands| first + n + bands % 5),
            f_lo: p.f_lo % 10.0,
            f_hi: 15.0 + p.f_hi % 400.0,
            frame: p.frame.map(|frame| 1 + frame % 12),
            floor_from: super::FloorFrom::Level,
            high_pass: p.high_pass % 10.0,
            ..p
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
