//! What a mesh whose frames come late says of the speed of its vertices.

use crate::impl_state;

/// How long a vertex goes on at its last speed while no frame comes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateParams {
    /// Time at the last speed, s.
    pub hold: f64,
    /// Time from the last speed to 0 after that, s.
    pub ramp: f64,
}

/// What lies between an item of a mesh and the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Another frame; one over the seconds from one to the other.
    Frame(f64),
    /// The same frame again; what is left of the last speed.
    Again(f64),
}

/// Follows the ages of the frames that a mesh shows from item to item.
///
/// Two items show frames that are `period + age - next age` apart: none at all where the frame is the same, several periods where one
/// comes after a gap. A slide over that time is a speed, however irregularly frames come.
#[derive(Clone, Debug)]
pub struct Late {
    params: LateParams,
    period: f64,
    /// For how long the same frame has been there.
    stale: f64,
    /// Speeds from the last frame to the one before it, m/s.
    last: Vec<f32>,
}
impl_state!(Late { stale, last });

impl Late {
    /// Nothing moves yet; `period` is the time from item to item.
    #[must_use]
    pub fn new(params: LateParams, period: f64, vertices: usize) -> Self {
        Self { params, period, stale: 0.0, last: vec![0.0; vertices] }
    }

    /// As if nothing had been seen.
    pub fn reset(&mut self) {
        self.stale = 0.0;
        self.last.fill(0.0);
    }

    /// What lies between two items of these ages.
    pub fn step(&mut self, [age, next]: [f32; 2]) -> Step {
        let (age, next) = (f64::from(age), f64::from(next));
        let time = self.period + age - next;
        // Ages are rounded to single precision.
        if time > 0.01 * self.period + 1e-6 * age.abs() {
            self.stale = 0.0;
            return Step::Frame(1.0 / time);
        }
        let LateParams { hold, ramp } = self.params;
        let over = self.stale - hold;
        self.stale += self.period;
        Step::Again(if over <= 0.0 { 1.0 } else { (1.0 - over / ramp).max(0.0) })
    }

    /// Keeps the speeds from one frame to another.
    pub fn keep(&mut self, speeds: &[f32]) {
        self.last.copy_from_slice(speeds);
    }

    /// The speeds that were kept.
    #[must_use]
    pub fn kept(&self) -> &[f32] {
        &self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    const PERIOD: f64 = 1.0 / 60.0;

    fn late(hold: f64, ramp: f64) -> Late {
        Late::new(LateParams { hold, ramp }, PERIOD, 1)
    }

    /// Ages of items at 60 per second that show the newest of the frames with these time stamps.
    fn ages(stamps: &[f64], items: usize) -> Vec<f32> {
        let newest = |time: f64| stamps.iter().rev().find(|s| **s <= time + 1e-9).copied().unwrap_or(0.0);
        (0..items).map(|k| k as f64 * PERIOD).map(|time| (time - newest(time)) as f32).collect()
    }

    fn steps(late: &mut Late, ages: &[f32]) -> Vec<Step> {
        ages.windows(2).map(|pair| late.step([pair[0], pair[1]])).collect()
    }

    #[test]
    fn frames_on_time_are_one_period_apart_whatever_their_age() {
        for age in [0.0_f32, 0.004, 0.3, 1000.0] {
            for step in steps(&mut late(0.1, 0.1), &[age; 10]) {
                assert!(matches!(step, Step::Frame(f) if (f * PERIOD - 1.0).abs() < 1e-9), "{age}: {step:?}");
            }
        }
    }

    #[test]
    fn a_frame_that_stays_keeps_the_speed_for_the_hold_and_loses_it_over_the_ramp() {
        // One frame at 0.1 s, and none from then on.
        let stamps: Vec<f64> = (0..7).map(|k| f64::from(k) * PERIOD).collect();
        let found = steps(&mut late(0.1, 0.1), &ages(&stamps, 40));
        for (k, step) in found.iter().enumerate() {
            let stale = (k as f64 - 6.0) * PERIOD;
            let share = (1.0 - (stale - 0.1) / 0.1).clamp(0.0, 1.0);
            match step {
                Step::Frame(f) => assert!(stale < -1e-9 && (f * PERIOD - 1.0).abs() < 1e-6, "{k} {f}"),
                Step::Again(left) => {
                    assert!(stale > -1e-9 && (left - share).abs() < 1e-6, "{k} {left} {share}")
                }
            }
        }
        assert_eq!(found[38], Step::Again(0.0));
        // Without a ramp it ends at once.
        let found = steps(&mut late(0.06, 0.0), &ages(&stamps, 13));
        assert_eq!(found[9..], [Step::Again(1.0), Step::Again(0.0), Step::Again(0.0)]);
    }

    #[test]
    fn a_frame_after_a_gap_is_divided_by_the_gap_and_the_hold_begins_anew() {
        let stamps = [0.0, PERIOD, 11.0 * PERIOD, 12.0 * PERIOD];
        let found = steps(&mut late(0.05, 0.05), &ages(&stamps, 16));
        let Step::Frame(f) = found[10] else { panic!("{found:?}") };
        assert!((f * PERIOD - 0.1).abs() < 1e-6, "{f}");
        assert!(matches!(found[9], Step::Again(left) if left < 1e-6));
        assert!(matches!(found[12], Step::Again(left) if left == 1.0), "{found:?}");
    }

    #[test]
    fn a_speed_is_constant_over_frames_at_irregular_times() {
        for seed in 0..20 {
            let mut rng = Rng::new(seed);
            // 60 frames a second by their mean, each up to 0.4 periods late, and some lost.
            let jittered = |k| (f64::from(k) + rng.between(0.0, 0.4)) * PERIOD;
            let mut stamps: Vec<f64> = (0..600).map(jittered).collect();
            stamps.retain(|_| rng.below(10) > 0);
            let ages = ages(&stamps, 600);
            let mut frames = 0;
            let mut late = late(0.1, 0.1);
            for (k, pair) in ages.windows(2).enumerate().skip(20) {
                // Where the frames of these two items are, at 0.37 m/s.
                let [a, b] = [0, 1].map(|i| (k + i) as f64 * PERIOD - f64::from(pair[i]));
                match late.step([pair[0], pair[1]]) {
                    Step::Frame(f) => {
                        let speed = 0.37 * (b - a) * f;
                        assert!((speed / 0.37 - 1.0).abs() < 1e-6, "{speed}");
                        frames += 1;
                    }
                    Step::Again(left) => assert!((b - a).abs() < 1e-6 && left == 1.0),
                }
            }
            assert!(frames > 400, "{frames}");
        }
    }

    #[test]
    fn ages_that_make_no_sense_hold() {
        for pair in [[0.0, 5.0], [f32::NAN, 0.0], [0.0, f32::INFINITY], [-1.0, 1.0]] {
            assert!(matches!(late(0.1, 0.1).step(pair), Step::Again(left) if left == 1.0), "{pair:?}");
        }
        let Step::Frame(f) = late(0.1, 0.1).step([f32::MAX, 0.0]) else { panic!() };
        assert!(f.is_finite());
    }
}
