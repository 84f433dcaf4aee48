//! The discrete wavelet transform, whole and periodic, and its inverse as a stream.

use super::family::Wavelet;
use crate::impl_state;
use rustfft::FftNum;

/// Taps of one filter for the samples of one parity: `taps[j]` belongs to index `first + j`.
#[derive(Clone, Debug)]
struct Phase<T> {
    parity: usize,
    first: isize,
    taps: Vec<T>,
}

/// The filters of a wavelet in one precision.
///
/// With low-pass `h` and high-pass `g` of `F` taps, a step of the analysis is `a[n] = sum_k h[k] x[2n + k - (F/2 - 1)]`, and the same with `g`
/// for the detail `d`; the offset centres each node on its span. The synthesis is its transpose. Both are periodic.
///
/// # Complexity
/// `F` multiplications and additions a sample and level.
///
/// # Source
/// Mallat, "A Wavelet Tour of Signal Processing" (3rd ed.), section 7.3. Equal to PyWavelets' mode `periodization`.
#[derive(Clone, Debug)]
pub struct FilterBank<T> {
    /// Low-pass and high-pass of the analysis, each by parity of the input.
    analysis: [[Phase<T>; 2]; 2],
    /// The same of the synthesis, each by parity of the output.
    synthesis: [[Phase<T>; 2]; 2],
    /// Greatest index that the synthesis of the samples `2q` and `2q + 1` needs, less `q`.
    ahead: usize,
    /// The least such index, below `q`.
    behind: usize,
}

/// A number as `T`; all numbers of this module fit.
fn real<T: FftNum>(x: f64) -> T {
    T::from_f64(x).unwrap_or_else(T::zero)
}

impl<T: FftNum> FilterBank<T> {
    /// The filters of a wavelet.
    #[must_use]
    pub fn new(wavelet: Wavelet) -> Self {
        let filters = [wavelet.low_pass().to_vec(), wavelet.high_pass()];
        let offset = filters[0].len() as isize / 2 - 1;
        let phase = |filter: &[f64], shift: &dyn Fn(isize) -> Option<isize>, parity: usize| {
            let mut all: Vec<(isize, T)> = filter
                .iter()
                .enumerate()
                .filter_map(|(k, h)| shift(k as isize).map(|at| (at, real(*h))))
                .collect();
            all.sort_by_key(|(at, _)| *at);
            Phase {
                parity,
                first: all.first().map_or(0, |(at, _)| *at),
                taps: all.into_iter().map(|(_, h)| h).collect(),
            }
        };
        let half = |x: isize| (x.rem_euclid(2) == 0).then(|| x.div_euclid(2));
        let analysis = filters
            .each_ref()
            .map(|filter| [0, 1].map(|p| phase(filter, &|k| half(k - offset - p as isize), p)));
        let synthesis = filters
            .each_ref()
            .map(|filter| [0, 1].map(|p| phase(filter, &|k| half(p as isize + offset - k), p)));
        let ends =
            |of: &dyn Fn(&Phase<T>) -> isize| synthesis.iter().flatten().map(of).max().unwrap_or(0).max(0);
        let ahead = ends(&|phase| phase.first + phase.taps.len() as isize - 1) as usize;
        let behind = ends(&|phase| -phase.first) as usize;
        Self { analysis, synthesis, ahead, behind }
    }

    /// One step of the periodic analysis: approximation and detail of half the length of `x`, whose length is even.
    #[must_use]
    pub fn analyse(&self, x: &[T]) -> (Vec<T>, Vec<T>) {
        let n = x.len() / 2;
        let (mut low, mut high) = (vec![T::zero(); n], vec![T::zero(); n]);
        self.analyse_into(x, [&mut low, &mut high]);
        (low, high)
    }

