//! Receivers: channels that filter the spectra of the emitters.

/// One or more channels that each filter the spectrum of every emitter.
///
/// All channels receive the same phases of an emitter, which preserves differences of time and level between ears.
pub trait Receiver {
    /// Returns the number of channels, a constant.
    fn channels(&self) -> usize;

    /// Returns true if the filters depend on the position of the emitter. If not, all emitters are one cluster.
    fn uses_positions(&self) -> bool {
        true
    }

    /// Adds the one-sided spectrum `(re, im)` of an emitter, times the response of this channel to its position, to
    /// `(sum_re, sum_im)`. It must not allocate. `position` is `None` if the vertices have no positions.
    fn add(
        &mut self,
        channel: usize,
        position: Option<[f32; 3]>,
        spectrum: (&[f32], &[f32]),
        sum: (&mut [f32], &mut [f32]),
    );
}

/// One channel without a filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mono;

impl Receiver for Mono {
    fn channels(&self) -> usize {
        1
    }

    fn uses_positions(&self) -> bool {
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
