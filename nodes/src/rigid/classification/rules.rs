//! Thresholds and times of the classification.

use crate::choices;
use crate::core::time::{Tick, ticks};

choices! {
    /// Relation between amplitude and power.
    pub enum PowerLaw {
        /// Amplitude is proportional to the square root of power, so that the energy of the sound is that of the contact.
        Sqrt,
        /// Amplitude is proportional to power, as in the paper.
        Linear,
    }
}

choices! {
    /// Bodies that sound on an impact.
    pub enum ImpactObjects {
        /// Both bodies, one impact each.
        Both,
        /// Body a, the one with the smaller number.
        A,
        /// Body b.
        B,
    }
}

/// Thresholds and times of the classification, in SI units; named like the parameters of `ContactClassifier`.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Rules {
    /// Longest time between two frames.
    pub frame: f64,
    /// Position of a force within its frame: 0 at its start, 1 at its end.
    pub moment: f64,
    /// Time over which force is averaged.
    pub blend: f64,
    /// Longest time after a peak of the force in which its impulse is summed.
    pub pulse: f64,
    pub impact_force: f64,
    pub impact_memory: f64,
    pub impact_median: f64,
    pub impact_approach: f64,
    pub refractory: f64,
    pub restitution: f64,
    pub hardness: f64,
    pub struck: ImpactObjects,
    pub held: f64,
    pub held_frames: usize,
    pub steady_window: f64,
    pub steady_enter: f64,
    pub steady_leave: f64,
    pub rolling_slip: f64,
    pub rolling_share: f64,
    pub rolling_speed: f64,
    pub rolling_leave: f64,
    pub sliding_speed: f64,
    pub sliding_leave: f64,
    pub static_speed: f64,
    pub dwell: f64,
    pub friction: f64,
    pub rolling_resistance: f64,
    pub law: PowerLaw,
    pub power_ref: f64,
    /// Smallest and largest gain, dB.
    pub range: [f64; 2],
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            frame: 1.0 / 60.0,
            moment: 0.5,
            blend: 1.0 / 60.0,
            pulse: 0.01,
            impact_force: 0.5,
            impact_memory: 0.1,
            impact_median: 0.25,
            impact_approach: 0.05,
            refractory: 0.03,
            restitution: 0.5,
            hardness: 1.0,
            struck: ImpactObjects::Both,
            held: 0.05,
            held_frames: 3,
            steady_window: 0.1,
            steady_enter: 0.35,
            steady_leave: 0.6,
            rolling_slip: 0.02,
            rolling_share: 0.05,
            rolling_speed: 0.02,
            rolling_leave: 0.01,
            sliding_speed: 0.05,
            sliding_leave: 0.03,
            static_speed: 0.02,
            dwell: 0.1,
            friction: 0.4,
            rolling_resistance: 0.02,
            law: PowerLaw::Sqrt,
            power_ref: 1.0,
            range: [-60.0, 12.0],
        }
    }
}

impl Rules {
    /// Returns the latency: a frame is tested for an impact when the next one arrives or is overdue, the impulse is summed for
    /// `pulse`, and the impact may be up to half a frame before the end of its frame; if its depth is known, up to a whole one.
    #[must_use]
    pub fn latency(&self) -> Tick {
        let frame = ticks(self.frame);
        frame + frame.max(ticks(self.pulse))
    }

    /// Time after which the next frame of a contact is overdue; earlier after one of known depth, whose impact may be earlier too.
    pub(super) fn overdue_time(&self, has_depth: bool) -> Tick {
        let frame = ticks(self.frame);
        if has_depth { 2 * frame - self.begin_time() } else { frame * 3 / 2 }
    }

    /// Longest time from the begin of a contact to the end of its first frame: almost a frame, so that times of frames may be rounded.
    pub(super) fn begin_time(&self) -> Tick {
        ticks(self.frame) * 31 / 32
    }

    /// Time without frames after which a contact has ended.
    pub(super) fn end_time(&self) -> Tick {
        ticks(self.frame) * 5 / 2
    }

    /// Amplitude of a contact with this power, W.
    pub(super) fn gain(&self, power: f64) -> f64 {
        if power <= 0.0 {
            return 0.0;
        }
        let ratio = power / self.power_ref;
        let gain = if self.law == PowerLaw::Sqrt { ratio.sqrt() } else { ratio };
        gain.clamp(10_f64.powf(self.range[0] / 20.0), 10_f64.powf(self.range[1] / 20.0))
    }
}
