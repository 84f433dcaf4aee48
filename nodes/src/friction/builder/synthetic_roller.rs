//! Recordings of a cloth-covered roller with known spectra, and the node `SyntheticRoller`.

use std::f64::consts::{PI, TAU};

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::{Random, Rng};
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::dsp::GaussianNoise;
use crate::{params, ports};

/// Share of the rate above which a partial is silent, and below which it has its whole amplitude.
const FADE: [f64; 2] = [0.40, 0.45];
/// Channel of the broadband noise among the random numbers; partials have those of their own.
const BROADBAND: u32 = 0;
/// Samples of broadband noise at a time.
const BLOCK: usize = 256;

params! {
    /// Generates the recording of a cloth-covered roller whose speed grows, and the signal of its tachometer.
    ///
    /// Speed grows exponentially from `slowest` to `fastest`. The root mean square is proportional to speed. A spectral line follows the
    /// speed by a power law: `frequency speed^exponent`, with `harmonics`. The wales of corduroy pass one after another, so that the
    /// exponent is 1 and the frequency the inverse of their distance: 667 Hz at 1 m/s for 1.5 mm. A smooth fabric has one wide line
    /// (`harmonics: 1`, `coherence: 1`) that rises more slowly. The line is noise: its partials change amplitude and phase at random
    /// within `coherence` periods. `noise` is the share of power of white noise.
    ///
    /// Its spectra at every speed are known, so that a `FrictionModelBuilder` and the nodes after it can be checked without a roller.
    ///
    /// # Randomness
    /// A sample depends on the seed and the sample index only.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2 and figure 3, whose
    /// recordings have peaks that rise with speed; the law is this project's own.
    pub struct SyntheticRollerParams {
        /// Frequency of the line at 1 m/s.
        frequency: f64 = 667.0, unit "Hz", range 0.1..=100_000.0;
        /// Power of speed to which the frequency is proportional.
        exponent: f64 = 1.0, unit "", range 0.0..=4.0;
        /// Partials of the line, at whole multiples of its frequency; each is softer by its number.
        harmonics: u32 = 4, unit "partials", range 1..=64_u32;
        /// Periods of a partial within which it changes amplitude and phase.
        coherence: f64 = 8.0, unit "periods", range 0.5..=1000.0;
        /// Share of the power that is white noise.
        noise: f64 = 0.1, unit "", range 0.0..=1.0;
        /// Speed at the start.
        slowest: f64 = 0.05, unit "m/s", range 0.0001..=100.0;
        /// Speed at the end; above `slowest`.
        fastest: f64 = 1.2, unit "m/s", range 0.0001..=100.0;
        /// Root mean square at the end, of full scale.
        level: f64 = 0.1, unit "", range 0.0..=100.0;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
        /// Length.
        duration: f64 = 8.0, unit "s", range 0.001..=3600.0;
    }
}

ports! {
    pub struct SyntheticRollerPorts / SyntheticRollerIo {
        in {}
        out {
            /// The sound.
            audio: Stream<f32>,
            /// The speed, as a share of `fastest`: the `turning` of a `FrictionModelBuilder` with `full_scale` at `fastest`.
            turning: Stream<f32>,
        }
    }
}

/// The sound and the tachometer of a roller, computed from the sample index.
#[derive(Clone, Debug)]
pub struct RollerSound {
    params: SyntheticRollerParams,
    random: Random,
    broadband: GaussianNoise,
    /// For each partial, the complex amplitudes between which it is, and the index of the first.
    partials: Vec<(u64, [[f64; 2]; 2])>,
}

impl RollerSound {
    /// Creates the sound of a roller.
    #[must_use]
    pub fn new(params: SyntheticRollerParams, random: Random) -> Self {
        let partials = vec![(u64::MAX, [[0.0; 2]; 2]); params.harmonics as usize];
        Self { params, random, broadband: GaussianNoise::new(random, BROADBAND), partials }
    }

    /// Writes samples `first..` of the sound and of the tachometer, equally many; both are silent before the start and after the end.
    ///
    /// # Complexity
    /// O(samples * harmonics); no allocation.
    pub fn fill(&mut self, mut first: i64, audio: &mut [f32], turning: &mut [f32]) {
        let mut white = [0.0; BLOCK];
        for (audio, turning) in audio.chunks_mut(BLOCK).zip(turning.chunks_mut(BLOCK)) {
            let white = &mut white[..audio.len()];
            self.broadband.fill(first, white);
            for (((index, audio), turning), white) in (first..).zip(audio).zip(turning).zip(&*white) {
                [*audio, *turning] = self.sample(index, *white);
            }
            first += white.len() as i64;
        }
    }

    /// Growth of the logarithm of speed, 1/s.
    fn growth(&self) -> f64 {
        libm::log(self.params.fastest / self.params.slowest) / self.params.duration
    }

