//! Sliding speeds on a grid of their own, from contacts frame by frame: gate and spline joined into a stream.

use super::Contact;
use super::gate::{CausalGate, EverGate, GateMode, IntervalGate, hold_frames};
use super::late::{Late, LateParams, Step};
use super::spline::{Neighbours, eval_linear, eval_uniform};
use crate::core::fault::Fault;
use crate::core::state::{StateArchive, Stateful};
use crate::core::time::Rate;
use crate::impl_state;
use serde::{Deserialize, Serialize};

/// Frames of gated speeds that are kept: the four around a piece, and those that arrive before a window asks.
const KEPT: u64 = 8;

/// How speeds between frames are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Between {
    /// The shape-preserving cubic, which needs two frames ahead.
    #[default]
    Pchip,
    /// A straight line, which needs one frame ahead.
    Linear,
    /// The speed of the two frames between which a moment lies, which needs no frame ahead.
    Hold,
}

impl Between {
    /// Frames ahead that it needs.
    fn ahead(self) -> usize {
        match self {
            Self::Pchip => 2,
            Self::Linear => 1,
            Self::Hold => 0,
        }
    }
}

/// When a forward difference from frame to frame holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stamp {
    /// Half-way between the frames, where it is exact to second order.
    #[default]
    Midpoint,
    /// At the first of them: half a frame early.
    Start,
}

/// What a [`Sliding`] is made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlidingParams {
    /// Frames of contacts per second.
    pub frames: Rate,
    /// Speeds per second.
    pub rate: Rate,
    /// Speed that a vertex has to exceed to be heard, m/s.
    pub threshold: f32,
    /// The gate.
    pub gate: GateMode,
    /// How speeds between frames are found.
    pub between: Between,
    /// When a difference holds.
    pub stamp: Stamp,
    /// What happens while frames are late, where their ages are known.
    pub late: Option<LateParams>,
}

impl SlidingParams {
    /// Frames by which the gate's output is behind its input.
    fn gate_delay(&self) -> usize {
        self.gate.look_ahead(self.frames.as_f64()).unwrap_or(0)
    }

    /// Frames after those of a window that its speeds depend on, the first pass of [`GateMode::Ever`] left aside.
    #[must_use]
    pub fn ahead(&self) -> usize {
        self.gate_delay() + self.between.ahead()
    }
}

/// What a [`Sliding`] has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SlidingReport {
    /// Greatest speed given out, m/s.
    pub fastest: f32,
    /// Speeds above 0 given out.
    pub sliding: u64,
    /// Most vertices that slide at a time.
    pub most: u64,
    /// Items given out.
    pub items: u64,
    /// Vertex frames that move along what they touch.
    pub moving: u64,
    /// Of these, let through by the gate.
    pub heard: u64,
}

enum Gate {
    Ever(EverGate),
    Interval(IntervalGate),
    Causal(CausalGate),
}

impl Stateful for Gate {
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        match self {
            Self::Ever(gate) => gate.archive_state(archive),
            Self::Interval(gate) => gate.archive_state(archive),
            Self::Causal(gate) => gate.archive_state(archive),
        }
    }
}

/// Turns contacts, frame after frame, into the speeds of each vertex at any later grid of times.
///
/// Speeds are slides over the time of a frame, of the fastest contact of a vertex, gated, then interpolated. Before the
/// first and after the last sample nothing slides. Where the ages of frames are known they tell that time: see [`Late`].
///
/// # Shapes
/// Frames of `slots` contacts per vertex in, one speed per vertex out; 8 frames of speeds are kept, and those of the gate.
pub struct Sliding {
    params: SlidingParams,
    slots: usize,
    vertices: usize,
    /// Frames that have a successor and so a speed; none known for an endless stream.
    samples: Option<i64>,
    gate: Gate,
    speeds: Vec<f32>,
    touching: Vec<bool>,
    rows: Vec<f32>,
    /// Gated frames in `rows` so far.
    ready: i64,
    /// Frames taken so far.
    taken: i64,
    report: SlidingReport,
    late: Option<Late>,
}
impl_state!(Sliding { gate, rows, ready, taken, report, each late });

/// The fastest slide of one vertex's contacts, metres; `None` where it touches nothing.
fn fastest_slide(slots: &[Contact]) -> Option<f32> {
    slots.iter().filter(|c| c.is_some()).map(|c| c.slide).reduce(f32::max)
}

impl Sliding {
    /// Ready for frame 0; `frames` is how many there will be, where that is known.
    #[must_use]
    pub fn new(params: SlidingParams, vertices: usize, slots: usize, frames: Option<i64>) -> Self {
        let threshold = params.threshold;
        let gate = match params.gate {
            GateMode::Ever => Gate::Ever(EverGate::new(vertices, threshold)),
            GateMode::Interval { max_hold } => {
                let ahead = hold_frames(max_hold, params.frames.as_f64());
                Gate::Interval(IntervalGate::new(vertices, threshold, ahead))
            }
            GateMode::Causal { hold } => Gate::Causal(CausalGate::new(vertices, threshold, hold)),
        };
        Self {
            params,
            slots,
            vertices,
            samples: frames.map(|n| (n - 1).max(0)),
            gate,
            speeds: vec![0.0; vertices],
            touching: vec![false; vertices],
            rows: vec![0.0; vertices * KEPT as usize],
            ready: 0,
            taken: 0,
            report: SlidingReport::default(),
            late: params.late.map(|late| Late::new(late, 1.0 / params.frames.as_f64(), vertices)),
        }
    }

    /// Begins with frame `frame`, as if nothing had slid before it; only before the first frame is taken.
    pub fn begin_at(&mut self, frame: i64) {
        (self.taken, self.ready) = (frame, frame);
        if let Some(late) = &mut self.late {
            late.reset();
        }
    }

