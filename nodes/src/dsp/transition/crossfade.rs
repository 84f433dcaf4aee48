//! Crossfades from one sound to another at a set time.

use super::fade::{Fade, FadeLaw};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, same_channels, same_rate};
use crate::core::ports::{In, Stream};
use crate::core::shape::{Build, Incoming, Shape};
use crate::dsp::nearest_items;
use crate::{params, ports};

params! {
    /// Crossfades from one sound to another at a set time.
    ///
    /// With one input only, that sound fades out, or in. The output is as long as the longer input.
    pub struct CrossfadeParams {
        /// Start of the crossfade.
        at: f64, unit "s", range 0.0..=1.0e9_f64;
        /// Length of the crossfade; 0 is a cut.
        duration: f64 = 0.02, unit "s", range 0.0..=600.0;
        /// Shape: `EqualPower` for uncorrelated sounds, `Linear` for correlated ones.
        law: FadeLaw = FadeLaw::EqualPower;
    }
}
ports! {
    /// Ports of `Crossfade`.
    pub struct CrossfadePorts / CrossfadeIo {
        in {
            /// The sound before the crossfade.
            before: Option<Stream<f32>>,
            /// The sound after the crossfade.
            after: Option<Stream<f32>>,
        }
        out {
            /// The first sound, then the second.
            out: Stream<f32>,
        }
    }
}

/// Crossfades from `before` to `after`. The samples begin at frame `first`.
///
/// # Shapes
/// `before` and `after`, if present, are as long as `out`: frames of `channels` samples.
pub fn crossfade(
    (out_fade, in_fade): (Fade, Fade),
    first: i64,
    channels: usize,
    (before, after): (Option<&[f32]>, Option<&[f32]>),
    out: &mut [f32],
) {
    let channels = channels.max(1);
    let end = first + (out.len() / channels) as i64;
    let fade_end = in_fade.start.saturating_add_unsigned(in_fade.frames);
    let copy = |sound: Option<&[f32]>, out: &mut [f32]| match sound {
        Some(sound) => out.copy_from_slice(sound),
        None => out.fill(0.0),
    };
    if end <= in_fade.start {
        return copy(before, out);
    }
    if first >= fade_end {
        return copy(after, out);
    }
    out.fill(0.0);
    for (sound, fade) in [(before, out_fade), (after, in_fade)] {
        let Some(sound) = sound else { continue };
        let frames = out.chunks_exact_mut(channels).zip(sound.chunks_exact(channels));
        for (frame, (out, sound)) in (first..).zip(frames) {
            let gain = fade.gain_at(frame);
            out.iter_mut().zip(sound).for_each(|(out, x)| *out += (f64::from(*x) * gain) as f32);
        }
    }
}

/// The node `Crossfade`.
#[derive(Debug)]
pub struct CrossfadeNode {
    fades: (Fade, Fade),
}

fn either(before: Option<Incoming<f32>>, after: Option<Incoming<f32>>) -> Result<Incoming<f32>, Reject> {
    let missing = || Reject::new("F012", "neither `before` nor `after` is linked").help("link one of them");
    before.or(after).ok_or_else(missing)
}

impl Node for CrossfadeNode {
    type Params = CrossfadeParams;
    type Ports = CrossfadePorts;
    const NAME: &'static str = "Crossfade";
    const CLASS: Class = Class::Audio;

    fn shape(_: &CrossfadeParams, s: &mut Shape<'_, '_, CrossfadePorts>) -> Result<(), Reject> {
        let (before, after) = (s.optional(CrossfadePorts::before), s.optional(CrossfadePorts::after));
        if let (Some(before), Some(after)) = (&before, &after) {
            s.check(same_rate("after", after.rate, "`before`", before.rate));
            s.check(same_channels("after", after.format, "`before`", before.format));
        }
        let audio = either(before, after)?;
        s.output(CrossfadePorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(p: &CrossfadeParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let rate = cx.output(CrossfadePorts::out).rate;
        let (start, frames) = (nearest_items(rate, p.at) as i64, nearest_items(rate, p.duration) as u64);
        let fade = |rising| Fade { law: p.law, rising, start, frames };
        Ok(Self { fades: (fade(false), fade(true)) })
    }

    fn run(&mut self, mut io: CrossfadeIo<'_>) -> Result<(), Fault> {
        let (first, channels) = (io.out.first(), io.out.width());
        let sounds = (io.before.as_ref().map(In::items), io.after.as_ref().map(In::items));
        crossfade(self.fades, first, channels, sounds, io.out.items());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;

    fn faded(law: FadeLaw, before: Option<f32>, after: Option<f32>) -> Vec<f32> {
        let rate = Rate::hz(1000);
        let mut standalone =
            Standalone::new::<CrossfadeNode>(CrossfadeParams { at: 0.010, duration: 0.020, law });
        for (port, level) in [(CrossfadePorts::before, before), (CrossfadePorts::after, after)] {
            if let Some(level) = level {
                standalone = standalone.optional(port, rate, Channels(2), vec![level; 100]);
            }
        }
        let out = standalone.run().unwrap().stream(CrossfadePorts::out);
        out.chunks_exact(2).map(|frame| frame[0]).collect()
    }

    #[test]
    fn a_linear_crossfade_leaves_equal_sounds_unchanged() {
        let out = faded(FadeLaw::Linear, Some(0.5), Some(0.5));
        assert!(out.iter().all(|x| (x - 0.5).abs() < 1e-6), "{out:?}");
    }

    #[test]
    fn an_equal_power_crossfade_keeps_the_power_of_uncorrelated_sounds() {
        let out = faded(FadeLaw::EqualPower, Some(1.0), None);
        let into = faded(FadeLaw::EqualPower, None, Some(1.0));
        assert_eq!((out[9], into[9], out[30], into[30]), (1.0, 0.0, 0.0, 1.0));
        for (a, b) in out.iter().zip(&into) {
            assert!((a * a + b * b - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_fade_without_length_is_a_cut() {
        let mut out = vec![0.0; 6];
        let fade = |rising| Fade { law: FadeLaw::Linear, rising, start: 3, frames: 0 };
        crossfade((fade(false), fade(true)), 0, 1, (Some(&[1.0; 6]), Some(&[2.0; 6])), &mut out);
        assert_eq!(out, [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    }

    #[test]
    fn streams_that_differ_are_refused() {
        let standalone = Standalone::new::<CrossfadeNode>(CrossfadeParams {
            at: 0.0,
            duration: 0.0,
            law: FadeLaw::Linear,
        });
        assert_eq!(standalone.shape().unwrap_err().code, "F012");
        let one = |rate, channels| (Rate::hz(rate), Channels(channels), vec![0.0; 12]);
        for (other, code) in [(one(500, 1), "F045"), (one(1000, 2), "F046")] {
            let standalone = Standalone::new::<CrossfadeNode>(CrossfadeParams {
                at: 0.0,
                duration: 0.0,
                law: FadeLaw::Linear,
            });
            let (rate, channels, data) = one(1000, 1);
            let standalone = standalone.optional(CrossfadePorts::before, rate, channels, data);
            let standalone = standalone.optional(CrossfadePorts::after, other.0, other.1, other.2);
            assert_eq!(standalone.shape().unwrap_err().code, code);
        }
    }
}