    /// Speed at a time, m/s.
    fn speed(&self, t: f64) -> f64 {
        self.params.slowest * libm::exp(self.growth() * t)
    }

    /// Periods of the line since the start: the integral of its frequency.
    fn periods(&self, t: f64) -> f64 {
        let p = &self.params;
        let growth = p.exponent * self.growth();
        let first = p.frequency * libm::pow(p.slowest, p.exponent);
        if growth.abs() < 1e-9 { first * t } else { first / growth * libm::expm1(growth * t) }
    }

    /// The complex amplitude of a partial at an index, of normal real and imaginary parts.
    fn amplitude(&self, partial: u32, index: u64) -> [f64; 2] {
        let radius = (-2.0 * libm::log(1.0 - self.random.uniform(partial, index, 0))).sqrt();
        let angle = TAU * self.random.uniform(partial, index, 1);
        [radius * libm::cos(angle), radius * libm::sin(angle)]
    }

    /// Sum of the partials after some periods, with a mean square of 1.
    fn line(&mut self, periods: f64, frequency: f64) -> f64 {
        let (rate, coherence) = (self.params.rate.as_f64(), self.params.coherence);
        let (mut sum, mut power) = (0.0, 0.0);
        for h in 1..=self.params.harmonics {
            let share = f64::from(h) * frequency / rate;
            power += 1.0 / f64::from(h * h);
            if share >= FADE[1] {
                continue;
            }
            let fade = ((FADE[1] - share) / (FADE[1] - FADE[0])).min(1.0);
            let cycles = f64::from(h) * periods;
            let at = cycles / coherence;
            let (index, fraction) = (at.floor() as u64, at - at.floor());
            // Of independent numbers, cosine and sine have a constant power.
            let (b, a) = (libm::sin(0.5 * PI * fraction), libm::cos(0.5 * PI * fraction));
            let partial = (h - 1) as usize;
            if self.partials[partial].0 != index {
                self.partials[partial] = (index, [0, 1].map(|k| self.amplitude(h, index + k)));
            }
            let [first, second] = self.partials[partial].1;
            let [re, im] = [0, 1].map(|k| a * first[k] + b * second[k]);
            let turn = TAU * (cycles - cycles.floor());
            sum += fade / f64::from(h) * (re * libm::cos(turn) - im * libm::sin(turn));
        }
        sum / power.sqrt()
    }

    /// The sound and the tachometer at a sample, whose broadband noise is `white`.
    fn sample(&mut self, index: i64, white: f32) -> [f32; 2] {
        let t = index as f64 / self.params.rate.as_f64();
        if index < 0 || t >= self.params.duration {
            return [0.0; 2];
        }
        let speed = self.speed(t);
        let frequency = self.params.frequency * libm::pow(speed, self.params.exponent);
        let line = self.line(self.periods(t), frequency);
        let p = &self.params;
        let mixed = (1.0 - p.noise).sqrt() * line + p.noise.sqrt() * f64::from(white);
        let share = speed / p.fastest;
        [(p.level * share * mixed) as f32, share as f32]
    }
}

/// The node over [`RollerSound`].
#[derive(Debug)]
pub struct SyntheticRoller {
    sound: RollerSound,
}

impl Node for SyntheticRoller {
    type Params = SyntheticRollerParams;
    type Ports = SyntheticRollerPorts;
    const NAME: &'static str = "SyntheticRoller";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 400.0;

    fn shape(p: &SyntheticRollerParams, s: &mut Shape<'_, '_, SyntheticRollerPorts>) -> Result<(), Reject> {
        if p.fastest <= p.slowest {
            let message = format!("{} m/s is not above `slowest`, {} m/s", p.fastest, p.slowest);
            return Err(Reject::new("F051", message).at("fastest"));
        }
        s.ends(Some(ticks(p.duration)));
        s.output(SyntheticRollerPorts::audio, p.rate, Channels(1));
        s.output(SyntheticRollerPorts::turning, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &SyntheticRollerParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { sound: RollerSound::new(p.clone(), cx.random) })
    }

    fn run(&mut self, mut io: SyntheticRollerIo<'_>) -> Result<(), Fault> {
        let first = io.audio.first();
        self.sound.fill(first, io.audio.items(), io.turning.items());
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (SyntheticRollerParams, MemoryFiles) {
        let params = SyntheticRollerParams::trial(rng);
        let slowest = rng.between(0.01, 1.0);
        let (fastest, duration) = (slowest * rng.between(1.1, 30.0), rng.between(0.001, 0.3));
        let harmonics = 1 + rng.below(5) as u32;
        (SyntheticRollerParams { slowest, fastest, duration, harmonics, ..params }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
