//! Musical tempo as a rate of modulation: a node that computes a value before streams start.

use foley::nodes::prelude::node::*;

/// Cycles per second of a tempo in beats per minute.
pub fn beat_rate(tempo: f64, cycles_per_beat: f64) -> f64 {
    tempo / 60.0 * cycles_per_beat
}

params! {
    /// Converts a tempo to a rate of modulation.
    pub struct BeatRateParams {
        /// Tempo in beats per minute.
        tempo: f64 = 120.0, unit "1/min", range 1.0..=1000.0;
        /// Cycles per beat.
        cycles: f64 = 2.0, unit "", range 0.01..=100.0;
    }
}

ports! {
    pub struct BeatRatePorts / BeatRateIo {
        in {}
        out {
            /// The rate, Hz.
            rate: Value<f64>,
        }
    }
}

/// The node `BeatRate`.
pub struct BeatRate;

impl Func for BeatRate {
    type Params = BeatRateParams;
    type Ports = BeatRatePorts;
    const NAME: &'static str = "BeatRate";

    fn eval(p: &BeatRateParams, _: &Build<'_>, mut io: BeatRateIo<'_>) -> Result<Summary, Fault> {
        io.rate.set(beat_rate(p.tempo, p.cycles));
        Ok(Summary::new())
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn two_cycles_per_beat_at_120_beats_per_minute_are_4_hz() {
        assert_eq!(super::beat_rate(120.0, 2.0), 4.0);
    }
}