    /// As [`Self::analyse`], into zeros of half the length of `x`. It works block by block, so that all but `x` and the result stays in the cache.
    fn analyse_into(&self, x: &[T], [low, high]: [&mut [T]; 2]) {
        let n = x.len() / 2;
        let pad = self.analysis[0][0].taps.len() + 1;
        let mut phases = [0, 1].map(|_| Vec::with_capacity(BLOCK + 2 * pad));
        for start in (0..n).step_by(BLOCK) {
            let end = (start + BLOCK).min(n);
            for (p, phase) in phases.iter_mut().enumerate() {
                phase.clear();
                if start >= pad && end + pad <= n {
                    phase.extend(x[2 * (start - pad)..2 * (end + pad)].chunks_exact(2).map(|pair| pair[p]));
                } else {
                    let at = |k: isize| x[2 * k.rem_euclid(n as isize) as usize + p];
                    phase.extend((start as isize - pad as isize..(end + pad) as isize).map(at));
                }
            }
            for (filter, out) in self.analysis.iter().zip([&mut *low, &mut *high]) {
                for phase in filter {
                    let from = (pad as isize + phase.first) as usize;
                    correlate(&phase.taps, &phases[phase.parity][from..], &mut out[start..end]);
                }
            }
        }
    }

    /// One step of the periodic synthesis, of an approximation and a detail of equal lengths.
    #[must_use]
    pub fn synthesise(&self, low: &[T], high: &[T]) -> Vec<T> {
        let mut out = Vec::with_capacity(2 * low.len());
        self.synthesise_into(low, high, &mut out);
        out
    }

    /// As [`Self::synthesise`], appended to `out`.
    fn synthesise_into(&self, low: &[T], high: &[T], out: &mut Vec<T>) {
        let n = low.len();
        let mut padded = [Vec::new(), Vec::new()];
        for start in (0..n).step_by(BLOCK) {
            let end = (start + BLOCK).min(n);
            if start >= self.behind && end + self.ahead <= n {
                let own = start - self.behind..end + self.ahead;
                self.interleave([&low[own.clone()], &high[own]], end - start, out);
                continue;
            }
            for (padded, x) in padded.iter_mut().zip([low, high]) {
                let at = |k: isize| x[k.rem_euclid(n as isize) as usize];
                let first = start as isize - self.behind as isize;
                padded.clear();
                padded.extend((first..(end + self.ahead) as isize).map(at));
            }
            self.interleave([&padded[0], &padded[1]], end - start, out);
        }
    }

    /// Appends `2 n` samples, from inputs that begin `behind` items before those at which the samples are.
    fn interleave(&self, inputs: [&[T]; 2], n: usize, out: &mut Vec<T>) {
        let mut phases = [[T::zero(); BLOCK]; 2];
        for start in (0..n).step_by(BLOCK) {
            let count = BLOCK.min(n - start);
            phases.iter_mut().for_each(|phase| phase[..count].fill(T::zero()));
            for (filter, input) in self.synthesis.iter().zip(inputs) {
                for phase in filter {
                    let from = start + (self.behind as isize + phase.first) as usize;
                    correlate(&phase.taps, &input[from..], &mut phases[phase.parity][..count]);
                }
            }
            let [even, odd] = &phases;
            out.extend(even[..count].iter().zip(&odd[..count]).flat_map(|(a, b)| [*a, *b]));
        }
    }
}

/// Items of a block.
const BLOCK: usize = 512;

/// Adds to `out[n]` the sum over `k` of `taps[k] x[n + k]`.
fn correlate<T: FftNum>(taps: &[T], x: &[T], out: &mut [T]) {
    fn fixed<T: FftNum, const K: usize>(taps: &[T], x: &[T], out: &mut [T]) {
        let Some(taps) = taps.first_chunk::<K>() else { return };
        for (out, x) in out.iter_mut().zip(x.windows(K)) {
            let mut sum = *out;
            for k in 0..K {
                sum = sum + taps[k] * x[k];
            }
            *out = sum;
        }
    }
    match taps.len() {
        1 => fixed::<T, 1>(taps, x, out),
        2 => fixed::<T, 2>(taps, x, out),
        3 => fixed::<T, 3>(taps, x, out),
        4 => fixed::<T, 4>(taps, x, out),
        5 => fixed::<T, 5>(taps, x, out),
        6 => fixed::<T, 6>(taps, x, out),
        7 => fixed::<T, 7>(taps, x, out),
        8 => fixed::<T, 8>(taps, x, out),
        9 => fixed::<T, 9>(taps, x, out),
        _ => fixed::<T, 10>(taps, x, out),
    }
}

/// Approximation and details of a signal, coarsest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficients<T> {
    /// The approximation, one value per node of the coarsest level.
    pub approximation: Vec<T>,
    /// Level `l` has `2^l` values for each of the approximation.
    pub details: Vec<Vec<T>>,
}

