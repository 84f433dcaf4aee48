//! The node `DistanceGain`.

use super::distance::{Distance, DistanceLine, SPEED_OF_SOUND};
use crate::contact::vector::{norm, sub};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Retune};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Shape};
use crate::core::time::ticks;
use crate::spatial::motion::interpolation::{LOOK_AHEAD, LOOK_BEHIND, pose_at};
use crate::spatial::motion::item::Poses;
use crate::{archive_state, params, ports};

params! {
    /// Attenuates a source by distance: its gain is `reference / distance`.
    ///
    /// The positions of source and listener are those of the parameters, or those of streams linked to `position` and `listener`; only
    /// the distance between them matters. The distance is read every 64 samples; the gain changes linearly in between.
    ///
    /// With `delay` the sound also arrives later by its travel time at 343 m/s, at least one sample, and a moving source has a Doppler
    /// shift. Delay is off by default, since it shifts distant sounds against the picture. Beyond `farthest` the delay is constant.
    ///
    /// With `air` the sound also loses high frequencies: at 8 kHz, 2 dB at 20 m and 10 dB at 100 m.
    ///
    /// # Source
    /// A point source in free air; ISO 9613-1 at 20 °C, 50 % relative humidity and sea level for the absorption by air; Laakso et al.,
    /// "Splitting the Unit Delay" (IEEE SPM 13(1), 1996) for fractional delays.
    pub struct DistanceGainParams {
        /// Position of the source, if not linked.
        position: [f64; 3] = [1.0, 0.0, 0.0], unit "m", range -100_000.0..=100_000.0;
        /// Position of the listener, if not linked.
        listener: [f64; 3] = [0.0; 3], unit "m", range -100_000.0..=100_000.0;
        /// Distance at which the gain is 1.
        reference: f64 = 1.0, unit "m", range 0.001..=10_000.0;
        /// Distance below which the gain is constant.
        nearest: f64 = 0.1, unit "m", range 0.001..=10_000.0;
        /// Delays the sound by its travel time.
        delay: bool = false;
        /// Distance up to which the delay grows.
        farthest: f64 = 100.0, unit "m", range 1.0..=10_000.0;
        /// Models the absorption of high frequencies by air.
        air: bool = false;
    }
}
ports! {
    /// Ports of `DistanceGain`.
    pub struct DistanceGainPorts / DistanceGainIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
            /// Poses of the source; replace the parameter.
            position: Option<Stream<Poses>>,
            /// Poses of the listener; replace the parameter.
            listener: Option<Stream<Poses>>,
        }
        out {
            /// The audio at the listener.
            out: Stream<f32>,
        }
    }
}

/// The node `DistanceGain`.
#[derive(Debug)]
pub struct DistanceGain {
    line: DistanceLine,
    params: DistanceGainParams,
}

/// Decay time of the air filter, in s.
const AIR_TAIL: f64 = 0.005;

fn law(p: &DistanceGainParams) -> Distance {
    Distance { reference: p.reference, nearest: p.nearest }
}

impl Node for DistanceGain {
    type Params = DistanceGainParams;
    type Ports = DistanceGainPorts;
    const NAME: &'static str = "DistanceGain";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 7.0;

