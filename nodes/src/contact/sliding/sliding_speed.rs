//! The node `SlidingSpeed`.

use super::gate::GateMode;
use super::sampler::{Between, SamplerParams, SpeedSampler, Stamp};
use super::speed_map::SpeedMap;
use super::stale_frames::StaleParams;
use crate::contact::item::{Contacts, Speeds};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary, same_channels, same_rate};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{archive_state, choices, params, ports};

choices! {
    /// Gate that silences vertices that hardly move.
    pub enum SpeedGate {
        /// A run of contact passes if its own speed exceeds the threshold, with a look-ahead of `max_hold`.
        Interval,
        /// A vertex passes if its speed exceeds the threshold in any frame: the paper's rule. It reads the whole animation first, so
        /// it holds all contacts in memory and does not run live.
        Ever,
        /// Opens at the first speed above the threshold, and closes after `hold` without contact or below half of it.
        Causal,
    }
}

choices! { @param Between {
    /// The shape-preserving cubic of Fritsch and Butland (PCHIP), which needs two frames ahead.
    Pchip,
    /// A straight line, which needs one frame ahead.
    Linear,
    /// The speed of the two frames around a time, independent of `stamp`. It needs no frame ahead: for live use.
    Hold,
} }

choices! { @param Stamp {
    /// Half-way between the two frames of a difference, where the difference is exact to second order.
    Midpoint,
    /// At the first of the two frames, half a frame early.
    Start,
} }

params! {
    /// Computes the speed at which each vertex of a cloth slides along the surfaces that it touches.
    ///
    /// Slides from frame to frame become speeds (of several contacts of a vertex the fastest), the gate silences vertices that
    /// hardly move, and speeds are interpolated to the output rate without overshoot below 0 and mapped to (factor s)^power. Before
    /// the first and after the last sample the speed is 0. The comparison with the threshold is strict: a threshold of 0 still
    /// silences vertices that never move.
    ///
    /// A mesh that arrives while the graph plays comes with the `age` of its frame. While the frame stays the same,
    /// vertices hold their last speed for `late_hold` and then slow down to 0 in `late_ramp`. A slide over a gap is
    /// divided by the time between the two frames, so that a late frame causes no jump of speed.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2; Fritsch
    /// and Butland (1984) for the interpolation, which the paper leaves open.
    pub struct SlidingSpeedParams {
        /// Threshold of the gate.
        threshold: f32 = 0.02, unit "m/s", range 0.0..=100.0;
        /// Gate that silences vertices that hardly move.
        gate: SpeedGate = SpeedGate::Interval;
        /// Look-ahead of the gate `Interval`.
        max_hold: f64 = 0.5, unit "s", range 0.0..=10.0;
        /// Time for which the gate `Causal` stays open.
        hold: f64 = 0.25, unit "s", range 0.0..=10.0;
        /// Speeds per second. `IftNoise` needs a whole number of samples from one to the next: 40 with 48000 Hz,
        /// "44100/1103" with 44100 Hz.
        rate: Rate = Rate::hz(40);
        /// Interpolation of speeds between frames.
        between: Between = Between::Pchip;
        /// Time stamp of a difference of two frames.
        stamp: Stamp = Stamp::Midpoint;
        /// Factor on the speed, which scales an animation to the measured range of speeds.
        factor: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Exponent of the speed.
        power: f32 = 1.0, unit "", range 0.1..=10.0;
        /// Time for which a vertex holds its last speed while no new frame arrives, if `age` is linked.
        late_hold: f64 = 0.1, unit "s", range 0.0..=60.0;
        /// Time of the ramp from there to 0.
        late_ramp: f64 = 0.1, unit "s", range 0.0..=60.0;
    }
}

ports! {
    pub struct SlidingSpeedPorts / SlidingSpeedIo {
        in {
            /// Contacts of a cloth.
            contacts: Stream<Contacts>,
            /// Age of the frame of the mesh of these contacts, s, at their rate, from `LiveMesh`.
            age: Option<Stream<f32>>,
        }
        out {
            /// Sliding speed per vertex.
            speeds: Stream<Speeds>,
        }
    }
}

/// The node `SlidingSpeed`.
pub struct SlidingSpeed {
    sampler: SpeedSampler,
    /// True after the first window.
    started: bool,
    look_ahead: i64,
    /// True while the first pass of the gate `Ever` is still to be done.
    needs_first_pass: bool,
    map: SpeedMap,
    params: SlidingSpeedParams,
}

fn sampler_params(p: &SlidingSpeedParams, frames: Rate, has_ages: bool) -> SamplerParams {
    let gate = match p.gate {
        SpeedGate::Interval => GateMode::Interval { max_hold: p.max_hold },
        SpeedGate::Ever => GateMode::Ever,
        SpeedGate::Causal => GateMode::Causal { hold: p.hold },
    };
    let SlidingSpeedParams { rate, threshold, between, stamp, .. } = *p;
    let stale = has_ages.then_some(StaleParams { hold: p.late_hold, ramp: p.late_ramp });
    SamplerParams { frames, rate, threshold, gate, between, stamp, stale }
}

impl Node for SlidingSpeed {
    type Params = SlidingSpeedParams;
    type Ports = SlidingSpeedPorts;
    const NAME: &'static str = "SlidingSpeed";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 10.0;