    /// Number of the frame to be taken next.
    #[must_use]
    pub fn next_frame(&self) -> i64 {
        self.taken
    }

    /// Gates the frames that are still to be gated with another threshold.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.params.threshold = threshold;
        match &mut self.gate {
            Gate::Ever(gate) => gate.set_threshold(threshold),
            Gate::Interval(gate) => gate.set_threshold(threshold),
            Gate::Causal(gate) => gate.set_threshold(threshold),
        }
    }

    /// What was seen so far.
    #[must_use]
    pub fn report(&self) -> SlidingReport {
        self.report
    }

    /// First pass of [`GateMode::Ever`] over frame `frame`; nothing for other gates.
    pub fn observe(&mut self, frame: i64, contacts: &[Contact], ages: Option<[f32; 2]>) {
        self.measure(frame, contacts, ages);
        if let Gate::Ever(gate) = &mut self.gate {
            gate.observe(&self.speeds);
        }
    }

    /// Takes the next frame; `ages`, where they are known, are those of the mesh in it and in the one after it, seconds.
    ///
    /// # Shapes
    /// `contacts: [V * slots]`.
    pub fn take(&mut self, contacts: &[Contact], ages: Option<[f32; 2]>) {
        let frame = self.taken;
        self.measure(frame, contacts, ages);
        self.taken += 1;
        let vertices = self.vertices;
        let row = self.ready.rem_euclid(KEPT as i64) as usize * vertices;
        let out = &mut self.rows[row..row + vertices];
        let gives = match &mut self.gate {
            Gate::Ever(gate) => {
                gate.apply(&self.speeds, out);
                true
            }
            Gate::Interval(gate) => gate.push(&self.speeds, &self.touching, out),
            Gate::Causal(gate) => {
                let time = frame as f64 / self.params.frames.as_f64();
                gate.push(time, &self.speeds, &self.touching, out);
                true
            }
        };
        let count = |speeds: &[f32]| speeds.iter().filter(|s| **s > 0.0).count() as u64;
        self.report.moving += count(&self.speeds);
        if gives {
            self.report.heard += count(out);
            self.ready += 1;
        }
    }

    /// Speeds and touch of one frame; the last frame of a stream has neither.
    fn measure(&mut self, frame: i64, contacts: &[Contact], ages: Option<[f32; 2]>) {
        let valid = self.samples.is_none_or(|samples| frame < samples);
        let step = match (&mut self.late, ages) {
            (Some(late), Some(ages)) => late.step(ages),
            _ => Step::Frame(self.params.frames.as_f64()),
        };
        let vertices = self.speeds.iter_mut().zip(&mut self.touching);
        for (v, ((speed, touching), slots)) in
            vertices.zip(contacts.chunks_exact(self.slots.max(1))).enumerate()
        {
            let slide = fastest_slide(slots).filter(|_| valid);
            *touching = slide.is_some();
            let found = match (slide, step, &self.late) {
                (Some(slide), Step::Frame(per_second), _) => f64::from(slide) * per_second,
                (Some(_), Step::Again(left), Some(late)) => f64::from(late.kept()[v]) * left,
                _ => 0.0,
            };
            *speed = found.min(f64::from(f32::MAX)) as f32;
        }
        if let (Some(late), Step::Frame(_)) = (&mut self.late, step) {
            late.keep(&self.speeds);
        }
    }

    /// Writes the speeds of item `item` of the output, or returns false while more frames are needed.
    ///
    /// Items are asked for in order; one frame too many is never taken as long as `take` stops where this says true.
    ///
    /// # Complexity
    /// O(V). Never allocates.
    pub fn give(&mut self, item: i64, out: &mut [f32]) -> bool {
        let (piece, u) = self.place(item);
        let held = self.params.between == Between::Hold;
        if self.ready <= piece + self.params.between.ahead() as i64 {
            return false;
        }
        let exists = |k: i64| k >= 0 && self.samples.is_none_or(|samples| k < samples);
        if exists(piece) && (held || exists(piece + 1) || u == 0.0) {
            let row = |k: i64| {
                let at = k.rem_euclid(KEPT as i64) as usize * self.vertices;
                &self.rows[at..at + self.vertices]
            };
            let neighbours = Neighbours { before: exists(piece - 1), after: exists(piece + 2) };
            match self.params.between {
                _ if u == 0.0 => out.copy_from_slice(row(piece)),
                Between::Pchip => {
                    eval_uniform([-1, 0, 1, 2].map(|k| row(piece + k)), neighbours, u, out);
                }
                Between::Linear => eval_linear(row(piece), row(piece + 1), u as f32, out),
                Between::Hold => out.copy_from_slice(row(piece)),
            }
        } else {
            out.fill(0.0);
        }
        self.report.items += 1;
        let sliding = out.iter().filter(|s| **s > 0.0).count() as u64;
        self.report.sliding += sliding;
        self.report.most = self.report.most.max(sliding);
        self.report.fastest = out.iter().copied().fold(self.report.fastest, f32::max);
        true
    }

    /// The sample before an item's time, and the way from there to the next, computed without rounding.
    fn place(&self, item: i64) -> (i64, f64) {
        let wide = |rate: Rate| (i128::from(rate.num()), i128::from(rate.den()));
        let ((frames, frames_den), (rate, rate_den)) = (wide(self.params.frames), wide(self.params.rate));
        let step = 2 * rate * frames_den;
        let early = self.params.stamp == Stamp::Start || self.params.between == Between::Hold;
        let half = if early { 0 } else { rate * frames_den };
        let at = 2 * i128::from(item) * rate_den * frames - half;
        (at.div_euclid(step) as i64, at.rem_euclid(step) as f64 / step as f64)
    }
}
