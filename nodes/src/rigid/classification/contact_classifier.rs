//! The node `ContactClassifier`.

use super::classifier::Classifier;
use super::rules::{ImpactObjects, PowerLaw, Rules};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Tick;
use crate::modal::Impact;
use crate::rigid::item::{ContactFrame, ContactState};
use crate::{archive_state, params, ports};
use std::collections::VecDeque;

params! {
    /// Finds impacts, and classifies continuous contacts as static, sliding, rolling or mixed.
    ///
    /// An impact is a peak of the normal force that exceeds the recent forces, next to a peak of speed and with a fast enough
    /// approach; the first frame of a contact needs the approach only. The approach is the largest of the 20 ms before. The energy
    /// is that of the effective mass at this speed; the impulse is the force of the frames that belong to the impact, times their
    /// lengths. An unknown mass is computed from impulse and approach. A contact that begins with a known `depth` began depth over
    /// approach before the end of its frame. Contacts of the same bodies that land less than `frame` apart have one impact. While force
    /// and speed are steady, there are no impacts.
    ///
    /// A contact that lasts and is not interrupted again and again has a state, which follows from the slip and the speed of rolling,
    /// the smaller of the speeds of the contact point over the two surfaces: with neither it is static and silent, without slip it
    /// rolls, otherwise it slides. Every state has separate thresholds to enter and to leave it, and lasts for at least `dwell`.
    /// States are entered by the speeds of the moment and left for rest by the largest of `steady_window`, so that a body that
    /// slides to and fro does not rest at its turning points. All times are in seconds, so that states, energies and levels depend
    /// on the motion and hardly on the frame rate.
    ///
    /// Its power is that of friction: force times slip, and for rolling a small fraction of force times speed. The amplitude is the
    /// square root of the power.
    ///
    /// The latency is two frames, or one frame and `pulse` if that is longer: a peak of force is certain only with the next frame, or
    /// when that is overdue, its impulse is summed for `pulse`, and a contact may begin up to a frame before the end of its frame.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.2. They
    /// name the criteria of each kind; the thresholds, and powers that do not vanish for ideal sliding and rolling, are choices of
    /// this project.
    pub struct ContactClassifierParams {
        /// Longest time from one frame to the next; the latency is this time and the longer of it and `pulse`.
        frame: f64 = 0.0166666666667, unit "s", range 0.0001..=0.2;
        /// Position of a force within its frame: 0.5 for a mean over the frame, 1 for the force at its end.
        moment: f64 = 0.5, unit "", range 0.0..=1.0;
        /// Time over which force is averaged: with short frames, engines let bodies at rest tremble.
        blend: f64 = 0.0166666666667, unit "s", range 0.0..=1.0;
        /// Longest time after a peak of the force in which its impulse is summed; the latency is at least `frame` and this time.
        pulse: f64 = 0.01, unit "s", range 0.0..=0.2;
        /// Smallest prominence of an impact during a contact: its impulse above the smallest recent force, over `blend`.
        impact_force: f64 = 0.5, unit "N", range 0.0..=1.0e9_f64;
        /// Time over which the smallest recent force is taken.
        impact_memory: f64 = 0.1, unit "s", range 0.0..=10.0;
        /// Time over which the median force is taken; the prominence must exceed that as well.
        impact_median: f64 = 0.25, unit "s", range 0.0..=10.0;
        /// Smallest speed of approach of an impact.
        impact_approach: f64 = 0.05, unit "m/s", range 0.001..=1000.0;
        /// Time after an impact in which the contact has no other impact, unless its approach is a fifth faster.
        refractory: f64 = 0.03, unit "s", range 0.0..=10.0;
        /// Speed after an impact over speed before it, if no mass is known.
        restitution: f64 = 0.5, unit "", range 0.0..=1.0;
        /// Stiffness of the pair relative to steel on stone.
        hardness: f64 = 1.0, unit "", range 0.000001..=1000.0;
        /// Bodies that sound on an impact; the object of an impact is the number of the body.
        struck: ImpactObjects = ImpactObjects::Both;
        /// Time after which a contact has a state.
        held: f64 = 0.05, unit "s", range 0.0..=10.0;
        /// Number of frames after which a contact has a state.
        held_frames: u16 = 3, unit "frames", range 1..=64_u16;
        /// Time over which the variation of force and speed and the largest recent speeds are measured, at least four frames.
        steady_window: f64 = 0.1, unit "s", range 0.0..=10.0;
        /// Standard deviation over mean of force and speed below which a contact becomes steady and has no impacts.
        steady_enter: f64 = 0.35, unit "", range 0.0..=100.0;
        /// Standard deviation over mean of force and speed above which it is no longer steady.
        steady_leave: f64 = 0.6, unit "", range 0.0..=100.0;
        /// Largest slip of a rolling contact.
        rolling_slip: f64 = 0.02, unit "m/s", range 0.0..=100.0;
        /// Largest slip relative to the speed over the surface; the larger of both limits applies.
        rolling_share: f64 = 0.05, unit "", range 0.0..=1.0;
        /// Speed over the surface above which a contact starts to roll.
        rolling_speed: f64 = 0.02, unit "m/s", range 0.0..=100.0;
        /// Speed below which it stops rolling.
        rolling_leave: f64 = 0.01, unit "m/s", range 0.0..=100.0;
        /// Slip above which a contact starts to slide.
        sliding_speed: f64 = 0.05, unit "m/s", range 0.0..=100.0;
        /// Slip below which it stops sliding.
        sliding_leave: f64 = 0.03, unit "m/s", range 0.0..=100.0;
        /// Slip and speed below which a contact is static.
        static_speed: f64 = 0.02, unit "m/s", range 0.000001..=100.0;
        /// Shortest time between two changes of state.
        dwell: f64 = 0.1, unit "s", range 0.0..=10.0;
        /// Coefficient of friction, if the friction force is unknown.
        friction: f64 = 0.4, unit "", range 0.0..=10.0;
        /// Coefficient of rolling resistance.
        rolling_resistance: f64 = 0.02, unit "", range 0.0..=10.0;
        /// Relation between amplitude and power.
        law: PowerLaw = PowerLaw::Sqrt;
        /// Power at which the amplitude is 1.
        power_ref: f64 = 1.0, unit "W", range 0.000000001..=1.0e9_f64;
        /// Smallest and largest amplitude.
        range: [f64; 2] = [-60.0, 12.0], unit "dB", range -200.0..=60.0;
        /// Largest number of contacts at a time; beyond it the contact whose latest frame is the oldest is dropped.
        room: u16 = 64, unit "contacts", range 1..=1024_u16;
    }
}
ports! {
    pub struct ContactClassifierPorts / ContactClassifierIo {
        in {
            /// The contacts.
            contacts: Events<ContactFrame>,
        }
        out {
            /// Every frame with its state.
            states: Events<ContactState>,
            /// The impacts.
            impacts: Events<Impact>,
        }
    }
}

