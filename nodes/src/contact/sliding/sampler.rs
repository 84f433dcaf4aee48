//! Sliding speeds at any rate from contacts at the frame rate: gate and interpolation of a stream.

use super::gate::{CausalGate, EverGate, GateMode, IntervalGate, hold_frames};
use super::pchip::{OuterSamples, eval_linear, eval_uniform};
use super::stale_frames::{FrameStep, StaleFrames, StaleParams};
use crate::contact::item::Contact;
use crate::core::fault::Fault;
use crate::core::state::{StateArchive, Stateful};
use crate::core::time::Rate;
use crate::impl_state;
use serde::{Deserialize, Serialize};

/// Capacity of the ring buffer of gated speeds, frames: the four around a segment, and those that arrive before they are read.
const ROWS: u64 = 8;

/// Interpolation of speeds between frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Between {
    /// The shape-preserving cubic, which needs two frames ahead.
    #[default]
    Pchip,
    /// A straight line, which needs one frame ahead.
    Linear,
    /// The speed of the two frames around a time, which needs no frame ahead.
    Hold,
}

impl Between {
    /// Number of frames ahead that it needs.
    fn look_ahead(self) -> usize {
        match self {
            Self::Pchip => 2,
            Self::Linear => 1,
            Self::Hold => 0,
        }
    }
}

/// Time stamp of a forward difference from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stamp {
    /// Half-way between the frames, where the difference is exact to second order.
    #[default]
    Midpoint,
    /// At the first frame, half a frame early.
    Start,
}

/// Parameters of a [`SpeedSampler`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplerParams {
    /// Frames of contacts per second.
    pub frames: Rate,
    /// Speeds per second.
    pub rate: Rate,
    /// Threshold of the gate, m/s.
    pub threshold: f32,
    /// The gate.
    pub gate: GateMode,
    /// Interpolation between frames.
    pub between: Between,
    /// Time stamp of a difference.
    pub stamp: Stamp,
    /// Speeds while frames are late; none if the ages of frames are unknown.
    pub stale: Option<StaleParams>,
}

impl SamplerParams {
    /// Delay of the gate, frames.
    fn gate_delay(&self) -> usize {
        self.gate.look_ahead(self.frames.as_f64()).unwrap_or(0)
    }

    /// Returns the number of frames after those of a window that its speeds depend on, without the first pass of
    /// [`GateMode::Ever`].
    #[must_use]
    pub fn look_ahead(&self) -> usize {
        self.gate_delay() + self.between.look_ahead()
    }
}

/// Statistics of a [`SpeedSampler`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SpeedReport {
    /// Largest output speed, m/s.
    pub fastest: f32,
    /// Number of output speeds above 0.
    pub sliding: u64,
    /// Largest number of vertices that slide in one item.
    pub max_sliding: u64,
    /// Number of output items.
    pub items: u64,
    /// Number of input speeds above 0.
    pub moving: u64,
    /// Number of these that pass the gate.
    pub passed: u64,
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

/// Converts contacts, frame by frame, to speeds of each vertex at another rate.
///
/// The speed of a vertex is the slide of its fastest contact over the time between frames, gated, then interpolated. It is 0
/// before the first and after the last sample. The time between frames follows from their ages if known: see [`StaleFrames`].
///
/// # Shapes
/// Frames of `slots` contacts per vertex in, one speed per vertex out; a buffer of 8 frames of speeds, and those of the gate.
pub struct SpeedSampler {
    params: SamplerParams,
    slots: usize,
    vertices: usize,
    /// Number of frames that have a successor and so a speed; none for an endless stream.
    samples: Option<i64>,
    gate: Gate,
    speeds: Vec<f32>,
    touching: Vec<bool>,
    /// Ring buffer of gated speeds.
    rows: Vec<f32>,
    /// Gated frames so far.
    ready: i64,
    /// Pushed frames so far.
    pushed: i64,
    report: SpeedReport,
    stale: Option<StaleFrames>,
}
impl_state!(SpeedSampler { gate, rows, ready, pushed, report, each stale });

/// Largest slide of one vertex's contacts, metres; `None` without contact.
fn fastest_slide(slots: &[Contact]) -> Option<f32> {
    slots.iter().filter(|c| c.is_some()).map(|c| c.slide).reduce(f32::max)
}

