//! Transients of one sound on another.

use super::gain::check_control;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{In, Stream};
use crate::core::shape::{Build, Shape};
use crate::{archive_state, impl_state, params, ports};

params! {
    /// Gives a sound the transients of another, so that its onsets are as sharp and as early as those of the other.
    ///
    /// The gain of a sample is the ratio of the crest of the target to that of the sound, at most `limit` in either direction. The
    /// crest is the level in a short window over the level in a long window around it. Slow changes of level are left as they
    /// are. Features of units are smoothed over time, which smears onsets; this puts them back.
    ///
    /// With a target of one channel all channels follow it; otherwise each follows its own.
    ///
    /// # Source
    /// An addition to An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012).
    pub struct TransientTransferParams {
        /// Half the length of the triangular window of the fast envelope.
        fast: f64 = 0.0015, unit "s", range 0.0001..=0.1;
        /// Half the length of the triangular window of the slow envelope; longer than `fast`.
        slow: f64 = 0.02, unit "s", range 0.0002..=1.0;
        /// Greatest gain and attenuation; 0 leaves the sound as it is.
        limit: f64 = 6.0, unit "dB", range 0.0..=60.0;
    }
}
ports! {
    pub struct TransientTransferPorts / TransientTransferIo {
        in {
            /// The sound.
            audio: Stream<f32>,
            /// The sound with the transients.
            target: Stream<f32>,
        }
        out {
            /// The sound with those transients.
            out: Stream<f32>,
        }
    }
}

/// Power below which a sound is silent: it has no transients.
const SILENT: f64 = 1e-10;

/// Moving sum of the last samples.
#[derive(Clone, Debug)]
struct Box1 {
    last: Vec<f64>,
    at: usize,
    sum: f64,
}
impl_state!(Box1 { last, at, sum });

impl Box1 {
    fn new(length: usize) -> Self {
        Self { last: vec![0.0; length], at: 0, sum: 0.0 }
    }

    fn next(&mut self, x: f64) -> f64 {
        let oldest = std::mem::replace(&mut self.last[self.at], x);
        self.at = (self.at + 1) % self.last.len();
        // Rounding may leave a sum of nothing below 0.
        self.sum = (self.sum + x - oldest).max(0.0);
        self.sum
    }
}

/// Mean square in a triangular window: two moving sums.
#[derive(Clone, Debug)]
struct Power {
    first: Box1,
    second: Box1,
    /// The next sample to read, once the first was read.
    next: Option<i64>,
    value: f64,
}
impl_state!(Power { first, second, next, value });

impl Power {
    fn new(half: usize) -> Self {
        Self { first: Box1::new(half), second: Box1::new(half), next: None, value: 0.0 }
    }

    /// Samples after the centre of the window.
    fn ahead(&self) -> i64 {
        self.first.last.len() as i64 - 1
    }

    /// The mean square around sample `n`.
    fn around(&mut self, n: i64, sound: impl Fn(i64) -> f32) -> f64 {
        let scale = (self.first.last.len() as f64).powi(-2);
        for k in self.next.unwrap_or(n)..=n + self.ahead() {
            let x = f64::from(sound(k));
            self.value = self.second.next(self.first.next(x * x)) * scale;
        }
        self.next = Some(n + self.ahead() + 1);
        self.value
    }
}

/// Fast over slow envelope of one channel.
#[derive(Clone, Debug)]
struct Crest {
    fast: Power,
    slow: Power,
}
impl_state!(Crest { fast, slow });

impl Crest {
    fn new(fast: usize, slow: usize) -> Self {
        Self { fast: Power::new(fast), slow: Power::new(slow) }
    }

    /// Ratio of the powers around sample `n`; 1 in silence.
    fn at(&mut self, n: i64, sound: impl Fn(i64) -> f32 + Copy) -> f64 {
        (self.fast.around(n, sound) + SILENT) / (self.slow.around(n, sound) + SILENT)
    }
}

/// Half lengths of both windows, in samples.
fn windows(p: &TransientTransferParams, rate: f64) -> [usize; 2] {
    [p.fast, p.slow].map(|seconds| ((seconds * rate).round() as usize).max(1))
}

/// The node `TransientTransfer`.
pub struct TransientTransfer {
    sound: Vec<Crest>,
    target: Vec<Crest>,
    /// Crests of the channels of the target, of one sample.
    wanted: Vec<f64>,
    limit: f64,
    /// Mean square of the gain in dB, over all samples.
    square: f64,
    samples: u64,
}

/// Sample `n` of a channel.
fn sample(sound: &In<'_, f32>, channel: usize, n: i64) -> f32 {
    sound.item((n - sound.first()) as isize).get(channel).copied().unwrap_or(0.0)
}

impl Node for TransientTransfer {
    type Params = TransientTransferParams;
    type Ports = TransientTransferPorts;
    const NAME: &'static str = "TransientTransfer";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 25.0;