/// Periodic transform over `depth` levels.
///
/// # Shapes
/// The length of `x` is a multiple of `2^depth`; samples beyond are left out.
///
/// # Complexity
/// Linear.
#[must_use]
pub fn forward<T: FftNum>(wavelet: Wavelet, depth: u32, x: &[T]) -> Coefficients<T> {
    let bank = FilterBank::new(wavelet);
    let x = &x[..x.len() >> depth << depth];
    if depth == 0 {
        return Coefficients { approximation: x.to_vec(), details: Vec::new() };
    }
    let mut details = Vec::with_capacity(depth as usize);
    let (mut approximation, first) = bank.analyse(x);
    details.push(first);
    // The approximations take turns in two buffers.
    let mut next = Vec::with_capacity(approximation.len() / 2);
    for _ in 1..depth {
        let n = approximation.len() / 2;
        let mut high = vec![T::zero(); n];
        next.clear();
        next.resize(n, T::zero());
        bank.analyse_into(&approximation, [&mut next, &mut high]);
        std::mem::swap(&mut approximation, &mut next);
        details.push(high);
    }
    approximation.shrink_to_fit();
    details.reverse();
    Coefficients { approximation, details }
}

/// The inverse of [`forward`].
#[must_use]
pub fn inverse<T: FftNum>(wavelet: Wavelet, coefficients: &Coefficients<T>) -> Vec<T> {
    let bank = FilterBank::new(wavelet);
    let length = coefficients.approximation.len() << coefficients.details.len();
    let mut x = Vec::with_capacity(length);
    x.extend_from_slice(&coefficients.approximation);
    // The approximations take turns in two buffers.
    let mut next = Vec::with_capacity(length);
    for detail in &coefficients.details {
        next.clear();
        bank.synthesise_into(&x, detail, &mut next);
        std::mem::swap(&mut x, &mut next);
    }
    x
}

/// The inverse transform of a tree that grows root by root, without wrap; silence precedes it.
///
/// After root `n` the samples of the roots up to `n - R` are complete, with `R` the [reach](Wavelet::reach) of the wavelet.
///
/// # Complexity
/// Per root, linear in its samples; memory of two roots.
#[derive(Clone, Debug)]
pub struct StreamingInverse<T> {
    bank: FilterBank<T>,
    /// Per level, approximation and detail, from `behind` items before the next pair on.
    levels: Vec<[Vec<T>; 2]>,
}

impl<T: FftNum> StreamingInverse<T> {
    /// The inverse over `depth` levels, before the first root.
    #[must_use]
    pub fn new(wavelet: Wavelet, depth: u32) -> Self {
        let bank = FilterBank::<T>::new(wavelet);
        // The samples of a root, and those that wait for the roots after it.
        let room = |level: u32| bank.behind + bank.ahead + ((wavelet.reach() + 2) << level);
        let empty = |level: u32| {
            let mut values = Vec::with_capacity(room(level));
            values.resize(bank.behind, T::zero());
            values
        };
        let levels = (0..depth).map(|level| [empty(level), empty(level)]).collect();
        Self { bank, levels }
    }

    /// Takes over the state of another one for the same wavelet and depth. Allocates nothing.
    pub fn follow(&mut self, other: &Self) {
        for (own, other) in self.levels.iter_mut().flatten().zip(other.levels.iter().flatten()) {
            own.clear();
            own.extend_from_slice(other);
        }
    }

    /// Adds a root: its approximation, and its nodes of each level, from `detail(level)`. Appends all samples that are complete.
    pub fn add<'a>(&mut self, approximation: T, detail: impl Fn(usize) -> &'a [T], out: &mut Vec<T>)
    where
        T: 'a,
    {
        let Self { bank, levels } = self;
        let mut low = vec![approximation];
        for (l, [lows, highs]) in levels.iter_mut().enumerate() {
            lows.append(&mut low);
            highs.extend_from_slice(detail(l));
            let n = lows.len().min(highs.len()).saturating_sub(bank.behind + bank.ahead);
            bank.interleave([lows, highs], n, &mut low);
            lows.drain(..n);
            highs.drain(..n);
        }
        out.append(&mut low);
    }
}

impl_state!(StreamingInverse<f32> { levels });

#[cfg(test)]
mod tests;