/// Capacity of the queue of states.
const MAX_STATES: usize = 8192;

/// The node `ContactClassifier`.
#[derive(Debug)]
pub struct ContactClassifier {
    classifier: Classifier,
    states: VecDeque<(Tick, ContactState)>,
    /// Latency and `room`; a change of them requires a rebuild.
    fixed: (Tick, u16),
    dropped: u64,
}

fn rules(p: &ContactClassifierParams) -> Rules {
    Rules {
        frame: p.frame,
        moment: p.moment,
        blend: p.blend,
        pulse: p.pulse,
        impact_force: p.impact_force,
        impact_memory: p.impact_memory,
        impact_median: p.impact_median,
        impact_approach: p.impact_approach,
        refractory: p.refractory,
        restitution: p.restitution,
        hardness: p.hardness,
        struck: p.struck,
        held: p.held,
        held_frames: p.held_frames.into(),
        steady_window: p.steady_window,
        steady_enter: p.steady_enter,
        steady_leave: p.steady_leave,
        rolling_slip: p.rolling_slip,
        rolling_share: p.rolling_share,
        rolling_speed: p.rolling_speed,
        rolling_leave: p.rolling_leave,
        sliding_speed: p.sliding_speed,
        sliding_leave: p.sliding_leave,
        static_speed: p.static_speed,
        dwell: p.dwell,
        friction: p.friction,
        rolling_resistance: p.rolling_resistance,
        law: p.law,
        power_ref: p.power_ref,
        range: p.range,
    }
}

/// Pairs of parameters whose order matters.
fn check(p: &ContactClassifierParams) -> Result<(), Reject> {
    let pairs = [
        ("steady_leave", p.steady_leave, "steady_enter", p.steady_enter),
        ("rolling_speed", p.rolling_speed, "rolling_leave", p.rolling_leave),
        ("sliding_speed", p.sliding_speed, "sliding_leave", p.sliding_leave),
        ("range", p.range[1], "range", p.range[0]),
    ];
    for (high, above, low, below) in pairs {
        if above < below {
            let message = if high == low {
                format!("`{high}` is {below} to {above}; the smaller limit comes first")
            } else {
                format!(
                    "`{high}` is {above}, less than `{low}`, which is {below}: states would change in every frame"
                )
            };
            return Err(Reject::new("F134", message).at(high));
        }
    }
    Ok(())
}

impl Node for ContactClassifier {
    type Params = ContactClassifierParams;
    type Ports = ContactClassifierPorts;
    const NAME: &'static str = "ContactClassifier";
    const VERSION: u32 = 6;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 1000.0;

    fn shape(
        p: &ContactClassifierParams,
        s: &mut Shape<'_, '_, ContactClassifierPorts>,
    ) -> Result<(), Reject> {
        check(p)?;
        s.lag(rules(p).latency());
        Ok(())
    }

