//! The node `Biquad`.

use super::node::{FilterIo, FilterPorts};
use super::section::{Biquad, Section};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, choices, params};
use std::f64::consts::FRAC_1_SQRT_2;

choices! {
    /// Response of a [`BiquadNode`].
    pub enum BiquadKind {
        /// Low-pass, 12 dB per octave.
        LowPass,
        /// High-pass, 12 dB per octave.
        HighPass,
        /// Band-pass with gain 1 at its centre.
        BandPass,
        /// Notch: removes the centre frequency.
        Notch,
        /// Raises or lowers the centre frequency by `gain_db`.
        Peak,
        /// Raises or lowers all frequencies below `frequency` by `gain_db`.
        LowShelf,
        /// Raises or lowers all frequencies above `frequency` by `gain_db`.
        HighShelf,
    }
}
params! {
    /// Filters audio by one second-order section, for equaliser bands, resonances and notches.
    ///
    /// # Source
    /// R. Bristow-Johnson, "Cookbook formulae for audio EQ biquad filter coefficients".
    pub struct BiquadParams {
        /// Response.
        kind: BiquadKind = BiquadKind::Peak;
        /// Centre or corner frequency; below half the sample rate.
        frequency: f64 = 1000.0, unit "Hz", range 0.01..=300_000.0;
        /// Quality factor: the higher, the narrower; 0.7071 is maximally flat.
        q: f64 = FRAC_1_SQRT_2, unit "", range 0.05..=100.0;
        /// Gain of a peak or a shelf; other responses ignore it.
        gain_db: f64 = 0.0, unit "dB", range -60.0..=60.0;
    }
}

/// The node `Biquad`.
#[derive(Debug)]
pub struct BiquadNode {
    filter: Biquad,
    rate: f64,
}

fn design(p: &BiquadParams, rate: f64) -> Result<Section, Reject> {
    let BiquadParams { kind, frequency, q, gain_db } = *p;
    let section = match kind {
        BiquadKind::LowPass => Section::low_pass(frequency, q, rate),
        BiquadKind::HighPass => Section::high_pass(frequency, q, rate),
        BiquadKind::BandPass => Section::band_pass(frequency, q, rate),
        BiquadKind::Notch => Section::notch(frequency, q, rate),
        BiquadKind::Peak => Section::peak(frequency, q, gain_db, rate),
        BiquadKind::LowShelf => Section::low_shelf(frequency, q, gain_db, rate),
        BiquadKind::HighShelf => Section::high_shelf(frequency, q, gain_db, rate),
    };
    Ok(section?)
}

impl Node for BiquadNode {
    type Params = BiquadParams;
    type Ports = FilterPorts;
    const NAME: &'static str = "Biquad";
    const CLASS: Class = Class::Audio;
    const TAKES_BLOCKS: bool = true;
    const COST: f64 = 6.0;

    fn shape(p: &BiquadParams, s: &mut Shape<'_, '_, FilterPorts>) -> Result<(), Reject> {
        let audio = s.input(FilterPorts::audio);
        design(p, audio.rate.as_f64())?;
        s.output(FilterPorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &BiquadParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(FilterPorts::audio);
        let rate = audio.rate.as_f64();
        Ok(Self { filter: Biquad::new(design(p, rate)?, audio.format.0.into()), rate })
    }

    fn run(&mut self, mut io: FilterIo<'_>) -> Result<(), Fault> {
        self.process_block(io.audio.items(), io.out.items());
        Ok(())
    }

    fn process_block(&mut self, input: &[f32], out: &mut [f32]) {
        out.copy_from_slice(input);
        self.filter.process(out);
    }

    fn retune(&mut self, new: &BiquadParams) -> Retune {
        match design(new, self.rate) {
            Ok(section) => {
                self.filter.set_section(section);
                Retune::Done
            }
            Err(_) => Retune::Rebuild,
        }
    }

    fn adopt(&mut self, old: &mut Self) {
        self.filter.take_state(&mut old.filter);
    }

    archive_state!(filter);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    #[test]
    fn a_low_shelf_raises_a_constant_by_its_gain() {
        let params = BiquadParams { kind: BiquadKind::LowShelf, frequency: 50.0, q: 0.7, gain_db: 20.0 };
        let standalone = Standalone::new::<BiquadNode>(params);
        let run =
            standalone.input(FilterPorts::audio, Rate::hz(1000), Channels(1), vec![0.1; 2000]).run().unwrap();
        assert!((run.stream(FilterPorts::out)[1999] - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_frequency_above_half_the_rate_is_refused() {
        let params = BiquadParams { kind: BiquadKind::Notch, frequency: 600.0, q: 1.0, gain_db: 0.0 };
        let standalone = Standalone::new::<BiquadNode>(params);
        let standalone = standalone.input(FilterPorts::audio, Rate::hz(1000), Channels(1), vec![0.0]);
        assert_eq!(standalone.shape().unwrap_err().field.as_deref(), Some("frequency"));
    }
}
