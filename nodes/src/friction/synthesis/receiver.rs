//! Receivers of the sound of the emitters.

/// Where the sound of the emitters is heard: one or more channels that each filter every emitter's spectrum.
///
/// All channels hear the same phases of an emitter, so differences of time and level between ears survive.
pub trait Receiver {
    /// Number of channels, constant.
    fn channels(&self) -> usize;

    /// Whether the place of an emitter matters; if not, one cluster holds them all.
    fn hears_place(&self) -> bool {
        true
    }

    /// Adds an emitter's one-sided spectrum `(re, im)`, times this channel's response to its place, onto `(sum_re,
    /// sum_im)`; must not allocate. `position` is `None` when the vertices have none.
    fn add(
        &mut self,
        channel: usize,
        position: Option<[f32; 3]>,
        spectrum: (&[f32], &[f32]),
        sum: (&mut [f32], &mut [f32]),
    );
}

/// One channel that hears every emitter as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mono;

impl Receiver for Mono {
    fn channels(&self) -> usize {
        1
    }

    fn hears_place(&self) -> bool {
        false
    }

    fn add(
        &mut self,
        _: usize,
        _: Option<[f32; 3]>,
        spectrum: (&[f32], &[f32]),
        sum: (&mut [f32], &mut [f32]),
    ) {
        sum.0.iter_mut().zip(spectrum.0).for_each(|(s, x)| *s += x);
        sum.1.iter_mut().zip(spectrum.1).for_each(|(s, x)| *s += x);
    }
}
