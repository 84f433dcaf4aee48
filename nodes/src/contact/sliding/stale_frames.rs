//! Speeds of a mesh whose frames arrive late or irregularly.

use crate::impl_state;

/// Speed of a vertex while no new frame arrives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaleParams {
    /// Time for which the last speed is held, s.
    pub hold: f64,
    /// Time of the ramp from there to 0, s.
    pub ramp: f64,
}

/// Relation between an item of a mesh and the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameStep {
    /// A new frame; one over the time between the two, 1/s.
    New(f64),
    /// The same frame; factor on the last speed.
    Repeated(f64),
}

/// Tracks the ages of the frames in the items of a mesh stream.
///
/// The frames of two successive items are `period + age - next age` apart: 0 if the frame is the same, several periods after a
/// gap. A slide divided by that time is a speed, however irregularly frames arrive.
#[derive(Clone, Debug)]
pub struct StaleFrames {
    params: StaleParams,
    period: f64,
    /// Time for which the frame has been the same, s.
    stale_time: f64,
    /// Speeds between the last two frames, m/s.
    last_speeds: Vec<f32>,
}
impl_state!(StaleFrames { stale_time, last_speeds });

impl StaleFrames {
    /// A tracker with all speeds 0; `period` is the time from item to item, s.
    #[must_use]
    pub fn new(params: StaleParams, period: f64, vertices: usize) -> Self {
        Self { params, period, stale_time: 0.0, last_speeds: vec![0.0; vertices] }
    }

    /// Resets the state to that of a new tracker.
    pub fn reset(&mut self) {
        self.stale_time = 0.0;
        self.last_speeds.fill(0.0);
    }

    /// Returns the relation between two successive items with these ages, s.
    pub fn step(&mut self, [age, next]: [f32; 2]) -> FrameStep {
        let (age, next) = (f64::from(age), f64::from(next));
        let time = self.period + age - next;
        // Ages are rounded to single precision.
        if time > 0.01 * self.period + 1e-6 * age.abs() {
            self.stale_time = 0.0;
            return FrameStep::New(1.0 / time);
        }
        let StaleParams { hold, ramp } = self.params;
        let beyond_hold = self.stale_time - hold;
        self.stale_time += self.period;
        FrameStep::Repeated(if beyond_hold <= 0.0 { 1.0 } else { (1.0 - beyond_hold / ramp).max(0.0) })
    }

    /// Stores the speeds from one frame to a new one.
    pub fn set_last_speeds(&mut self, speeds: &[f32]) {
        self.last_speeds.copy_from_slice(speeds);
    }

