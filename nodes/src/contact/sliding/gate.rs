//! Noise gates for sliding speeds, which silence vertices that hardly move.
//!
//! The paper silences a vertex whose speed never exceeds a threshold in the whole animation, which must be known in advance.
//! Two other gates need less. Comparisons are strict: a threshold of 0 still silences vertices that never move.

use crate::impl_state;
use serde::{Deserialize, Serialize};

/// Kind of gate, with its times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum GateMode {
    /// A vertex passes if its speed exceeds the threshold in any frame: the paper's rule, offline only.
    Ever,
    /// A run of contact passes if its own speed exceeds the threshold, from at most `max_hold` seconds before.
    Interval {
        /// Look-ahead, seconds; the default is 0.5.
        max_hold: f64,
    },
    /// Opens at the first speed above the threshold and closes after `hold` seconds of low speed; needs no look-ahead.
    Causal {
        /// Time of low speed, seconds; the default is 0.25.
        hold: f64,
    },
}

impl Default for GateMode {
    fn default() -> Self {
        Self::Interval { max_hold: 0.5 }
    }
}

impl GateMode {
    /// Returns the number of frames after frame i that its gated speed depends on; none if that is the whole animation.
    #[must_use]
    pub fn look_ahead(&self, frames_per_second: f64) -> Option<usize> {
        match self {
            Self::Ever => None,
            Self::Interval { max_hold } => Some(hold_frames(*max_hold, frames_per_second)),
            Self::Causal { .. } => Some(0),
        }
    }
}

/// Returns the look-ahead of [`IntervalGate`], `ceil(max_hold fps)` frames.
#[must_use]
pub fn hold_frames(max_hold: f64, frames_per_second: f64) -> usize {
    // 0.1 s at 30 frames per second is 3 frames, although the product in binary is slightly above 3.
    (max_hold * frames_per_second - 1e-9).ceil().max(0.0) as usize
}

/// The paper's gate: a first pass finds the maximum of each vertex, a second silences vertices whose maximum is not above the
/// threshold.
#[derive(Clone, Debug)]
pub struct EverGate {
    threshold: f32,
    maxima: Vec<f32>,
}
impl_state!(EverGate { maxima });

impl EverGate {
    /// A gate before its first pass.
    #[must_use]
    pub fn new(vertices: usize, threshold: f32) -> Self {
        Self { threshold, maxima: vec![0.0; vertices] }
    }

    /// A gate with the result of a first pass.
    #[must_use]
    pub fn from_maxima(maxima: Vec<f32>, threshold: f32) -> Self {
        Self { threshold, maxima }
    }

    /// Sets the threshold; the maxima do not depend on it.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.threshold = threshold;
    }

    /// First pass: updates the maxima by the speeds of a frame, one per vertex.
    pub fn observe(&mut self, speeds: &[f32]) {
        for (maximum, &speed) in self.maxima.iter_mut().zip(speeds) {
            *maximum = maximum.max(speed);
        }
    }

    /// Returns the largest speed of each vertex so far.
    #[must_use]
    pub fn maxima(&self) -> &[f32] {
        &self.maxima
    }

    /// Second pass: writes the speeds of a frame, 0 for silenced vertices.
    pub fn apply(&self, speeds: &[f32], out: &mut [f32]) {
        for ((out, &speed), &maximum) in out.iter_mut().zip(speeds).zip(&self.maxima) {
            *out = if maximum > self.threshold { speed } else { 0.0 };
        }
    }
}

/// A gate per run of contact, with a fixed look-ahead.
///
/// With look-ahead L, frame i of a vertex passes if and only if it is in contact and some frame j <= i + L of the same
/// unbroken run has a speed above the threshold. A run of at most L + 1 frames passes completely or not at all; a longer one
/// passes from L frames before its first fast frame. The gated frame i depends on the frames up to i + L only, not on the
/// windows in which they arrive.
///
/// # Shapes
/// A ring buffer of L + 1 frames of speeds, and 9 bytes per vertex.
#[derive(Clone, Debug)]
pub struct IntervalGate {
    threshold: f32,
    look_ahead: usize,
    vertices: usize,
    /// Speeds of the last L + 1 frames, frame n in row n mod (L + 1); negative without contact.
    ring: Vec<f32>,
    /// True for vertices whose run at the latest output frame passes.
    open: Vec<bool>,
    /// First frame not yet tested, of the run at the latest output frame.
    untested: Vec<u64>,
    pushed: u64,
    output: u64,
}
impl_state!(IntervalGate { ring, open, untested, pushed, output });

