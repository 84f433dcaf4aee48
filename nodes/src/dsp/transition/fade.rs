//! Fades whose gain is a function of the position alone.

use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::Params;
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::dsp::nearest_items;
use crate::{choices, params, ports};
use std::f64::consts::FRAC_PI_2;

/// Shape of a fade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FadeLaw {
    /// Straight: in and out add up to 1, right for equal or correlated material.
    Linear,
    /// Sine and cosine: the squares add up to 1, right for uncorrelated material.
    EqualPower,
}

impl FadeLaw {
    /// Gains (out, in) at `way` in [0, 1] of a cross-fade.
    #[must_use]
    pub fn gains(self, way: f64) -> (f64, f64) {
        let way = way.clamp(0.0, 1.0);
        match self {
            Self::Linear => (1.0 - way, way),
            Self::EqualPower if way >= 1.0 => (0.0, 1.0),
            Self::EqualPower => ((FRAC_PI_2 * way).cos(), (FRAC_PI_2 * way).sin()),
        }
    }
}

/// A fade that begins at frame `start` and lasts `frames`: gain 0 (or 1) before, 1 (or 0) from its end on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fade {
    /// Shape.
    pub law: FadeLaw,
    /// Whether the sound comes in.
    pub rising: bool,
    /// First frame of the fade.
    pub start: i64,
    /// Frames from one end to the other; 0 is a cut.
    pub frames: u64,
}

impl Fade {
    /// The gain of a frame.
    #[must_use]
    pub fn gain_at(&self, frame: i64) -> f64 {
        let passed = i128::from(frame) - i128::from(self.start);
        let way = if passed >= i128::from(self.frames) { 1.0 } else { passed as f64 / self.frames as f64 };
        let (out, into) = self.law.gains(way);
        if self.rising { into } else { out }
    }

    /// Fades interleaved samples, the first of which belong to frame `first`, in place.
    pub fn process(&self, first: i64, samples: &mut [f32], channels: usize) {
        for (frame, samples) in (first..).zip(samples.chunks_exact_mut(channels.max(1))) {
            let gain = self.gain_at(frame);
            for x in samples {
                *x = (f64::from(*x) * gain) as f32;
            }
        }
    }
}

choices!(@param FadeLaw {
    /// Straight; in and out add up to 1.
    Linear,
    /// Sine; the squares of in and out add up to 1.
    EqualPower,
});
params! {
    /// Fades audio in at its start and out at its end.
    pub struct FadeParams {
        /// Time from silence to full level at the start.
        fade_in: f64 = 0.01, unit "s", range 0.0..=600.0;
        /// Time from full level to silence at the end.
        fade_out: f64 = 0.01, unit "s", range 0.0..=600.0;
        /// Shape of both.
        law: FadeLaw = FadeLaw::Linear;
    }
}
ports! {
    /// Ports of `Fade`.
    pub struct FadePorts / FadeIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
        }
        out {
            /// The audio with its ends faded.
            out: Stream<f32>,
        }
    }
}

/// The node `Fade`.
#[derive(Debug)]
pub struct FadeNode {
    into: Fade,
    away: Option<Fade>,
}

impl Node for FadeNode {
    type Params = FadeParams;
    type Ports = FadePorts;
    const NAME: &'static str = "Fade";
    const CLASS: Class = Class::Audio;

    fn shape(p: &FadeParams, s: &mut Shape<'_, '_, FadePorts>) -> Result<(), Reject> {
        let audio = s.input(FadePorts::audio);
        if audio.end.is_none() && p.fade_out > 0.0 {
            return Err(Reject::new("F051", "`audio` has no end to fade out at")
                .at("fade_out")
                .help("set fade_out: 0, or put Trim before it"));
        }
        s.output(FadePorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &FadeParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(FadePorts::audio);
        let into = nearest_items(audio.rate, p.fade_in) as u64;
        let away = nearest_items(audio.rate, p.fade_out) as u64;
        let out = |end: i64| Fade { law: p.law, rising: false, start: end - away as i64, frames: away };
        Ok(Self {
            into: Fade { law: p.law, rising: true, start: 0, frames: into },
            away: audio.items().filter(|_| away > 0).map(out),
        })
    }

    fn run(&mut self, mut io: FadeIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.audio.first(), io.audio.width());
        let out = io.out.items();
        out.copy_from_slice(io.audio.items());
        self.into.process(first, out, width);
        if let Some(away) = self.away {
            away.process(first, out, width);
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (FadeParams, MemoryFiles) {
        let (fade_in, fade_out) = (rng.between(0.0, 0.5), rng.between(0.0, 0.5));
        (FadeParams { fade_in, fade_out, ..FadeParams::trial(rng) }, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::dsp::testing::{assert_block_invariant, signal};

    #[test]
    fn laws_keep_their_sums() {
        for i in 0..=20 {
            let way = f64::from(i) / 20.0;
            let (out, into) = FadeLaw::Linear.gains(way);
            assert!((out + into - 1.0).abs() < 1e-15);
            let (out, into) = FadeLaw::EqualPower.gains(way);
            assert!((out * out + into * into - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_fade_has_both_ends_exact() {
        let fade = Fade { law: FadeLaw::EqualPower, rising: false, start: 10, frames: 4 };
        assert_eq!([i64::MIN, 10, 14, i64::MAX].map(|n| fade.gain_at(n)), [1.0, 1.0, 0.0, 0.0]);
        let cut = Fade { law: FadeLaw::Linear, rising: true, start: 3, frames: 0 };
        assert_eq!([2, 3].map(|n| cut.gain_at(n)), [0.0, 1.0]);
    }

    #[test]
    fn blocks_do_not_change_a_bit() {
        let fade = Fade { law: FadeLaw::EqualPower, rising: true, start: 30, frames: 2000 };
        assert_block_invariant(&signal(2500, 2), 2, || fade, |f, at, x| f.process(at, x, 2));
    }

    #[test]
    fn the_node_fades_both_ends_of_a_recording() {
        let params = FadeParams { fade_in: 0.04, fade_out: 0.02, law: FadeLaw::Linear };
        let standalone = Standalone::new::<FadeNode>(params);
        let run = standalone.input(FadePorts::audio, Rate::hz(100), Channels(1), vec![1.0; 8]).run().unwrap();
        assert_eq!(run.stream(FadePorts::out), [0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 0.5]);
    }
}
