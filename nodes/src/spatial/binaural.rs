//! A head played over audio: one channel in, two ears out, while the source moves.

use super::head::{Ear, EarFilter, Head, PINNA_LEVELS, PINNA_LONGEST, SHOULDER_LONGEST};
use super::line::Line;
use crate::contact::vector::Vec3;
use crate::impl_state;
use serde::{Deserialize, Serialize};

/// Delay of the echo of the room after the sound, in s.
pub const ROOM_DELAY: f64 = 0.015;
/// Level of the echo of the room: -15 dB.
pub const ROOM_LEVEL: f64 = 0.177_827_941_003_892_3;
/// Most samples from one look at the direction to the next.
const BLOCK: u64 = 64;

/// Samples from one look at where things are to the next; in between all coefficients and delays move on straight lines.
///
/// 64 at 44.1 kHz and above; below that the same time in fewer samples.
#[must_use]
pub fn block(fs: f64) -> u64 {
    ((fs / (44_100.0 / BLOCK as f64)).round() as u64).clamp(1, BLOCK)
}

/// An ear's filter with delays in samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Coefficients {
    b0: f64,
    b1: f64,
    delay: f64,
    shoulder: f64,
    pinna: [f64; 5],
}

impl Coefficients {
    fn new(filter: &EarFilter, fs: f64, middle: f64, bias: f64) -> Self {
        let delay = middle + (filter.delay - bias) * fs;
        Self {
            b0: filter.shadow[0],
            b1: filter.shadow[1],
            delay,
            shoulder: delay + filter.shoulder * fs,
            pinna: filter.pinna.map(|t| 1.0 + t * fs),
        }
    }

    /// The part `t` of the way to another filter.
    #[inline]
    fn toward(&self, to: &Self, t: f64) -> Self {
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
    /// What reaches the pinna.
    line: Line,
}
impl_state!(EarState { from, to, u, y, line });

/// Plays mono sound to the two ears of a [`Head`] from a direction that may move.
///
/// The direction is asked for once per [`block`], and everything that follows from it moves on straight lines to the next, so a
/// source that circles the head makes no clicks. The output is [`lag`](Self::lag) samples late: the middle of the head hears the
/// sound exactly that much later, and a near ear earlier.
///
/// # Complexity
/// Per sample and ear one interpolated tap, and five more with a pinna; no allocation after `new`.
#[derive(Clone, Debug)]
pub struct Binaural {
    head: Head,
    fs: f64,
    /// Level of the echo of the room.
    room: f32,
    lag: usize,
    a1: f64,
    block: u64,
    input: Line,
    ears: [EarState; 2],
    begun: bool,
}
impl_state!(Binaural { input, each ears, begun });

impl Binaural {
    /// A silent renderer for a source in front, at `fs` hertz; `room` is the level of the echo of the room (0 for none).
    #[must_use]
    pub fn new(head: Head, room: f64, fs: f64) -> Self {
        let pinna = usize::from(head.pinna.is_some());
        let lag = (head.bias() * fs).ceil() as usize + 1 + pinna;
        let longest = head.longest() + SHOULDER_LONGEST + ROOM_DELAY;
        let mut this = Self {
            head,
            fs,
            room: room as f32,
            lag,
            a1: head.shadow(0.0, fs)[2],
            block: block(fs),
            input: Line::new(lag as f64 + longest * fs),
            ears: [Ear::Left, Ear::Right].map(|ear| {
                let front = Self::coefficients(&head, fs, lag - pinna, ear, [1.0, 0.0, 0.0]);
                EarState { from: front, to: front, u: 0.0, y: 0.0, line: Line::new(PINNA_LONGEST * fs + 1.0) }
            }),
            begun: false,
        };
        this.reset();
        this
    }

    fn coefficients(head: &Head, fs: f64, middle: usize, ear: Ear, direction: Vec3) -> Coefficients {
        Coefficients::new(&head.ear(ear, direction, fs), fs, middle as f64, head.bias())
    }

    /// Samples by which the output is late at the middle of the head.
    #[must_use]
    pub fn lag(&self) -> usize {
        self.lag
    }

    /// Back to silence; the next direction is taken without a way to it.
    pub fn reset(&mut self) {
        self.begun = false;
    }

    /// Adds samples to the line without any output.
    pub fn feed(&mut self, input: &[f32]) {
        input.iter().for_each(|x| self.input.push(*x));
    }

