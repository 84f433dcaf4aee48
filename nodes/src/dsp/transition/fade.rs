//! Fades whose gain depends on the frame index only.

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
    /// Linear: the gains of fade-in and fade-out add up to 1; for correlated sounds.
    Linear,
    /// Sine and cosine: the squares of the gains add up to 1; for uncorrelated sounds.
    EqualPower,
}

impl FadeLaw {
    /// Returns the gains (out, in) at `t` in [0, 1] of a crossfade.
    #[must_use]
    pub fn gains(self, t: f64) -> (f64, f64) {
        let t = t.clamp(0.0, 1.0);
        match self {
            Self::Linear => (1.0 - t, t),
            Self::EqualPower if t >= 1.0 => (0.0, 1.0),
            Self::EqualPower => ((FRAC_PI_2 * t).cos(), (FRAC_PI_2 * t).sin()),
        }
    }
}

/// A fade that begins at frame `start` and lasts `frames`. A rising fade has gain 0 before and 1 after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fade {
    /// Shape.
    pub law: FadeLaw,
    /// True for a fade-in, false for a fade-out.
    pub rising: bool,
    /// First frame of the fade.
    pub start: i64,
    /// Length in frames; 0 is a cut.
    pub frames: u64,
}

impl Fade {
    /// Returns the gain of a frame.
    #[must_use]
    pub fn gain_at(&self, frame: i64) -> f64 {
        let elapsed = i128::from(frame) - i128::from(self.start);
        let t = if elapsed >= i128::from(self.frames) { 1.0 } else { elapsed as f64 / self.frames as f64 };
        let (out, into) = self.law.gains(t);
        if self.rising { into } else { out }
    }

    /// Fades interleaved samples from frame `first` on in place.
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
    /// Linear; the gains of fade-in and fade-out add up to 1.
    Linear,
    /// Sine; the squares of the gains of fade-in and fade-out add up to 1.
    EqualPower,
});
params! {
    /// Fades audio in at its start and out at its end.
    pub struct FadeParams {
        /// Time from silence to full level at the start.
        fade_in: f64 = 0.01, unit "s", range 0.0..=600.0;
        /// Time from full level to silence at the end.
        fade_out: f64 = 0.01, unit "s", range 0.0..=600.0;
        /// Shape of both fades.
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
            /// The faded audio.
            out: Stream<f32>,
        }
    }
}

/// The node `Fade`.
#[derive(Debug)]
pub struct FadeNode {
    fade_in: Fade,
    fade_out: Option<Fade>,
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
                .help("set fade_out: 0, or insert Trim before it"));
        }
        s.output(FadePorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &FadeParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(FadePorts::audio);
        let in_frames = nearest_items(audio.rate, p.fade_in) as u64;
        let out_frames = nearest_items(audio.rate, p.fade_out) as u64;
        let out =
            |end: i64| Fade { law: p.law, rising: false, start: end - out_frames as i64, frames: out_frames };
        Ok(Self {
            fade_in: Fade { law: p.law, rising: true, start: 0, frames: in_frames },
            fade_out: audio.items().filter(|_| out_frames > 0).map(out),
        })
    }

    fn run(&mut self, mut io: FadeIo<'_>) -> Result<(), Fault> {
        let (first, width) = (io.audio.first(), io.audio.width());
        let out = io.out.items();
        out.copy_from_slice(io.audio.items());
        self.fade_in.process(first, out, width);
        if let Some(fade_out) = self.fade_out {
            fade_out.process(first, out, width);
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
    fn gains_and_their_squares_add_up_to_one() {
        for i in 0..=20 {
            let t = f64::from(i) / 20.0;
            let (out, into) = FadeLaw::Linear.gains(t);
            assert!((out + into - 1.0).abs() < 1e-15);
            let (out, into) = FadeLaw::EqualPower.gains(t);
            assert!((out * out + into * into - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_fade_is_exact_at_both_ends() {
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
