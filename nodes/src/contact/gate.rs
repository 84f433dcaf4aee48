//! Which vertices are silent although they move a little.
//!
//! The paper silences a vertex whose speed never exceeds a threshold in the whole animation. That needs the whole take, so
//! two gates stand beside it that don't. Comparisons are strict: a threshold of 0 still removes vertices that never move.

use crate::impl_state;
use serde::{Deserialize, Serialize};

/// The kind of gate and its times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum GateMode {
    /// A vertex passes if its speed ever exceeds the threshold: the paper's rule, offline only.
    Ever,
    /// A run of contact passes if its own speed exceeds the threshold, known at most `max_hold` seconds ahead.
    Interval {
        /// Look-ahead, seconds; the default is 0.5.
        max_hold: f64,
    },
    /// Opens with the first sample above the threshold and closes after `hold` seconds of quiet; needs no look-ahead.
    Causal {
        /// Seconds of quiet; the default is 0.25.
        hold: f64,
    },
}

impl Default for GateMode {
    fn default() -> Self {
        Self::Interval { max_hold: 0.5 }
    }
}

impl GateMode {
    /// Frames after frame i that its gated speed depends on; none if it depends on the whole take.
    #[must_use]
    pub fn look_ahead(&self, frames_per_second: f64) -> Option<usize> {
        match self {
            Self::Ever => None,
            Self::Interval { max_hold } => Some(hold_frames(*max_hold, frames_per_second)),
            Self::Causal { .. } => Some(0),
        }
    }
}

/// ceil(max_hold fps): the look-ahead of [`IntervalGate`] in frames.
#[must_use]
pub fn hold_frames(max_hold: f64, frames_per_second: f64) -> usize {
    // 0.1 s at 30 frames per second is 3 frames, although the product in binary lies a hair above 3.
    (max_hold * frames_per_second - 1e-9).ceil().max(0.0) as usize
}

/// The paper's gate: a first pass keeps one maximum per vertex, a second silences the vertices that stay at or below.
#[derive(Clone, Debug)]
pub struct EverGate {
    threshold: f32,
    maxima: Vec<f32>,
}
impl_state!(EverGate { maxima });

impl EverGate {
    /// A gate that has seen nothing yet.
    #[must_use]
    pub fn new(vertices: usize, threshold: f32) -> Self {
        Self { threshold, maxima: vec![0.0; vertices] }
    }

    /// A gate over a first pass made elsewhere.
    #[must_use]
    pub fn from_maxima(maxima: Vec<f32>, threshold: f32) -> Self {
        Self { threshold, maxima }
    }

    /// Goes on with another threshold; the maxima hold whatever it is.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.threshold = threshold;
    }

    /// First pass: takes in the speeds of a frame, one per vertex.
    pub fn observe(&mut self, speeds: &[f32]) {
        for (maximum, &speed) in self.maxima.iter_mut().zip(speeds) {
            *maximum = maximum.max(speed);
        }
    }

    /// The fastest speed of each vertex so far.
    #[must_use]
    pub fn maxima(&self) -> &[f32] {
        &self.maxima
    }

    /// Second pass: the speeds of a frame without the silenced vertices.
    pub fn apply(&self, speeds: &[f32], out: &mut [f32]) {
        for ((out, &speed), &maximum) in out.iter_mut().zip(speeds).zip(&self.maxima) {
            *out = if maximum > self.threshold { speed } else { 0.0 };
        }
    }
}

