//! Contacts to sliding speeds, and sliding speeds to others, as nodes.

use std::sync::Arc;

use super::gate::GateMode;
use super::late::LateParams;
use super::sliding::{Between, Sliding, SlidingParams, Stamp};
use super::speed::SpeedMap;
use super::{Contacts, Speeds};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Each, Node, Retune, Summary, same_channels, same_rate};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::{archive_state, choices, params, ports};

choices! {
    /// Which vertices are silent although they move a little.
    pub enum SpeedGate {
        /// A run of contact is heard if its own speed exceeds the threshold, looking `max_hold` ahead.
        Interval,
        /// A vertex is heard if its speed ever exceeds the threshold: the paper's rule. It reads the whole take first, so
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
    /// The speed of the two frames between which a moment lies, whatever `stamp` says. It needs no frame ahead: for live use.
    Hold,
} }

choices! { @param Stamp {
    /// Half-way between the two frames of a difference, where it is exact to second order.
    Midpoint,
    /// At the first of the two frames: half a frame early.
    Start,
} }

params! {
    /// How fast each vertex of a cloth slides along what it touches.
    ///
    /// Slides from frame to frame become speeds (of several contacts of a vertex the fastest counts), vertices that hardly
    /// move are silenced by the gate, speeds between frames are interpolated onto the output's own rate without ever
    /// swinging below 0, and mapped to (factor s)^power. Before the first and after the last sample nothing slides. The
    /// comparison with the threshold is strict: 0 still silences vertices that never move.
    ///
    /// A mesh that comes in while the graph plays tells the `age` of the frame that it shows. While the same frame stays, vertices go on
    /// at their last speed for `late_hold`, then slow down to 0 in `late_ramp`; a frame after a gap is divided by the time that has
    /// really passed, so that catching up is no jump.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 2; Fritsch
    /// and Butland (1984) for the interpolation, which the paper leaves open.
    pub struct SlidingSpeedParams {
        /// Speed that a vertex has to exceed to be heard.
        threshold: f32 = 0.02, unit "m/s", range 0.0..=100.0;
        /// Which vertices are silenced.
        gate: SpeedGate = SpeedGate::Interval;
        /// How far the gate `Interval` looks ahead.
        max_hold: f64 = 0.5, unit "s", range 0.0..=10.0;
        /// How long the gate `Causal` stays open.
        hold: f64 = 0.25, unit "s", range 0.0..=10.0;
        /// Speeds per second. `IftNoise` needs a whole number of samples from one to the next: 40 with 48000 Hz,
        /// "44100/1103" with 44100 Hz.
        rate: Rate = Rate::hz(40);
        /// How speeds between frames are found.
        between: Between = Between::Pchip;
        /// When a difference of two frames holds.
        stamp: Stamp = Stamp::Midpoint;
        /// Factor on the speed, which brings an animation into the range of speeds that was measured.
        factor: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Exponent of the speed.
        power: f32 = 1.0, unit "", range 0.1..=10.0;
        /// How long a vertex goes on at its last speed while no frame comes, where `age` is linked.
        late_hold: f64 = 0.1, unit "s", range 0.0..=60.0;
        /// How long it then takes to 0.
        late_ramp: f64 = 0.1, unit "s", range 0.0..=60.0;
    }
}

ports! {
    pub struct SlidingSpeedPorts / SlidingSpeedIo {
        in {
            /// Contacts of a cloth.
            contacts: Stream<Contacts>,
            /// Age of the frame that the mesh of these contacts shows, s, at their rate: `LiveMesh` gives it.
            age: Option<Stream<f32>>,
        }
        out {
            /// Sliding speed per vertex.
            speeds: Stream<Speeds>,
        }
    }
}

/// The node over [`Sliding`].
pub struct SlidingSpeed {
    sliding: Sliding,
    /// Whether the first window has come.
    begun: bool,
    ahead: i64,
    /// Frames to observe before the first window, for the gate that needs the whole take.
    unseen: bool,
    map: SpeedMap,
    params: SlidingSpeedParams,
}