    /// Returns the stored speeds.
    #[must_use]
    pub fn last_speeds(&self) -> &[f32] {
        &self.last_speeds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    const PERIOD: f64 = 1.0 / 60.0;

    fn tracker(hold: f64, ramp: f64) -> StaleFrames {
        StaleFrames::new(StaleParams { hold, ramp }, PERIOD, 1)
    }

    /// Ages of items at 60 per second that hold the newest of the frames with these times.
    fn ages(stamps: &[f64], items: usize) -> Vec<f32> {
        let newest = |time: f64| stamps.iter().rev().find(|s| **s <= time + 1e-9).copied().unwrap_or(0.0);
        (0..items).map(|k| k as f64 * PERIOD).map(|time| (time - newest(time)) as f32).collect()
    }

    fn steps(tracker: &mut StaleFrames, ages: &[f32]) -> Vec<FrameStep> {
        ages.windows(2).map(|pair| tracker.step([pair[0], pair[1]])).collect()
    }

    #[test]
    fn frames_on_time_are_one_period_apart_whatever_their_age() {
        for age in [0.0_f32, 0.004, 0.3, 1000.0] {
            for step in steps(&mut tracker(0.1, 0.1), &[age; 10]) {
                assert!(
                    matches!(step, FrameStep::New(f) if (f * PERIOD - 1.0).abs() < 1e-9),
                    "{age}: {step:?}"
                );
            }
        }
    }

    #[test]
    fn a_repeated_frame_holds_the_speed_and_then_ramps_it_to_zero() {
        // The last frame is at 0.1 s.
        let stamps: Vec<f64> = (0..7).map(|k| f64::from(k) * PERIOD).collect();
        let found = steps(&mut tracker(0.1, 0.1), &ages(&stamps, 40));
        for (k, step) in found.iter().enumerate() {
            let stale = (k as f64 - 6.0) * PERIOD;
            let share = (1.0 - (stale - 0.1) / 0.1).clamp(0.0, 1.0);
            match step {
                FrameStep::New(f) => assert!(stale < -1e-9 && (f * PERIOD - 1.0).abs() < 1e-6, "{k} {f}"),
                FrameStep::Repeated(factor) => {
                    assert!(stale > -1e-9 && (factor - share).abs() < 1e-6, "{k} {factor} {share}")
                }
            }
        }
        assert_eq!(found[38], FrameStep::Repeated(0.0));
        // Without a ramp the speed is 0 immediately after the hold.
        let found = steps(&mut tracker(0.06, 0.0), &ages(&stamps, 13));
        assert_eq!(
            found[9..],
            [FrameStep::Repeated(1.0), FrameStep::Repeated(0.0), FrameStep::Repeated(0.0)]
        );
    }

    #[test]
    fn a_slide_over_a_gap_is_divided_by_the_gap_and_the_hold_starts_again() {
        let stamps = [0.0, PERIOD, 11.0 * PERIOD, 12.0 * PERIOD];
        let found = steps(&mut tracker(0.05, 0.05), &ages(&stamps, 16));
        let FrameStep::New(f) = found[10] else { panic!("{found:?}") };
        assert!((f * PERIOD - 0.1).abs() < 1e-6, "{f}");
        assert!(matches!(found[9], FrameStep::Repeated(factor) if factor < 1e-6));
        assert!(matches!(found[12], FrameStep::Repeated(factor) if factor == 1.0), "{found:?}");
    }

    #[test]
    fn a_constant_speed_stays_constant_over_frames_at_irregular_times() {
        for seed in 0..20 {
            let mut rng = Rng::new(seed);
            // 60 frames per second on average, each up to 0.4 periods late, and some lost.
            let jittered = |k| (f64::from(k) + rng.between(0.0, 0.4)) * PERIOD;
            let mut stamps: Vec<f64> = (0..600).map(jittered).collect();
            stamps.retain(|_| rng.below(10) > 0);
            let ages = ages(&stamps, 600);
            let mut frames = 0;
            let mut tracker = tracker(0.1, 0.1);
            for (k, pair) in ages.windows(2).enumerate().skip(20) {
                // Times of the frames of these two items; the speed is 0.37 m/s.
                let [a, b] = [0, 1].map(|i| (k + i) as f64 * PERIOD - f64::from(pair[i]));
                match tracker.step([pair[0], pair[1]]) {
                    FrameStep::New(f) => {
                        let speed = 0.37 * (b - a) * f;
                        assert!((speed / 0.37 - 1.0).abs() < 1e-6, "{speed}");
                        frames += 1;
                    }
                    FrameStep::Repeated(factor) => assert!((b - a).abs() < 1e-6 && factor == 1.0),
                }
            }
            assert!(frames > 400, "{frames}");
        }
    }

    #[test]
    fn invalid_ages_hold_the_speed() {
        for pair in [[0.0, 5.0], [f32::NAN, 0.0], [0.0, f32::INFINITY], [-1.0, 1.0]] {
            assert!(
                matches!(tracker(0.1, 0.1).step(pair), FrameStep::Repeated(factor) if factor == 1.0),
                "{pair:?}"
            );
        }
        let FrameStep::New(f) = tracker(0.1, 0.1).step([f32::MAX, 0.0]) else { panic!() };
        assert!(f.is_finite());
    }
}