    fn shape(p: &DistanceGainParams, s: &mut Shape<'_, '_, DistanceGainPorts>) -> Result<(), Reject> {
        type Port = DistanceGainPorts;
        let audio = s.input(Port::audio);
        s.when_ended(Port::audio, Ends::Stop);
        s.lookaround(Port::position, LOOK_BEHIND, LOOK_AHEAD);
        s.when_ended(Port::position, Ends::Hold);
        s.lookaround(Port::listener, LOOK_BEHIND, LOOK_AHEAD);
        s.when_ended(Port::listener, Ends::Hold);
        if p.delay {
            s.tail(ticks(p.farthest / SPEED_OF_SOUND) + audio.rate.span(3));
        } else if p.air {
            s.tail(ticks(AIR_TAIL));
        }
        s.output(Port::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &DistanceGainParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(DistanceGainPorts::audio);
        let farthest = p.delay.then_some(p.farthest);
        let line = DistanceLine::new(law(p), farthest, p.air, audio.format.0.into(), audio.rate.as_f64());
        Ok(Self { line, params: p.clone() })
    }

    fn run(&mut self, mut io: DistanceGainIo<'_>) -> Result<(), Fault> {
        let (first, rate) = (io.out.first().max(0) as u64, io.out.rate());
        let DistanceGainParams { position, listener, .. } = self.params;
        self.line.process(first, io.audio.items(), io.out.items(), |n| {
            let tick = rate.tick(n as i64);
            let position_of = |link: &Option<_>, fixed| {
                link.as_ref().map_or(fixed, |poses| pose_at(poses, tick).position.map(f64::from))
            };
            norm(sub(position_of(&io.position, position), position_of(&io.listener, listener)))
        });
        Ok(())
    }

    fn retune(&mut self, new: &DistanceGainParams) -> Retune {
        let rebuilt = |p: &DistanceGainParams| (p.delay, p.farthest, p.air);
        if rebuilt(new) != rebuilt(&self.params) {
            return Retune::Rebuild;
        }
        self.line.set_distance(law(new));
        self.params = new.clone();
        Retune::Done
    }

    archive_state!(line);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::spatial::Pose;

    fn params() -> DistanceGainParams {
        DistanceGainParams::read(&|_| None).unwrap()
    }

    fn standalone(p: DistanceGainParams, audio: Vec<f32>) -> Standalone {
        Standalone::new::<DistanceGain>(p).input(
            DistanceGainPorts::audio,
            Rate::hz(48_000),
            Channels(2),
            audio,
        )
    }

    #[test]
    fn the_gain_at_four_metres_is_a_quarter_and_a_moving_source_makes_no_steps() {
        let p = DistanceGainParams { position: [0.0, 4.0, 0.0], ..params() };
        let out = standalone(p, vec![1.0; 200]).run().unwrap().stream(DistanceGainPorts::out);
        assert_eq!(out, vec![0.25; 200]);
        let walk = (0..60).map(|k| Pose::at([1.0 + k as f32 * 0.05, 0.0, 0.0])).collect();
        let standalone = standalone(params(), vec![1.0; 96_000]).optional(
            DistanceGainPorts::position,
            Rate::hz(60),
            (),
            walk,
        );
        let out = standalone.run().unwrap().stream(DistanceGainPorts::out);
        assert!(out.windows(3).all(|w| (w[2] - w[0]).abs() < 1e-4), "steps");
        assert!((out[48_000] - 1.0 / 2.5).abs() < 0.001 && out.len() == 96_000);
    }

    #[test]
    fn air_attenuates_high_frequencies_only() {
        let p = DistanceGainParams { position: [50.0, 0.0, 0.0], reference: 50.0, ..params() };
        let tone = |f: f64| -> Vec<f32> {
            let x = (0..9600).map(|n| (std::f64::consts::TAU * f * f64::from(n) / 48_000.0).sin() as f32);
            x.flat_map(|x| [x, x]).collect()
        };
        let level = |air: bool, f: f64| {
            let out = standalone(DistanceGainParams { air, ..p.clone() }, tone(f)).run().unwrap();
            let out = out.stream(DistanceGainPorts::out);
            10.0 * (out[4800..19_200].iter().map(|y| f64::from(y * y)).sum::<f64>() / 14_400.0).log10()
        };
        let loss = |f: f64| level(false, f) - level(true, f);
        assert!(loss(250.0) < 0.1, "{}", loss(250.0));
        let expected = 50.0 * crate::spatial::propagation::air::loss(8000.0);
        assert!((loss(8000.0) - expected).abs() < 0.05, "{} dB, expected {expected}", loss(8000.0));
    }

    #[test]
    fn with_delay_the_sound_arrives_after_its_travel_time_and_is_not_cut_off() {
        let p = DistanceGainParams { position: [34.3, 0.0, 0.0], delay: true, ..params() };
        let mut audio = vec![0.0; 200];
        (audio[198], audio[199]) = (1.0, -1.0);
        let out = standalone(p, audio).run().unwrap().stream(DistanceGainPorts::out);
        let at = 2 * (99 + 4800);
        assert!((out[at] * 34.3 - 1.0).abs() < 1e-3 && (out[at + 1] * 34.3 + 1.0).abs() < 1e-3);
        assert!(out[..at - 4].iter().all(|x| *x == 0.0));
    }
}