/// Keeps a frame of a contact run if the run exceeds the threshold at or before a fixed number of frames ahead.
///
/// With look-ahead L, frame i of a vertex passes if and only if it is in contact and some frame j <= i + L of the same
/// unbroken run has a speed above the threshold. A run of at most L + 1 frames therefore passes whole or not at all; a
/// longer one passes from L frames before its first fast frame. The gated frame i depends on frames up to i + L only, and
/// on nothing but the frames: not on the blocks in which they arrive.
///
/// # Shapes
/// A ring of L + 1 frames of speeds, and 9 bytes per vertex.
#[derive(Clone, Debug)]
pub struct IntervalGate {
    threshold: f32,
    look_ahead: usize,
    vertices: usize,
    /// Speeds of the last L + 1 frames, frame n in row n mod (L + 1); negative stands for no contact.
    ring: Vec<f32>,
    /// Whether the run that holds the last frame given out has passed.
    open: Vec<bool>,
    /// First frame not yet known to be slow, for the run that holds the last frame given out.
    unchecked: Vec<u64>,
    taken: u64,
    given: u64,
}
impl_state!(IntervalGate { ring, open, unchecked, taken, given });

impl IntervalGate {
    /// A gate with a look-ahead in frames, as [`hold_frames`] gives it.
    #[must_use]
    pub fn new(vertices: usize, threshold: f32, look_ahead: usize) -> Self {
        Self {
            threshold,
            look_ahead,
            vertices,
            ring: vec![-1.0; vertices * (look_ahead + 1)],
            open: vec![false; vertices],
            unchecked: vec![0; vertices],
            taken: 0,
            given: 0,
        }
    }

    /// Goes on with another threshold: runs that have passed stay, the others are looked at anew.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.threshold = threshold;
        self.unchecked.fill(0);
    }

    /// Frames between a frame's arrival and its output.
    #[must_use]
    pub fn look_ahead(&self) -> usize {
        self.look_ahead
    }

    /// Takes a frame; fills `out` with the frame `look_ahead` earlier and returns true once there is one.
    ///
    /// # Shapes
    /// One speed, one contact flag and one output per vertex; missing ones count as no contact.
    ///
    /// # Complexity
    /// O(V) amortised. Never allocates.
    pub fn push(&mut self, speeds: &[f32], touching: &[bool], out: &mut [f32]) -> bool {
        let row = self.row(self.taken);
        let ring = &mut self.ring[row..row + self.vertices];
        ring.fill(-1.0);
        for ((slot, &speed), &touches) in ring.iter_mut().zip(speeds).zip(touching) {
            if touches {
                *slot = speed.max(0.0);
            }
        }
        self.taken += 1;
        self.taken > self.look_ahead as u64 && self.give(out)
    }

    /// After the last frame: fills `out` with the next frame still held back, or returns false when none is left.
    pub fn finish(&mut self, out: &mut [f32]) -> bool {
        self.given < self.taken && self.give(out)
    }

    fn row(&self, frame: u64) -> usize {
        (frame % (self.look_ahead as u64 + 1)) as usize * self.vertices
    }

    fn give(&mut self, out: &mut [f32]) -> bool {
        let frame = self.given;
        let row = self.row(frame);
        for (v, out) in out.iter_mut().enumerate().take(self.vertices) {
            let speed = self.ring[row + v];
            if speed < 0.0 {
                self.open[v] = false;
                *out = 0.0;
                continue;
            }
            if !self.open[v] {
                self.open[v] = self.run_exceeds(v, frame);
            }
            *out = if self.open[v] { speed } else { 0.0 };
        }
        self.given += 1;
        true
    }

    /// Whether the run through `frame` exceeds the threshold from there to the newest frame.
    fn run_exceeds(&mut self, v: usize, frame: u64) -> bool {
        let mut next = self.unchecked[v].max(frame);
        while next < self.taken {
            let speed = self.ring[self.row(next) + v];
            if speed > self.threshold {
                // Nothing is known about the frames after this one, should a later run reach them.
                return true;
            }
            if speed < 0.0 {
                break;
            }
            next += 1;
        }
        self.unchecked[v] = next;
        false
    }
}

/// Opens at the first speed above the threshold, and closes after `hold` seconds without contact or below half of it.
///
/// # Shapes
/// 8 bytes per vertex.
#[derive(Clone, Debug)]
pub struct CausalGate {
    threshold: f32,
    hold: f64,
    /// Time of the last frame that kept the gate open; minus infinity while it is closed.
    alive: Vec<f64>,
}
impl_state!(CausalGate { alive });