    fn shape(
        p: &TransientTransferParams,
        s: &mut Shape<'_, '_, TransientTransferPorts>,
    ) -> Result<(), Reject> {
        let (audio, target) =
            (s.input(TransientTransferPorts::audio), s.input(TransientTransferPorts::target));
        s.check(check_control("target", &audio, &target));
        let [fast, slow] = windows(p, audio.rate.as_f64());
        if fast >= slow {
            let message = format!("`fast` is {} s, `slow` {} s", p.fast, p.slow);
            s.wrong(Reject::new("F051", message).at("fast").help("it must be shorter"));
        }
        s.lookaround(TransientTransferPorts::audio, 0, slow - 1);
        s.lookaround(TransientTransferPorts::target, 0, slow - 1);
        s.ends(audio.end);
        s.output(TransientTransferPorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &TransientTransferParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(TransientTransferPorts::audio);
        let [fast, slow] = windows(p, audio.rate.as_f64());
        let crests = |channels: u16| vec![Crest::new(fast, slow); channels.into()];
        let target = cx.input(TransientTransferPorts::target).format.0;
        Ok(Self {
            sound: crests(audio.format.0),
            target: crests(target),
            wanted: vec![0.0; target.into()],
            limit: 10f64.powf(p.limit / 10.0),
            square: 0.0,
            samples: 0,
        })
    }

    fn run(&mut self, mut io: TransientTransferIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.out.first(), io.out.width().max(1));
        let (audio, target) = (&io.audio, &io.target);
        for (n, frame) in (first..).zip(io.out.items().chunks_exact_mut(width)) {
            for (c, (crest, state)) in self.wanted.iter_mut().zip(&mut self.target).enumerate() {
                *crest = state.at(n, |k| sample(target, c, k));
            }
            for (c, (out, state)) in frame.iter_mut().zip(&mut self.sound).enumerate() {
                let wanted = self.wanted.get(c).or(self.wanted.first()).copied().unwrap_or(1.0);
                let ratio = wanted / state.at(n, |k| sample(audio, c, k));
                let gain = ratio.clamp(1.0 / self.limit, self.limit);
                *out = (f64::from(sample(audio, c, n)) * gain.sqrt()) as f32;
                self.square += (10.0 * gain.log10()).powi(2);
                self.samples += 1;
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: TransientTransferIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("gain_db_rms", (self.square / self.samples.max(1) as f64).sqrt().into())])
    }

    archive_state!(each sound, each target, square, samples);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::random::Rng;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, ticks};

    const FS: u32 = 8000;

    /// Steady noise, and the same with a step of 20 dB every half second that decays in 60 ms.
    fn sounds(seed: u64) -> [Vec<f32>; 2] {
        let mut rng = Rng::new(seed);
        let steady: Vec<f32> = (0..4 * FS).map(|_| rng.between(-0.05, 0.05) as f32).collect();
        let since = |n: usize| (n % 4000) as f64 / f64::from(FS);
        let struck = |(n, x): (usize, &f32)| (f64::from(*x) * (1.0 + 9.0 * (-since(n) / 0.06).exp())) as f32;
        let strokes = steady.iter().enumerate().map(struck).collect();
        [steady, strokes]
    }

    fn shaped(audio: Vec<f32>, target: Vec<f32>, limit: f64, window: Option<f64>) -> Vec<f32> {
        let p = TransientTransferParams { fast: 0.003, slow: 0.03, limit };
        let mut standalone = Standalone::new::<TransientTransfer>(p)
            .input(TransientTransferPorts::audio, Rate::hz(FS), Channels(1), audio)
            .input(TransientTransferPorts::target, Rate::hz(FS), Channels(1), target);
        if let Some(seconds) = window {
            standalone = standalone.window(ticks(seconds));
        }
        standalone.run().unwrap().stream(TransientTransferPorts::out)
    }

    fn level(x: &[f32]) -> f64 {
        10.0 * (x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len() as f64).log10()
    }

    /// Mean rise of the level at the strokes, 10 ms before to 10 ms after.
    fn rise(x: &[f32]) -> f64 {
        let at = (1..8).map(|k| k * 4000);
        at.map(|n| level(&x[n..n + 80]) - level(&x[n - 80..n])).sum::<f64>() / 7.0
    }

    #[test]
    fn onsets_of_the_target_are_put_on_a_steady_sound() {
        let ([_, strokes], [steady, _]) = (sounds(1), sounds(2));
        assert!(rise(&strokes) > 18.0 && rise(&steady).abs() < 1.0);
        let found = shaped(steady.clone(), strokes.clone(), 6.0, None);
        // The limit allows 6 dB on either side of an onset, less over the length of the fast window.
        assert!((6.5..12.5).contains(&rise(&found)), "{}", rise(&found));
        // Far from the onsets levels are as they were.
        for k in 0..8 {
            let quiet = k * 4000 + 2400..k * 4000 + 3600;
            let change = level(&found[quiet.clone()]) - level(&steady[quiet]);
            assert!(change.abs() < 1.0, "{change}");
        }
        assert_eq!(shaped(steady.clone(), strokes.clone(), 0.0, None), steady, "no limit, no change");
        for window in [0.001, 0.0173, 0.3] {
            let parts = shaped(steady.clone(), strokes.clone(), 6.0, Some(window));
            assert!(parts == found, "windows of {window} s");
        }
    }

    #[test]
    fn a_sound_with_the_transients_of_the_target_is_left_as_it_is() {
        let [_, strokes] = sounds(3);
        assert_eq!(shaped(strokes.clone(), strokes.clone(), 6.0, None), strokes);
        // Silence stays silent.
        assert!(shaped(vec![0.0; 4000], strokes[..4000].to_vec(), 6.0, None).iter().all(|x| *x == 0.0));
    }
}