    fn aim(&mut self, direction: Vec3) {
        let middle = self.lag - usize::from(self.head.pinna.is_some());
        for (state, ear) in self.ears.iter_mut().zip([Ear::Left, Ear::Right]) {
            let to = Self::coefficients(&self.head, self.fs, middle, ear, direction);
            state.from = if self.begun { state.to } else { to };
            state.to = to;
        }
        self.begun = true;
    }

    /// Renders samples from number `first` of the signal on; `direction` gives where the source is (any length, own axes of
    /// the head) at the sample that it is asked for.
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
            let place = n % self.block;
            if place == 0 || !self.begun {
                self.aim(direction(n));
            }
            self.input.push(*x);
            *out = self.step((place + 1) as f64 / self.block as f64);
        }
    }

    /// One sample of both ears, a part `t` of the way through the block.
    fn step(&mut self, t: f64) -> [f32; 2] {
        let room = if self.room > 0.0 {
            self.room * self.input.read(self.lag as f64 + ROOM_DELAY * self.fs)
        } else {
            0.0
        };
        let (input, head, a1) = (&self.input, &self.head, self.a1);
        let [left, right] = &mut self.ears;
        [left, right].map(|ear| {
            let now = if ear.from == ear.to { ear.to } else { ear.from.toward(&ear.to, t) };
            let u = f64::from(input.read(now.delay));
            ear.y = now.b0 * u + now.b1 * ear.u - a1 * ear.y;
            ear.u = u;
            let mut y = ear.y as f32;
            if head.shoulder > 0.0 {
                y += head.shoulder as f32 * input.read(now.shoulder);
            }
            if head.pinna.is_some() {
                ear.line.push(y);
                y = ear.line.whole(1);
                for (level, delay) in PINNA_LEVELS.iter().zip(now.pinna) {
                    y += *level as f32 * ear.line.read(delay);
                }
            }
            y + room
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::head::PinnaSet;
    use super::*;

    fn impulse(head: Head, room: f64, fs: f64, direction: Vec3) -> ([Vec<f64>; 2], usize) {
        let mut binaural = Binaural::new(head, room, fs);
        let len = (0.04 * fs) as usize;
        let mut x = vec![0.0; len];
        x[0] = 1.0;
        let mut out = vec![0.0; 2 * len];
        binaural.process(0, &x, &mut out, |_| direction);
        let ear = |k: usize| out.iter().skip(k).step_by(2).map(|x| f64::from(*x)).collect();
        ([ear(0), ear(1)], binaural.lag())
    }

    fn side(azimuth: f64) -> Vec3 {
        let a = f64::to_radians(azimuth);
        [a.cos(), -a.sin(), 0.1]
    }

    /// Group delay at DC in s: the first moment of the impulse response.
    fn moment(h: &[f64], lag: usize, fs: f64) -> f64 {
        let sum: f64 = h.iter().sum();
        (h.iter().enumerate().map(|(n, x)| n as f64 * x).sum::<f64>() / sum - lag as f64) / fs
    }

    #[test]
    fn delays_are_the_same_in_seconds_at_every_rate() {
        for pinna in [None, Some(PinnaSet::Set0)] {
            let head = Head { pinna, ..Head::default() };
            for azimuth in [0.0, 30.0, -75.0, 160.0] {
                let expected = [Ear::Left, Ear::Right].map(|ear| {
                    let f = head.ear(ear, side(azimuth), 48_000.0);
                    let gain = head.high_gain(head.incidence(ear, side(azimuth)));
                    let echoes: f64 = PINNA_LEVELS.iter().zip(f.pinna).map(|(r, t)| r * t).sum();
                    f.delay - head.bias() + (1.0 - gain) * head.bias() / 2.0 + echoes
                });
                for fs in [44_100.0, 48_000.0, 96_000.0] {
                    let (ears, lag) = impulse(head, 0.0, fs, side(azimuth));
                    for (h, expected) in ears.iter().zip(expected) {
                        let found = moment(h, lag, fs);
                        assert!((found - expected).abs() < 1e-6, "{azimuth} {fs}: {found} {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn mirrored_sources_swap_the_ears_bit_for_bit_and_the_front_is_the_same_in_both() {
        let head = Head { pinna: Some(PinnaSet::Set1), shoulder: 0.2, ..Head::default() };
        let mirrored = |d: Vec3| [d[0], -d[1], d[2]];
        for azimuth in [10.0, 47.0, 95.0, 170.0] {
            let ([left, right], _) = impulse(head, ROOM_LEVEL, 48_000.0, side(azimuth));
            let ([other_left, other_right], _) = impulse(head, ROOM_LEVEL, 48_000.0, mirrored(side(azimuth)));
            assert!(left == other_right && right == other_left);
            assert!(left != right);
        }
        let ([left, right], _) = impulse(head, ROOM_LEVEL, 48_000.0, [1.0, 0.0, 0.0]);
        assert_eq!(left, right);
    }

    #[test]
    fn the_spectrum_is_that_of_the_model_within_the_interpolation() {
        let (fs, direction) = (48_000.0, side(40.0));
        let head = Head { pinna: Some(PinnaSet::Set0), shoulder: 0.2, ..Head::default() };
        let (ears, lag) = impulse(head, 0.0, fs, direction);
        for (h, ear) in ears.iter().zip([Ear::Left, Ear::Right]) {
            let filter = head.ear(ear, direction, fs);
            for f in [100.0, 1000.0, 3000.0, 6000.0] {
                let found = h.iter().enumerate().fold([0.0; 2], |sum, (n, x)| {
                    let a = 2.0 * PI * f * (n as f64 - lag as f64) / fs;
                    [sum[0] + x * a.cos(), sum[1] - x * a.sin()]
                });
                let [re, im] = head.response(&filter, f, fs);
                let error = (found[0] - re).hypot(found[1] - im) / re.hypot(im);
                assert!(error < 0.02, "{f}: {found:?} {re} {im}");
            }
        }
    }

    #[test]
    fn the_echo_of_the_room_comes_15_ms_later_to_both_ears() {
        let ([left, right], lag) = impulse(Head::default(), ROOM_LEVEL, 48_000.0, side(30.0));
        let at = lag + 720;
        for ear in [left, right] {
            assert!((ear[at] - ROOM_LEVEL).abs() < 1e-6);
        }
    }

    /// Circles the head once per second and looks at what is left beside the tone: clicks are broad.
    #[test]
    fn a_source_that_circles_the_head_in_one_second_makes_no_clicks() {
        let (fs, tone) = (48_000.0, 1000.0);
        let x: Vec<f32> = (0..96_000).map(|n| (2.0 * PI * tone * f64::from(n) / fs).sin() as f32).collect();
        for pinna in [None, Some(PinnaSet::Set0)] {
            let head = Head { pinna, ..Head::default() };
            let mut binaural = Binaural::new(head, 0.0, fs);
            let mut out = vec![0.0; 2 * x.len()];
            binaural.process(0, &x, &mut out, |n| {
                let a = 2.0 * PI * n as f64 / fs;
                [a.cos(), a.sin(), 0.0]
            });
            for ear in 0..2 {
                // A high-pass that is far above the tone: six differences.
                let mut y: Vec<f64> = out.iter().skip(ear).step_by(2).map(|x| f64::from(*x)).collect();
                for _ in 0..6 {
                    y = y.windows(2).map(|w| w[1] - w[0]).collect();
                }
                // A step of size s appears in them with 10 s, the tone with its level times (2 sin(pi f / fs))^6 = 5e-6.
                let worst = y[2000..].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                assert!(worst / 10.0 < 1e-3, "{pinna:?}, ear {ear}: {worst}");
            }
        }
    }

    #[test]
    fn windows_of_any_length_give_the_same_bits() {
        let head = Head { pinna: Some(PinnaSet::Set0), ..Head::default() };
        let x: Vec<f32> = (0..1000).map(|n| ((n * n) as f32 * 0.37).sin()).collect();
        let way = |n: u64| side(n as f64 * 0.1);
        let run = |len: usize| {
            let mut binaural = Binaural::new(head, ROOM_LEVEL, 44_100.0);
            let mut out = vec![0.0; 2 * x.len()];
            let mut first = 0;
            for (x, out) in x.chunks(len).zip(out.chunks_mut(2 * len)) {
                binaural.process(first, x, out, way);
                first += x.len() as u64;
            }
            out
        };
        let whole = run(1000);
        assert!([1, 7, 63, 64, 65].into_iter().all(|len| run(len) == whole));
    }
}
