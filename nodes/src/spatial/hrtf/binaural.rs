//! Binaural rendering of a moving source by the structural head model.

use super::head::{Ear, EarFilter, Head, PINNA_LEVELS, PINNA_MAX_DELAY, SHOULDER_MAX_DELAY};
use crate::contact::vector::Vec3;
use crate::impl_state;
use crate::spatial::propagation::control_interval::control_interval;
use crate::spatial::propagation::fractional_delay::FractionalDelayLine;
use serde::{Deserialize, Serialize};

/// Delay of the room echo after the sound, in s.
pub const ROOM_DELAY: f64 = 0.015;
/// Level of the room echo: -15 dB.
pub const ROOM_LEVEL: f64 = 0.177_827_941_003_892_3;

/// The filter of an ear with delays in samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Coefficients {
    b0: f64,
    b1: f64,
    delay: f64,
    shoulder: f64,
    pinna: [f64; 5],
}

impl Coefficients {
    fn new(filter: &EarFilter, fs: f64, centre: f64, centre_delay: f64) -> Self {
        let delay = centre + (filter.delay - centre_delay) * fs;
        Self {
            b0: filter.shadow[0],
            b1: filter.shadow[1],
            delay,
            shoulder: delay + filter.shoulder * fs,
            pinna: filter.pinna.map(|t| 1.0 + t * fs),
        }
    }

    /// Interpolates linearly to another filter, at `t` from 0 to 1.
    #[inline]
    fn interpolate(&self, to: &Self, t: f64) -> Self {
        let mix = |a: f64, b: f64| a + t * (b - a);
        Self {
            b0: mix(self.b0, to.b0),
            b1: mix(self.b1, to.b1),
            delay: mix(self.delay, to.delay),
            shoulder: mix(self.shoulder, to.shoulder),
            pinna: std::array::from_fn(|k| mix(self.pinna[k], to.pinna[k])),
        }
    }
}

#[derive(Clone, Debug)]
struct EarState {
    from: Coefficients,
    to: Coefficients,
    /// Last input and output of the shadow.
    u: f64,
    y: f64,
    /// Input of the pinna reflections.
    line: FractionalDelayLine,
}
impl_state!(EarState { from, to, u, y, line });

/// Renders mono sound from a changing direction at the two ears of a [`Head`].
///
/// The direction is read once per [`control_interval`]. All coefficients change linearly in between, so a source that circles the head
/// makes no clicks. The output is [`lag`](Self::lag) samples late at the centre of the head; the near ear is earlier.
///
/// # Complexity
/// One interpolated tap per sample and ear, and five more with a pinna; no allocation after `new`.
#[derive(Clone, Debug)]
pub struct Binaural {
    head: Head,
    fs: f64,
    /// Level of the room echo.
    room: f32,
    lag: usize,
    a1: f64,
    interval: u64,
    input: FractionalDelayLine,
    ears: [EarState; 2],
    started: bool,
}
impl_state!(Binaural { input, each ears, started });

impl Binaural {
    /// Creates a silent renderer for a source in front, at `fs` hertz. `room` is the level of the room echo; 0 for none.
    #[must_use]
    pub fn new(head: Head, room: f64, fs: f64) -> Self {
        let pinna = usize::from(head.pinna.is_some());
        let lag = (head.centre_delay() * fs).ceil() as usize + 1 + pinna;
        let max_delay = head.max_delay() + SHOULDER_MAX_DELAY + ROOM_DELAY;
        let mut this = Self {
            head,
            fs,
            room: room as f32,
            lag,
            a1: head.shadow(0.0, fs)[2],
            interval: control_interval(fs),
            input: FractionalDelayLine::new(lag as f64 + max_delay * fs),
            ears: [Ear::Left, Ear::Right].map(|ear| {
                let front = Self::coefficients(&head, fs, lag - pinna, ear, [1.0, 0.0, 0.0]);
                EarState {
                    from: front,
                    to: front,
                    u: 0.0,
                    y: 0.0,
                    line: FractionalDelayLine::new(PINNA_MAX_DELAY * fs + 1.0),
                }
            }),
            started: false,
        };
        this.reset();
        this
    }

    fn coefficients(head: &Head, fs: f64, centre: usize, ear: Ear, direction: Vec3) -> Coefficients {
        Coefficients::new(&head.ear(ear, direction, fs), fs, centre as f64, head.centre_delay())
    }

    /// Returns the number of samples by which the output is late at the centre of the head.
    #[must_use]
    pub fn lag(&self) -> usize {
        self.lag
    }

    /// Restarts the interpolation: the next direction applies at once.
    pub fn reset(&mut self) {
        self.started = false;
    }

    /// Appends input samples without output.
    pub fn feed(&mut self, input: &[f32]) {
        input.iter().for_each(|x| self.input.push(*x));
    }

    fn update(&mut self, direction: Vec3) {
        let centre = self.lag - usize::from(self.head.pinna.is_some());
        for (state, ear) in self.ears.iter_mut().zip([Ear::Left, Ear::Right]) {
            let to = Self::coefficients(&self.head, self.fs, centre, ear, direction);
            state.from = if self.started { state.to } else { to };
            state.to = to;
        }
        self.started = true;
    }

    /// Renders samples from index `first` on. `direction` returns the direction of the source (of any length, in local axes of the head)
    /// at a sample.
    ///
    /// # Shapes
    /// `input: [T]`, `out: [2 T]`, left and right interleaved.
    pub fn process(
        &mut self,
        first: u64,
        input: &[f32],
        out: &mut [f32],
        mut direction: impl FnMut(u64) -> Vec3,
    ) {
        for ((n, x), out) in (first..).zip(input).zip(out.as_chunks_mut::<2>().0) {
            let offset = n % self.interval;
            if offset == 0 || !self.started {
                self.update(direction(n));
            }
            self.input.push(*x);
            *out = self.step((offset + 1) as f64 / self.interval as f64);
        }
    }

    /// Renders one sample of both ears at a fraction `t` of the control interval.
    fn step(&mut self, t: f64) -> [f32; 2] {
        let room = if self.room > 0.0 {
            self.room * self.input.read(self.lag as f64 + ROOM_DELAY * self.fs)
        } else {
            0.0
        };
        let (input, head, a1) = (&self.input, &self.head, self.a1);
        let [left, right] = &mut self.ears;
        [left, right].map(|ear| {
            let filter = if ear.from == ear.to { ear.to } else { ear.from.interpolate(&ear.to, t) };
            let u = f64::from(input.read(filter.delay));
            ear.y = filter.b0 * u + filter.b1 * ear.u - a1 * ear.y;
            ear.u = u;
            let mut y = ear.y as f32;
            if head.shoulder > 0.0 {
                y += head.shoulder as f32 * input.read(filter.shoulder);
            }
            if head.pinna.is_some() {
                ear.line.push(y);
                y = ear.line.sample(1);
                for (level, delay) in PINNA_LEVELS.iter().zip(filter.pinna) {
                    y += *level as f32 * ear.line.read(delay);
                }
            }
            y + room
        })
    }
}

#[cfg(test)]
mod tests;