impl CausalGate {
    /// A closed gate; `hold` in seconds.
    #[must_use]
    pub fn new(vertices: usize, threshold: f32, hold: f64) -> Self {
        Self { threshold, hold, alive: vec![f64::NEG_INFINITY; vertices] }
    }

    /// Goes on with another threshold.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.threshold = threshold;
    }

    /// Gates the frame at `time` seconds at once.
    ///
    /// # Shapes
    /// One speed, one contact flag and one output per vertex.
    ///
    /// # Complexity
    /// O(V). Never allocates.
    pub fn push(&mut self, time: f64, speeds: &[f32], touching: &[bool], out: &mut [f32]) {
        let half = 0.5 * self.threshold;
        let vertices = self.alive.iter_mut().zip(out).zip(speeds.iter().zip(touching));
        for ((alive, out), (&speed, &touches)) in vertices {
            let is_open = *alive > f64::NEG_INFINITY;
            if touches && (speed > self.threshold || is_open && speed >= half) {
                *alive = time;
            } else if is_open && time - *alive >= self.hold - 1e-9 {
                *alive = f64::NEG_INFINITY;
            }
            *out = if touches && *alive > f64::NEG_INFINITY { speed } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The rule of [`IntervalGate`] read off a whole take.
    fn interval_of_take(take: &[Option<f32>], threshold: f32, look_ahead: usize) -> Vec<f32> {
        let passes = |i: usize| {
            let start = (0..i).rev().find(|&j| take[j].is_none()).map_or(0, |j| j + 1);
            let last = (i + look_ahead).min(take.len() - 1);
            take[start..=last].iter().enumerate().take_while(|(k, s)| start + k <= i || s.is_some()).any(
                |(k, s)| {
                    let unbroken = take[i..=(start + k).max(i)].iter().all(Option::is_some);
                    unbroken && s.is_some_and(|s| s > threshold)
                },
            )
        };
        (0..take.len()).map(|i| take[i].filter(|_| passes(i)).unwrap_or(0.0)).collect()
    }

    fn run_interval(takes: &[Vec<Option<f32>>], threshold: f32, look_ahead: usize) -> Vec<Vec<f32>> {
        let mut gate = IntervalGate::new(takes.len(), threshold, look_ahead);
        let (mut out, mut gated) = (vec![9.0; takes.len()], vec![Vec::new(); takes.len()]);
        let mut store = |out: &[f32]| gated.iter_mut().zip(out).for_each(|(g, &s)| g.push(s));
        for frame in 0..takes[0].len() {
            let speeds: Vec<f32> = takes.iter().map(|t| t[frame].unwrap_or(0.0)).collect();
            let touching: Vec<bool> = takes.iter().map(|t| t[frame].is_some()).collect();
            if gate.push(&speeds, &touching, &mut out) {
                store(&out);
            }
        }
        while gate.finish(&mut out) {
            store(&out);
        }
        gated
    }

    #[test]
    fn a_short_run_passes_whole_if_it_exceeds_the_threshold_once() {
        let take: Vec<_> =
            [0.1, 0.1, 0.5, 0.1].map(Some).into_iter().chain([None]).chain([Some(0.1); 3]).collect();
        assert_eq!(run_interval(&[take], 0.2, 4), [[0.1, 0.1, 0.5, 0.1, 0.0, 0.0, 0.0, 0.0]]);
    }

    #[test]
    fn a_run_longer_than_the_hold_opens_the_hold_before_its_first_fast_frame() {
        let mut take = vec![Some(0.1); 10];
        take[7] = Some(1.0);
        let gated = run_interval(&[take], 0.2, 3).remove(0);
        assert_eq!(gated, [0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 1.0, 0.1, 0.1]);
    }

    #[test]
    fn a_fast_run_soon_after_does_not_open_the_slow_run_before_it() {
        let take = vec![Some(0.1), Some(0.1), None, Some(1.0)];
        assert_eq!(run_interval(&[take], 0.2, 8), [[0.0, 0.0, 0.0, 1.0]]);
    }

    #[test]
    fn a_zero_threshold_removes_only_vertices_that_never_move() {
        let mut ever = EverGate::new(2, 0.0);
        for frame in [[0.0, 0.0], [0.0, 0.3], [0.0, 0.1]] {
            ever.observe(&frame);
        }
        let mut out = [9.0; 2];
        ever.apply(&[0.0, 0.1], &mut out);
        assert_eq!(out, [0.0, 0.1]);
        assert_eq!(ever.maxima(), [0.0, 0.3]);
    }

    #[test]
    fn a_speed_equal_to_the_threshold_stays_shut_in_every_gate() {
        let mut ever = EverGate::new(1, 0.5);
        ever.observe(&[0.5]);
        let mut out = [9.0];
        ever.apply(&[0.5], &mut out);
        assert_eq!(out, [0.0]);
        CausalGate::new(1, 0.5, 0.25).push(0.0, &[0.5], &[true], &mut out);
        assert_eq!(out, [0.0]);
        assert_eq!(run_interval(&[vec![Some(0.5); 3]], 0.5, 1), [[0.0; 3]]);
    }

    #[test]
    fn the_causal_gate_stays_open_through_short_quiet_and_closes_after_the_hold() {
        let mut gate = CausalGate::new(1, 0.2, 0.25);
        let mut out = [0.0];
        let mut at = |time: f64, speed: f32, touches: bool| {
            gate.push(time, &[speed], &[touches], &mut out);
            out[0]
        };
        assert_eq!(at(0.0, 0.15, true), 0.0);
        assert_eq!(at(0.1, 0.3, true), 0.3);
        assert_eq!(at(0.2, 0.0, false), 0.0);
        assert_eq!(at(0.3, 0.05, true), 0.05);
        assert_eq!(at(0.35, 0.05, true), 0.0);
        assert_eq!(at(0.4, 0.15, true), 0.0);
        assert_eq!(at(0.5, 0.25, true), 0.25);
        assert_eq!(at(0.7, 0.1, true), 0.1);
        assert_eq!(at(0.9, 0.1, true), 0.1);
    }

    #[test]
    fn look_ahead_rounds_up_to_whole_frames() {
        assert_eq!(GateMode::default().look_ahead(60.0), Some(30));
        assert_eq!(GateMode::Interval { max_hold: 0.5 }.look_ahead(25.0), Some(13));
        assert_eq!(GateMode::Interval { max_hold: 0.1 }.look_ahead(30.0), Some(3));
        assert_eq!(
            (GateMode::Ever.look_ahead(60.0), GateMode::Causal { hold: 0.25 }.look_ahead(60.0)),
            (None, Some(0))
        );
    }

    fn take() -> impl Strategy<Value = Vec<Option<f32>>> {
        prop::collection::vec(
            prop::option::weighted(0.8, prop::sample::select(vec![0.0f32, 0.1, 0.2, 0.3])),
            40,
        )
    }

    proptest! {
        #[test]
        fn streaming_equals_the_rule_read_off_the_whole_take(
            takes in prop::collection::vec(take(), 3), look_ahead in 0usize..50,
        ) {
            let expected: Vec<_> = takes.iter().map(|t| interval_of_take(t, 0.2, look_ahead)).collect();
            prop_assert_eq!(run_interval(&takes, 0.2, look_ahead), expected);
        }

        #[test]
        fn a_frame_does_not_depend_on_frames_beyond_the_look_ahead(one in take(), other in take(), cut in 10usize..30) {
            let mut changed = one.clone();
            changed[cut..].copy_from_slice(&other[cut..]);
            let (a, b) = (run_interval(&[one], 0.2, 6).remove(0), run_interval(&[changed], 0.2, 6).remove(0));
            prop_assert_eq!(&a[..cut - 6], &b[..cut - 6]);
        }
    }
}
