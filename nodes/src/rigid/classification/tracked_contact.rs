//! Contacts between two frames: what the classifier stores of each.

use super::history::History;
use super::rules::Rules;
use crate::contact::vector::{Vec3, add, norm, scale, sub, widen};
use crate::core::time::{Tick, ticks};
use crate::rigid::item::{ContactFrame, State};
use serde::{Deserialize, Serialize};

/// An impact whose force has not ended yet.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct OpenImpact {
    /// Time of the frame in which it was found.
    pub found: Tick,
    /// Time of the frame with the fastest approach.
    pub landed: Tick,
    /// Time of the impact.
    pub at: Tick,
    /// Speed of approach, m/s.
    pub approach: f64,
    /// Largest force, latest force, and the force before the impact, N.
    pub peak: f64,
    pub last: f64,
    pub base: f64,
    /// Impulse above the force before the impact so far, N s.
    pub impulse: f64,
    /// Smallest impulse, N s; 0 at the begin of a contact.
    pub min_impulse: f64,
    pub frame: ContactFrame,
}

/// One contact and its recent frames.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct TrackedContact {
    pub id: u64,
    pub latest: ContactFrame,
    pub history: History,
    /// Times of the first and of the latest frame.
    pub first_tick: Tick,
    pub last_tick: Tick,
    pub state: State,
    /// True while force and speed hardly vary.
    pub steady: bool,
    /// Time of the last change of state.
    pub last_change: Option<Tick>,
    /// Time of the frame with the fastest approach before the last impact, and that speed.
    pub last_impact: Option<(Tick, f64)>,
    /// True while the latest frame is not tested for an impact.
    pub pending: bool,
    /// Impact whose force has not ended.
    pub open: Option<OpenImpact>,
    /// Position of the contact on body a and slip in the latest frame.
    position: Vec3,
    last_slip: Vec3,
    /// Velocity over the surface of the other body, if it is computed from positions and body a or body b is at rest.
    travel: Option<[Vec3; 2]>,
}

impl TrackedContact {
    pub fn new(tick: Tick, frame: &ContactFrame) -> Self {
        Self {
            id: frame.contact,
            latest: *frame,
            history: History::new(),
            first_tick: tick,
            last_tick: tick,
            state: State::Unsteady,
            steady: false,
            last_change: None,
            last_impact: None,
            pending: false,
            open: None,
            position: frame.local[0],
            last_slip: [0.0; 3],
            travel: None,
        }
    }

    /// Returns true if it began within the time of `impact_memory`, so that its force was 0 then.
    pub fn is_new(&self, tick: Tick, rules: &Rules) -> bool {
        tick - self.first_tick < ticks(rules.impact_memory)
    }

    /// Smallest and largest speed of the contact point over a surface: from the frame, or else from successive positions.
    pub fn update_travel_speeds(&mut self, frame: &ContactFrame, slip: Vec3, step: f64) -> [f64; 2] {
        /// Time constant of smoothing, s.
        const SMOOTHING: f64 = 0.02;
        let speeds = match frame.travel.map(|travel| travel.map(widen)) {
            [Some(a), Some(b)] => [norm(a), norm(b), norm(b)],
            // Travel over a minus travel over b is the slip.
            [Some(a), None] => [norm(a), norm(sub(a, slip)), norm(a)],
            [None, Some(b)] => [norm(add(b, slip)), norm(b), norm(b)],
            [None, None] => {
                if self.history.count > 0 {
                    let point = scale(sub(frame.local[0], self.position), 1.0 / step);
                    let mean_slip = scale(add(slip, self.last_slip), 0.5);
                    let now = [sub(point, mean_slip), add(point, mean_slip)];
                    let part = 1.0 - (-step / SMOOTHING).exp();
                    let old = self.travel.unwrap_or(now);
                    self.travel = Some([0, 1].map(|k| add(old[k], scale(sub(now[k], old[k]), part))));
                }
                // One of the bodies is at rest, but it is not known which: a body that only slides has no travel over itself.
                let over = |[b, a]: [Vec3; 2]| [norm(add(b, slip)), norm(b), norm(a)];
                self.travel.map_or([0.0; 3], over)
            }
        };
        (self.position, self.last_slip) = (frame.local[0], slip);
        let [first, rest @ ..] = speeds;
        [rest.iter().fold(first, |a, b| a.min(*b)), first.max(rest[0])]
    }
}