    fn build(p: &ContactClassifierParams, _: &Build<'_>) -> Result<Self, Fault> {
        let rules = rules(p);
        Ok(Self {
            fixed: (rules.latency(), p.room),
            classifier: Classifier::new(rules, p.room.into()),
            states: VecDeque::with_capacity(MAX_STATES),
            dropped: 0,
        })
    }

    fn run(&mut self, mut io: ContactClassifierIo<'_>) -> Result<(), Fault> {
        let (_, now) = io.contacts.window();
        for (tick, frame) in io.contacts.events() {
            let Some(state) = self.classifier.take(*tick, frame) else { continue };
            if self.states.len() == MAX_STATES {
                self.dropped += 1;
            } else {
                self.states.push_back((*tick, state));
            }
        }
        self.classifier.advance_to(now);
        let (_, to) = io.states.window();
        while let Some((tick, state)) = self.states.pop_front_if(|(tick, _)| *tick < to) {
            io.states.push(tick, state);
        }
        while let Some((tick, impact)) = self.classifier.next_impact(to) {
            io.impacts.push(tick, impact);
        }
        Ok(())
    }

    fn finish(&mut self, _: ContactClassifierIo<'_>) -> Result<Summary, Fault> {
        let c = &self.classifier;
        let names = ["unsteady", "static", "sliding", "rolling", "mixed"];
        let mut summary: Summary = vec![("impacts", c.impact_count.into())];
        summary.extend(names.into_iter().zip(c.frames).map(|(name, frames)| (name, frames.into())));
        if c.not_finite > 0 {
            summary.push(("not_finite", c.not_finite.into()));
        }
        if c.dropped + self.dropped > 0 {
            summary.push(("dropped", (c.dropped + self.dropped).into()));
        }
        Ok(summary)
    }

    fn retune(&mut self, new: &ContactClassifierParams) -> Retune {
        let rules = rules(new);
        if self.fixed != (rules.latency(), new.room) {
            return Retune::Rebuild;
        }
        self.classifier.set_rules(&rules);
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        self.classifier.take_state(&old.classifier);
        self.states.clear();
        self.states.extend(old.states.iter().copied());
    }

    archive_state!(classifier, states, dropped);

    fn trial(rng: &mut Rng) -> (ContactClassifierParams, MemoryFiles) {
        let given = ContactClassifierParams::trial(rng);
        let [low, high] = [rng.between(0.0, 0.5), rng.between(0.5, 1.0)];
        let params = ContactClassifierParams {
            frame: [1.0 / 60.0, 0.004, 0.05][rng.below(3)],
            steady_enter: low,
            steady_leave: high,
            rolling_speed: high,
            rolling_leave: low,
            sliding_speed: high,
            sliding_leave: low,
            range: [-60.0, 12.0],
            room: 1 + rng.below(3) as u16,
            ..given
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Event;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;

    fn params() -> ContactClassifierParams {
        ContactClassifierParams::read(&|_| None).unwrap()
    }

    #[test]
    fn defaults_are_those_of_the_rules() {
        let (a, b) = (rules(&params()), Rules::default());
        assert!((a.frame - b.frame).abs() + (a.blend - b.blend).abs() < 1e-9);
        assert_eq!(Rules { frame: b.frame, blend: b.blend, ..a }, b);
    }

    #[test]
    fn an_impact_and_its_frame_are_two_frames_late_with_their_own_times() {
        let mut frame = ContactFrame::trial(&mut Rng::new(3));
        (frame.begins, frame.ends, frame.approach, frame.force) = (true, true, Some(2.0), 30.0);
        frame.interval = ticks(1.0 / 60.0);
        let standalone = Standalone::new::<ContactClassifier>(params()).events(
            ContactClassifierPorts::contacts,
            vec![(ticks(0.1), frame)],
            ticks(0.2),
        );
        let shape = standalone.shape().unwrap();
        assert!((shape.lag - ticks(2.0 / 60.0)).abs() <= 4);
        let run = standalone.window(ticks(0.001)).run().unwrap();
        let states = run.events(ContactClassifierPorts::states);
        assert_eq!((states.len(), states[0].0), (1, ticks(0.1)));
        let impacts = run.events(ContactClassifierPorts::impacts);
        let objects: Vec<u32> = impacts.iter().map(|(_, impact)| impact.object).collect();
        assert_eq!(objects, frame.bodies);
        // The force is the mean over the frame, at its middle.
        assert!((impacts[0].0 - ticks(0.1 - 1.0 / 120.0)).abs() < 10, "{}", impacts[0].0);
    }

    #[test]
    fn overlapping_limits_are_rejected() {
        let p = ContactClassifierParams { sliding_leave: 0.1, ..params() };
        let standalone =
            Standalone::new::<ContactClassifier>(p).events(ContactClassifierPorts::contacts, Vec::new(), 1);
        let reject = standalone.shape().unwrap_err();
        assert!(reject.code == "F134" && reject.message.contains("`sliding_speed` is 0.05"), "{reject}");
    }
}