fn sliding_params(p: &SlidingSpeedParams, frames: Rate, aged: bool) -> SlidingParams {
    let gate = match p.gate {
        SpeedGate::Interval => GateMode::Interval { max_hold: p.max_hold },
        SpeedGate::Ever => GateMode::Ever,
        SpeedGate::Causal => GateMode::Causal { hold: p.hold },
    };
    let SlidingSpeedParams { rate, threshold, between, stamp, .. } = *p;
    let late = aged.then_some(LateParams { hold: p.late_hold, ramp: p.late_ramp });
    SlidingParams { frames, rate, threshold, gate, between, stamp, late }
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
        let mut ahead = sliding_params(p, contacts.rate, age.is_some()).ahead();
        if p.gate == SpeedGate::Ever {
            let Some(frames) = contacts.items() else {
                return Err(Reject::new(
                    "F075",
                    "the gate `Ever` needs the whole take, and `contacts` does not end",
                )
                .at("gate")
                .help("use `gate: Interval`, or `gate: Causal` in a live graph"));
            };
            ahead += frames.max(0) as usize;
        }
        s.lookaround(SlidingSpeedPorts::contacts, 0, ahead);
        if let Some(age) = age {
            s.check(same_rate("age", age.rate, "`contacts`", contacts.rate));
            s.check(same_channels("age", age.format, "an age", Channels(1)));
            // The slide of a frame is the way to the next, which the contacts have looked at already.
            s.lookaround(SlidingSpeedPorts::age, 0, ahead + 1);
        }
        s.output(SlidingSpeedPorts::speeds, p.rate, contacts.format.areas);
        Ok(())
    }

    fn build(p: &SlidingSpeedParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let contacts = cx.input(SlidingSpeedPorts::contacts);
        let (vertices, slots) = (contacts.format.areas.len(), contacts.format.slots);
        let aged = cx.optional(SlidingSpeedPorts::age).is_some();
        let params = sliding_params(p, contacts.rate, aged);
        Ok(Self {
            sliding: Sliding::new(params, vertices, slots, contacts.items()),
            begun: false,
            ahead: params.ahead() as i64,
            unseen: p.gate == SpeedGate::Ever,
            map: SpeedMap { factor: p.factor, power: p.power },
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: SlidingSpeedIo<'_>) -> Result<(), Fault> {
        let (contacts, first) = (&io.contacts, io.contacts.first());
        let ages = |frame: i64| {
            let age = io.age.as_ref()?;
            let at = (frame - age.first()) as isize;
            Some([age.item(at)[0], age.item(at + 1)[0]])
        };
        if self.unseen {
            self.unseen = false;
            let frames = contacts.around().chunks_exact(contacts.width().max(1));
            (first..)
                .zip(frames)
                .for_each(|(frame, contacts)| self.sliding.observe(frame, contacts, ages(frame)));
        }
        if !std::mem::replace(&mut self.begun, true) {
            self.sliding.begin_at(first);
        }
        let (item, vertices) = (io.speeds.first(), io.speeds.width().max(1));
        let mut items = (item..).zip(io.speeds.items().chunks_exact_mut(vertices)).peekable();
        loop {
            while let Some((item, out)) = items.peek_mut() {
                if !self.sliding.give(*item, out) {
                    break;
                }
                out.iter_mut().for_each(|s| *s = self.map.map(*s).min(f32::MAX));
                items.next();
            }
            let frame = self.sliding.next_frame();
            if frame >= first + contacts.len() as i64 + self.ahead {
                break;
            }
            self.sliding.take(contacts.item((frame - first) as isize), ages(frame));
        }
        Ok(())
    }

    fn finish(&mut self, _: SlidingSpeedIo<'_>) -> Result<Summary, Fault> {
        let report = self.sliding.report();
        let share = 1.0 - report.heard as f64 / report.moving.max(1) as f64;
        let mut told: Summary = vec![
            ("fastest", self.map.map(report.fastest).into()),
            ("sliding", (report.sliding as f64 / report.items.max(1) as f64).into()),
            ("sliding_at_most", report.most.into()),
            ("gated_share", if report.moving == 0 { 0.0 } else { share }.into()),
        ];
        let silent = match (report.moving, report.heard) {
            (0, _) => Some(
                "nothing ever slides, and what is made of these speeds is silent: is `radius` of ContactDetector too small, or \
                 `metres_per_unit` of the mesh not right?"
                    .to_owned(),
            ),
            (_, 0) => Some(format!(
                "nothing slides faster than `threshold` {} m/s, and what is made of these speeds is silent",
                self.params.threshold
            )),
            _ => None,
        };
        told.extend(silent.map(|text| ("warning", text.into())));
        Ok(told)
    }

    fn retune(&mut self, new: &SlidingSpeedParams) -> Retune {
        // What is gated, interpolated and mapped from here on can change; the grids and the look-ahead cannot.
        let SlidingSpeedParams { threshold, factor, power, .. } = *new;
        if (SlidingSpeedParams { threshold, factor, power, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        self.sliding.set_threshold(threshold);
        self.map = SpeedMap { factor, power };
        self.params = new.clone();
        Retune::Done
    }

    archive_state!(sliding, begun, unseen);

    fn trial(rng: &mut Rng) -> (SlidingSpeedParams, MemoryFiles) {
        // Holds short beside the streams of a trial, and a threshold among their speeds.
        let params = SlidingSpeedParams {
            threshold: rng.between(0.0, 0.3) as f32,
            max_hold: [0.0, rng.between(0.0, 0.1)][rng.below(2)],
            ..SlidingSpeedParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

params! {
    /// Maps sliding speeds to the speeds at which a friction model is asked: (factor s)^power.
    ///
    /// The preset for windbreaker is factor 0.25, power 1.5.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 5.
    pub struct SpeedMapParams {
        /// Factor on the speed.
        factor: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Exponent of the speed.
        power: f32 = 1.0, unit "", range 0.1..=10.0;
    }
}

/// The node over [`SpeedMap`].
pub struct SpeedMapNode(SpeedMap);

impl Each for SpeedMapNode {
    type Params = SpeedMapParams;
    type In = Speeds;
    type Out = Speeds;
    const NAME: &'static str = "SpeedMap";
    const INPUT: (&'static str, &'static str) = ("speeds", "Sliding speed per vertex.");
    const OUTPUT: (&'static str, &'static str) = ("mapped", "Mapped speed per vertex.");

    fn format(_: &SpeedMapParams, areas: &Arc<[f32]>) -> Result<Arc<[f32]>, Reject> {
        Ok(Arc::clone(areas))
    }

    fn new(p: &SpeedMapParams, _: &Arc<[f32]>) -> Self {
        Self(SpeedMap { factor: p.factor, power: p.power })
    }

    fn each(&mut self, item: &[f32], out: &mut [f32]) {
        out.iter_mut().zip(item).for_each(|(out, &s)| *out = self.0.map(s).min(f32::MAX));
    }
}

#[cfg(test)]
mod tests;