    fn shape(p: &SlidingSpeedParams, s: &mut Shape<'_, '_, SlidingSpeedPorts>) -> Result<(), Reject> {
        let contacts = s.input(SlidingSpeedPorts::contacts);
        let age = s.optional(SlidingSpeedPorts::age);
        let mut look_ahead = sampler_params(p, contacts.rate, age.is_some()).look_ahead();
        if p.gate == SpeedGate::Ever {
            let Some(frames) = contacts.items() else {
                return Err(Reject::new(
                    "F075",
                    "the gate `Ever` needs the complete animation, and `contacts` does not end",
                )
                .at("gate")
                .help("use `gate: Interval`, or `gate: Causal` in a live graph"));
            };
            look_ahead += frames.max(0) as usize;
        }
        s.lookaround(SlidingSpeedPorts::contacts, 0, look_ahead);
        if let Some(age) = age {
            s.check(same_rate("age", age.rate, "`contacts`", contacts.rate));
            s.check(same_channels("age", age.format, "an age", Channels(1)));
            // A slide leads to the next frame, whose age is needed as well.
            s.lookaround(SlidingSpeedPorts::age, 0, look_ahead + 1);
        }
        s.output(SlidingSpeedPorts::speeds, p.rate, contacts.format.areas);
        Ok(())
    }

    fn build(p: &SlidingSpeedParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let contacts = cx.input(SlidingSpeedPorts::contacts);
        let (vertices, slots) = (contacts.format.areas.len(), contacts.format.slots);
        let has_ages = cx.optional(SlidingSpeedPorts::age).is_some();
        let params = sampler_params(p, contacts.rate, has_ages);
        Ok(Self {
            sampler: SpeedSampler::new(params, vertices, slots, contacts.items()),
            started: false,
            look_ahead: params.look_ahead() as i64,
            needs_first_pass: p.gate == SpeedGate::Ever,
            map: SpeedMap { factor: p.factor, power: p.power },
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: SlidingSpeedIo<'_>) -> Result<(), Fault> {
        let (contacts, first) = (&io.contacts, io.contacts.first());
        let ages = |frame: i64| {
            let age = io.age.as_ref()?;
            let k = (frame - age.first()) as isize;
            Some([age.item(k)[0], age.item(k + 1)[0]])
        };
        if self.needs_first_pass {
            self.needs_first_pass = false;
            let frames = contacts.around().chunks_exact(contacts.width().max(1));
            (first..)
                .zip(frames)
                .for_each(|(frame, contacts)| self.sampler.observe(frame, contacts, ages(frame)));
        }
        if !std::mem::replace(&mut self.started, true) {
            self.sampler.start_at(first);
        }
        let (item, vertices) = (io.speeds.first(), io.speeds.width().max(1));
        let mut items = (item..).zip(io.speeds.items().chunks_exact_mut(vertices)).peekable();
        loop {
            while let Some((item, out)) = items.peek_mut() {
                if !self.sampler.sample(*item, out) {
                    break;
                }
                out.iter_mut().for_each(|s| *s = self.map.map(*s).min(f32::MAX));
                items.next();
            }
            let frame = self.sampler.next_frame();
            if frame >= first + contacts.len() as i64 + self.look_ahead {
                break;
            }
            self.sampler.push(contacts.item((frame - first) as isize), ages(frame));
        }
        Ok(())
    }

    fn finish(&mut self, _: SlidingSpeedIo<'_>) -> Result<Summary, Fault> {
        let report = self.sampler.report();
        let gated_share = 1.0 - report.passed as f64 / report.moving.max(1) as f64;
        let mut summary: Summary = vec![
            ("fastest", self.map.map(report.fastest).into()),
            ("sliding", (report.sliding as f64 / report.items.max(1) as f64).into()),
            ("sliding_at_most", report.max_sliding.into()),
            ("gated_share", if report.moving == 0 { 0.0 } else { gated_share }.into()),
        ];
        let warning = match (report.moving, report.passed) {
            (0, _) => Some(
                "nothing slides, so the sound of these speeds is silent: `radius` of ContactDetector may be too small, or \
                 `metres_per_unit` of the mesh wrong"
                    .to_owned(),
            ),
            (_, 0) => Some(format!(
                "nothing slides faster than `threshold`, {} m/s, so the sound of these speeds is silent",
                self.params.threshold
            )),
            _ => None,
        };
        summary.extend(warning.map(|text| ("warning", text.into())));
        Ok(summary)
    }

    fn retune(&mut self, new: &SlidingSpeedParams) -> Retune {
        // Threshold and map can change; rates and look-ahead cannot.
        let SlidingSpeedParams { threshold, factor, power, .. } = *new;
        if (SlidingSpeedParams { threshold, factor, power, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        self.sampler.set_threshold(threshold);
        self.map = SpeedMap { factor, power };
        self.params = new.clone();
        Retune::Done
    }

    archive_state!(sampler, started, needs_first_pass);

    fn trial(rng: &mut Rng) -> (SlidingSpeedParams, MemoryFiles) {
        // Times short compared with the streams of a trial, and a threshold within their speeds.
        let params = SlidingSpeedParams {
            threshold: rng.between(0.0, 0.3) as f32,
            max_hold: [0.0, rng.between(0.0, 0.1)][rng.below(2)],
            ..SlidingSpeedParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