impl IntervalGate {
    /// A gate with a look-ahead in frames, as returned by [`hold_frames`].
    #[must_use]
    pub fn new(vertices: usize, threshold: f32, look_ahead: usize) -> Self {
        Self {
            threshold,
            look_ahead,
            vertices,
            ring: vec![-1.0; vertices * (look_ahead + 1)],
            open: vec![false; vertices],
            untested: vec![0; vertices],
            pushed: 0,
            output: 0,
        }
    }

    /// Sets the threshold: runs that pass stay open, the others are tested again.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.threshold = threshold;
        self.untested.fill(0);
    }

    /// Returns the number of frames between a frame's arrival and its output.
    #[must_use]
    pub fn look_ahead(&self) -> usize {
        self.look_ahead
    }

    /// Pushes a frame; writes the frame `look_ahead` before it to `out` and returns true if there is one.
    ///
    /// # Shapes
    /// One speed, one contact flag and one output per vertex; missing vertices count as without contact.
    ///
    /// # Complexity
    /// O(V) amortised. Never allocates.
    pub fn push(&mut self, speeds: &[f32], touching: &[bool], out: &mut [f32]) -> bool {
        let row = self.row(self.pushed);
        let ring = &mut self.ring[row..row + self.vertices];
        ring.fill(-1.0);
        for ((slot, &speed), &touches) in ring.iter_mut().zip(speeds).zip(touching) {
            if touches {
                *slot = speed.max(0.0);
            }
        }
        self.pushed += 1;
        self.pushed > self.look_ahead as u64 && self.write(out)
    }

    /// Writes the next delayed frame to `out` after the last one was pushed; returns false if there is none.
    pub fn finish(&mut self, out: &mut [f32]) -> bool {
        self.output < self.pushed && self.write(out)
    }

    fn row(&self, frame: u64) -> usize {
        (frame % (self.look_ahead as u64 + 1)) as usize * self.vertices
    }

    fn write(&mut self, out: &mut [f32]) -> bool {
        let frame = self.output;
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
        self.output += 1;
        true
    }

    /// Returns true if the run through `frame` exceeds the threshold from there to the newest frame.
    fn run_exceeds(&mut self, v: usize, frame: u64) -> bool {
        let mut next = self.untested[v].max(frame);
        while next < self.pushed {
            let speed = self.ring[self.row(next) + v];
            if speed > self.threshold {
                // `untested` is unchanged: the frames after this one are untested for later runs.
                return true;
            }
            if speed < 0.0 {
                break;
            }
            next += 1;
        }
        self.untested[v] = next;
        false
    }
}

/// A gate that opens at the first speed above the threshold, and closes after `hold` seconds without contact or below half of it.
///
/// # Shapes
/// 8 bytes per vertex.
#[derive(Clone, Debug)]
pub struct CausalGate {
    threshold: f32,
    hold: f64,
    /// Time of the last frame that held the gate open; minus infinity while it is closed.
    last_open: Vec<f64>,
}
impl_state!(CausalGate { last_open });

impl CausalGate {
    /// A closed gate; `hold` in seconds.
    #[must_use]
    pub fn new(vertices: usize, threshold: f32, hold: f64) -> Self {
        Self { threshold, hold, last_open: vec![f64::NEG_INFINITY; vertices] }
    }

    /// Sets the threshold.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.threshold = threshold;
    }

    /// Gates the frame at `time` seconds.
    ///
    /// # Shapes
    /// One speed, one contact flag and one output per vertex.
    ///
    /// # Complexity
    /// O(V). Never allocates.
    pub fn push(&mut self, time: f64, speeds: &[f32], touching: &[bool], out: &mut [f32]) {
        let half = 0.5 * self.threshold;
        let vertices = self.last_open.iter_mut().zip(out).zip(speeds.iter().zip(touching));
        for ((last_open, out), (&speed, &touches)) in vertices {
            let is_open = *last_open > f64::NEG_INFINITY;
            if touches && (speed > self.threshold || is_open && speed >= half) {
                *last_open = time;
            } else if is_open && time - *last_open >= self.hold - 1e-9 {
                *last_open = f64::NEG_INFINITY;
            }
            *out = if touches && *last_open > f64::NEG_INFINITY { speed } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests;