impl SpeedSampler {
    /// A sampler before frame 0; `frames` is the number of frames, if known.
    #[must_use]
    pub fn new(params: SamplerParams, vertices: usize, slots: usize, frames: Option<i64>) -> Self {
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
            rows: vec![0.0; vertices * ROWS as usize],
            ready: 0,
            pushed: 0,
            report: SpeedReport::default(),
            stale: params.stale.map(|stale| StaleFrames::new(stale, 1.0 / params.frames.as_f64(), vertices)),
        }
    }

    /// Starts with frame `frame`, with speeds of 0 before it; to be called before the first frame is pushed.
    pub fn start_at(&mut self, frame: i64) {
        (self.pushed, self.ready) = (frame, frame);
        if let Some(stale) = &mut self.stale {
            stale.reset();
        }
    }

    /// Returns the index of the next frame to push.
    #[must_use]
    pub fn next_frame(&self) -> i64 {
        self.pushed
    }

    /// Sets the threshold for frames that are not gated yet.
    pub fn set_threshold(&mut self, threshold: f32) {
        self.params.threshold = threshold;
        match &mut self.gate {
            Gate::Ever(gate) => gate.set_threshold(threshold),
            Gate::Interval(gate) => gate.set_threshold(threshold),
            Gate::Causal(gate) => gate.set_threshold(threshold),
        }
    }

    /// Returns the statistics so far.
    #[must_use]
    pub fn report(&self) -> SpeedReport {
        self.report
    }

    /// First pass of [`GateMode::Ever`] over frame `frame`; no effect on other gates.
    pub fn observe(&mut self, frame: i64, contacts: &[Contact], ages: Option<[f32; 2]>) {
        self.measure(frame, contacts, ages);
        if let Gate::Ever(gate) = &mut self.gate {
            gate.observe(&self.speeds);
        }
    }

    /// Pushes the next frame; `ages`, if known, are those of the mesh in this frame and in the next, seconds.
    ///
    /// # Shapes
    /// `contacts: [V * slots]`.
    pub fn push(&mut self, contacts: &[Contact], ages: Option<[f32; 2]>) {
        let frame = self.pushed;
        self.measure(frame, contacts, ages);
        self.pushed += 1;
        let vertices = self.vertices;
        let row = self.ready.rem_euclid(ROWS as i64) as usize * vertices;
        let out = &mut self.rows[row..row + vertices];
        let has_output = match &mut self.gate {
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
        if has_output {
            self.report.passed += count(out);
            self.ready += 1;
        }
    }

    /// Computes speeds and contact flags of one frame; the last frame of a stream has neither.
    fn measure(&mut self, frame: i64, contacts: &[Contact], ages: Option<[f32; 2]>) {
        let valid = self.samples.is_none_or(|samples| frame < samples);
        let step = match (&mut self.stale, ages) {
            (Some(stale), Some(ages)) => stale.step(ages),
            _ => FrameStep::New(self.params.frames.as_f64()),
        };
        let vertices = self.speeds.iter_mut().zip(&mut self.touching);
        for (v, ((speed, touching), slots)) in
            vertices.zip(contacts.chunks_exact(self.slots.max(1))).enumerate()
        {
            let slide = fastest_slide(slots).filter(|_| valid);
            *touching = slide.is_some();
            let exact = match (slide, step, &self.stale) {
                (Some(slide), FrameStep::New(per_second), _) => f64::from(slide) * per_second,
                (Some(_), FrameStep::Repeated(factor), Some(stale)) => {
                    f64::from(stale.last_speeds()[v]) * factor
                }
                _ => 0.0,
            };
            *speed = exact.min(f64::from(f32::MAX)) as f32;
        }
        if let (Some(stale), FrameStep::New(_)) = (&mut self.stale, step) {
            stale.set_last_speeds(&self.speeds);
        }
    }

    /// Writes the speeds of output item `item`, or returns false while more frames are needed.
    ///
    /// Items are sampled in order. Push a frame only after this returned false, so that the buffer does not overflow.
    ///
    /// # Complexity
    /// O(V). Never allocates.
    pub fn sample(&mut self, item: i64, out: &mut [f32]) -> bool {
        let (segment, u) = self.position(item);
        let held = self.params.between == Between::Hold;
        if self.ready <= segment + self.params.between.look_ahead() as i64 {
            return false;
        }
        let exists = |k: i64| k >= 0 && self.samples.is_none_or(|samples| k < samples);
        if exists(segment) && (held || exists(segment + 1) || u == 0.0) {
            let row = |k: i64| {
                let start = k.rem_euclid(ROWS as i64) as usize * self.vertices;
                &self.rows[start..start + self.vertices]
            };
            let outer = OuterSamples { before: exists(segment - 1), after: exists(segment + 2) };
            match self.params.between {
                _ if u == 0.0 => out.copy_from_slice(row(segment)),
                Between::Pchip => {
                    eval_uniform([-1, 0, 1, 2].map(|k| row(segment + k)), outer, u, out);
                }
                Between::Linear => eval_linear(row(segment), row(segment + 1), u as f32, out),
                Between::Hold => out.copy_from_slice(row(segment)),
            }
        } else {
            out.fill(0.0);
        }
        self.report.items += 1;
        let sliding = out.iter().filter(|s| **s > 0.0).count() as u64;
        self.report.sliding += sliding;
        self.report.max_sliding = self.report.max_sliding.max(sliding);
        self.report.fastest = out.iter().copied().fold(self.report.fastest, f32::max);
        true
    }

    /// Sample before an item's time and position from there to the next, 0 to 1, computed in integers.
    fn position(&self, item: i64) -> (i64, f64) {
        let wide = |rate: Rate| (i128::from(rate.num()), i128::from(rate.den()));
        let ((frames, frames_den), (rate, rate_den)) = (wide(self.params.frames), wide(self.params.rate));
        let step = 2 * rate * frames_den;
        let early = self.params.stamp == Stamp::Start || self.params.between == Between::Hold;
        let half = if early { 0 } else { rate * frames_den };
        let time = 2 * i128::from(item) * rate_den * frames - half;
        (time.div_euclid(step) as i64, time.rem_euclid(step) as f64 / step as f64)
    }
}
