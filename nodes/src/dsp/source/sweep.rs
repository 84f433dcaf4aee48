//! Sine sweeps whose phase is computed from the sample index, and the node `Sweep`.

use std::f64::consts::TAU;

use super::oscillator::fill;
use super::output::{SourceIo, SourceOutput, SourcePorts};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, ticks};
use crate::dsp::DspError;
use crate::{choices, params};
/// The change of frequency over time in a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SweepLaw {
    /// Constant change in hertz per second.
    Linear,
    /// Constant change in octaves per second.
    Exponential,
}

/// A sine whose frequency changes from one value to another; silent before and after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    law: SweepLaw,
    from: f64,
    to: f64,
    frames: u64,
}

impl Sweep {
    /// Creates a sweep over `frames` samples.
    ///
    /// # Errors
    /// Frequencies outside (0, rate / 2), and 0 frames.
    pub fn new(law: SweepLaw, from: f64, to: f64, frames: u64, rate: f64) -> Result<Self, DspError> {
        DspError::check_frequency(from, rate)?;
        DspError::check_frequency(to, rate)?;
        DspError::check(frames > 0, "frames", frames as f64, "at least 1")?;
        Ok(Self { law, from: from / rate, to: to / rate, frames })
    }

    /// Returns the periods since the start: the integral of the frequency.
    fn periods(&self, n: f64) -> f64 {
        let length = self.frames as f64;
        let octaves = (self.to / self.from).ln();
        if self.law == SweepLaw::Linear || octaves.abs() < 1e-9 {
            self.from * n + (self.to - self.from) * n * (n / (2.0 * length))
        } else {
            self.from * length / octaves * libm::expm1(octaves * n / length)
        }
    }

    /// Writes samples `first..`.
    pub fn fill(&self, first: i64, out: &mut [f32]) {
        fill(first, out, |n| {
            if n < 0 || n as u64 >= self.frames {
                return 0.0;
            }
            let periods = self.periods(n as f64);
            libm::sin(TAU * (periods - periods.floor()))
        });
    }
}
choices!(@param SweepLaw {
    /// Constant change in hertz per second.
    Linear,
    /// Constant change in octaves per second.
    Exponential,
});
params! {
    /// Generates a sine whose frequency changes from one value to another.
    pub struct SweepParams {
        /// Change of the frequency over time.
        law: SweepLaw = SweepLaw::Exponential;
        /// Frequency at the start; below half the rate.
        from: f64 = 20.0, unit "Hz", range 0.001..=300_000.0;
        /// Frequency at the end; below half the rate.
        to: f64 = 20_000.0, unit "Hz", range 0.001..=300_000.0;
        /// Peak, of full scale.
        level: f32 = 0.5, unit "", range 0.0..=100.0_f32;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
        /// Channels, all with the same sweep.
        channels: u16 = 1, unit "channels", range 1..=64_u16;
        /// Length.
        duration: f64 = 1.0, unit "s", range 0.001..=3600.0;
    }
}

/// The node `Sweep`.
#[derive(Debug)]
pub struct SweepNode {
    output: SourceOutput,
    sweep: Sweep,
}

fn sweep(p: &SweepParams) -> Result<Sweep, Reject> {
    let (rate, frames) = (p.rate.as_f64(), p.rate.first_at(ticks(p.duration)) as u64);
    // `Sweep::new` reports both as `frequency`.
    Sweep::new(p.law, p.from, p.from, frames, rate).map_err(|e| Reject::from(e).at("from"))?;
    Sweep::new(p.law, p.from, p.to, frames, rate).map_err(|e| Reject::from(e).at("to"))
}

impl Node for SweepNode {
    type Params = SweepParams;
    type Ports = SourcePorts;
    const NAME: &'static str = "Sweep";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 30.0;

    fn shape(p: &SweepParams, s: &mut Shape<'_, '_, SourcePorts>) -> Result<(), Reject> {
        sweep(p)?;
        s.ends(Some(ticks(p.duration)));
        s.output(SourcePorts::audio, p.rate, Channels(p.channels));
        Ok(())
    }

    fn build(p: &SweepParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { output: SourceOutput::new(p.level.into(), cx), sweep: sweep(p)? })
    }

    fn run(&mut self, mut io: SourceIo<'_>) -> Result<(), Fault> {
        self.output.run(&mut io.audio, |channel, first, block| {
            if channel == 0 {
                self.sweep.fill(first, block);
            }
        });
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (SweepParams, MemoryFiles) {
        let params = SweepParams::trial(rng);
        let rate = params.rate.as_f64();
        let (from, to) = (rate * rng.between(0.001, 0.499), rate * rng.between(0.001, 0.499));
        let (duration, channels) = (rng.between(0.001, 0.5), 1 + rng.below(3) as u16);
        (SweepParams { from, to, duration, channels, ..params }, MemoryFiles::default())
    }
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::dsp::testing::assert_block_invariant;
    #[test]
    fn sweeps_reach_their_frequencies_at_the_expected_times() {
        let rate = 48_000.0;
        for (law, middle) in [(SweepLaw::Linear, 550.0), (SweepLaw::Exponential, (100.0_f64 * 1000.0).sqrt())]
        {
            let sweep = Sweep::new(law, 100.0, 1000.0, 48_000, rate).unwrap();
            let frequency = |n: f64| (sweep.periods(n + 1.0) - sweep.periods(n - 1.0)) / 2.0 * rate;
            for (n, expected) in [(0.0, 100.0), (24_000.0, middle), (48_000.0, 1000.0)] {
                assert!((frequency(n) / expected - 1.0).abs() < 1e-4, "{law:?} {n} {}", frequency(n));
            }
            let mut x = [1.0; 4];
            sweep.fill(47_998, &mut x);
            assert!(x[0] != 0.0 && x[2..] == [0.0, 0.0]);
        }
    }
    #[test]
    fn blocks_do_not_change_a_bit() {
        let sweep = Sweep::new(SweepLaw::Exponential, 20.0, 20_000.0, 2900, 44_100.0).unwrap();
        assert_block_invariant(&[0.0; 3000], 1, || sweep, |g, at, x| g.fill(at, x));
    }

    #[test]
    fn a_sweep_above_half_the_rate_is_refused() {
        let params = SweepParams { to: 24_000.0, ..SweepParams::read(&|_| None).unwrap() };
        assert_eq!(Standalone::new::<SweepNode>(params).shape().unwrap_err().field.as_deref(), Some("to"));
    }
    #[test]
    fn a_sweep_lasts_for_its_duration() {
        let params = SweepParams { duration: 0.25, ..SweepParams::read(&|_| None).unwrap() };
        let audio = Standalone::new::<SweepNode>(params).run().unwrap().stream(SourcePorts::audio);
        assert_eq!(audio.len(), 12_000);
        assert!(audio[11_990..].iter().any(|x| x.abs() > 0.1));
    }
}
