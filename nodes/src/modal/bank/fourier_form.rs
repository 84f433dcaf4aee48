//! The Fourier form of the modal bank: modes that ring freely, by one inverse transform per hop.

use super::coefficients::Group;
use super::hop_fit::{HopFit, MAX_BINS};
use super::lanes::{GRID, LANES, Lanes};
use crate::{choices, impl_state};
use fearless_simd::{Level, dispatch};
use foley_fft::RealFftPlanner;
use realfft::ComplexToReal;
use realfft::num_complex::Complex;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

choices! {
    /// Method by which the modes of a bank are computed.
    pub enum BankForm {
        /// Each sample of each mode by itself, exactly.
        Time,
        /// Modes that ring freely by a few bins of a Fourier transform, others in time: for thousands of modes.
        Fourier,
        /// The time form while few modes sound or a force lasts, else the Fourier form.
        Auto,
    }
}

/// Length of a frame at 44.1 kHz, samples.
const FRAME: f64 = 1024.0;
/// Maximum decay of a mode within a frame, nepers: 200/s at 44.1 kHz. Above it the error exceeds -34 dB with five bins.
const MAX_DECAY: f64 = 4.65;
/// Vectors of modes whose coefficients are recomputed at a grid point.
const REFRESHED: usize = 64;
/// Number of sounding modes at which [`BankForm::Auto`] changes to the Fourier form.
///
/// By the bench `modal` on one core with AVX-512, the Fourier form is then 0.95 times as fast with an impact each 1024 samples, 1.3 times with
/// one each 4096, and 1.7 times with one each second. At 128 modes it is 0.85, 1.06 and 1.3 times as fast.
const ENTER: usize = 256;
/// Number of sounding modes below which [`BankForm::Auto`] leaves the Fourier form.
const LEAVE: usize = 128;

/// Length of a frame at a sample rate in Hz: the power of two that is nearest to 1024 samples at 44.1 kHz in ratio.
pub(crate) fn frame(rate: f64) -> usize {
    let exponent = libm::round(libm::log2(FRAME * rate / 44_100.0));
    // A hop is at least one grid interval.
    1 << exponent.clamp(7.0, 16.0) as u32
}

/// Sixteen modes that ring freely.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Held {
    /// State before the first sample of the hop.
    re: [f32; LANES],
    im: [f32; LANES],
    /// Change of the state in one hop.
    step_re: [f32; LANES],
    step_im: [f32; LANES],
    /// Position of the first bin in the padded spectrum.
    first: [u32; LANES],
    /// True for modes that decay slowly enough.
    fits: [bool; LANES],
}

impl Held {
    const SILENT: Self = Self {
        re: [0.0; LANES],
        im: [0.0; LANES],
        step_re: [0.0; LANES],
        step_im: [0.0; LANES],
        first: [0; LANES],
        fits: [false; LANES],
    };

    /// Advances the states by a hop.
    #[inline(always)]
    fn advance(&mut self) {
        for l in 0..LANES {
            let (x, y) = (self.re[l], self.im[l]);
            self.re[l] = x * self.step_re[l] - y * self.step_im[l];
            self.im[l] = x * self.step_im[l] + y * self.step_re[l];
        }
    }

    /// Takes over the states of the modes that fit.
    #[inline(always)]
    fn take(&mut self, lanes: &mut Lanes) {
        for l in 0..LANES {
            let own = f32::from(u8::from(self.fits[l]));
            self.re[l] += own * lanes.re[l];
            self.im[l] += own * lanes.im[l];
            lanes.re[l] *= 1.0 - own;
            lanes.im[l] *= 1.0 - own;
        }
    }

    /// Returns the states after some more samples.
    fn after(&self, lanes: &Lanes, samples: usize) -> [(f32, f32); LANES] {
        let [re, im] = lanes.after(&self.re, &self.im, samples);
        std::array::from_fn(|l| (re[l], im[l]))
    }

    fn is_silent(&self) -> bool {
        self.re == [0.0; LANES] && self.im == [0.0; LANES]
    }
}

/// Thresholds of the states of modes at a hop, as squared magnitudes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// A mode below it is silent, if no force acted in the last hop.
    pub floor: f32,
    /// A mode below it is silent even under a force.
    pub min: f32,
    /// A mode above it has diverged.
    pub max: f32,
}

/// The modes of a bank that ring freely, and their sound in the current hop.
///
/// At the start of each hop the states of all modes that decay slowly enough are moved from the lanes of the bank to here. The sound of the
/// whole hop is the first half of one inverse transform (see [`HopFit`]). Forces during the hop act on the lanes, sample by sample, up to
/// the next hop. So an impact sounds at its sample, there is no latency, and the sum is exact up to the error of the fit. The hops lie at
/// multiples of their length, counted in samples of the stream.
///
/// While dampings or frequencies change, and for a hop after it, all modes are in the lanes. Then new coefficients are computed at grid
/// points, for 1024 modes at each.
///
/// # Complexity
/// O(modes * bins) per hop in addition to the transform and, under forces, to the recursion in time.
#[derive(Clone)]
pub(super) struct FourierForm {
    form: BankForm,
    fit: HopFit,
    hop: usize,
    /// Bins of a mode, with those added for alignment, whose coefficients are 0.
    width: usize,
    held: Vec<Held>,
    /// True for vectors in which a mode sounds.
    awake: Vec<bool>,
    /// `[modes, 2, width]`: real parts, then imaginary parts.
    coefficients: Vec<f32>,
    /// Vectors whose coefficients are up to date.
    ready: usize,
    /// Grid points since the last change of dampings or frequencies, while coefficients are out of date.
    settled: usize,
    /// Position in the hop.
    at: usize,
    /// Grid intervals of the hop in which a force acted.
    forced: usize,
    /// True while modes are held here.
    engaged: bool,
    /// True if the sound of the hop is other than 0.
    sounds: bool,
    /// The sound of the hop, and the rest of the transform after it.
    sound: Vec<f32>,
    /// Hops in which modes were held.
    hops: u64,
    transform: Arc<dyn ComplexToReal<f32>>,
    spectrum: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
    /// The spectrum with `MAX_BINS` bins before it and after it, real and imaginary parts.
    padded: [Vec<f32>; 2],
}
impl_state!(FourierForm {
    held,
    awake,
    coefficients,
    ready,
    settled,
    at,
    forced,
    engaged,
    sounds,
    sound,
    hops
});

impl fmt::Debug for FourierForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { form, hop, ready, at, engaged, .. } = self;
        write!(f, "FourierForm({form:?}, hop {hop}, ready {ready}, at {at}, engaged {engaged})")
    }
}

impl FourierForm {
    /// Silence at the start of a hop.
    pub fn new(form: BankForm, bins: usize, vectors: usize, rate: f64) -> Self {
        let size = frame(rate);
        let width = bins.clamp(1, MAX_BINS).next_multiple_of(4);
        let transform = RealFftPlanner::new().plan_fft_inverse(size);
        Self {
            form,
            fit: HopFit::new(size, bins),
            hop: size / 2,
            width,
            held: vec![Held::SILENT; vectors],
            awake: vec![false; vectors],
            coefficients: vec![0.0; vectors * LANES * 2 * width],
            ready: 0,
            settled: 0,
            at: 0,
            forced: 0,
            engaged: false,
            sounds: false,
            sound: vec![0.0; size],
            hops: 0,
            spectrum: transform.make_input_vec(),
            scratch: transform.make_scratch_vec(),
            padded: [(); 2].map(|()| vec![0.0; size / 2 + 1 + 2 * MAX_BINS]),
            transform,
        }
    }

    /// Hops in which modes were held.
    pub fn hops(&self) -> u64 {
        self.hops
    }

    /// True for vectors in which a mode is held.
    pub fn awake(&self) -> &[bool] {
        &self.awake
    }

    /// Position in the hop, as long as the other hop.
    pub fn position(&self, other: Option<&Self>) -> Option<usize> {
        other.filter(|other| other.hop == self.hop).map(|other| other.at)
    }

    /// Returns true if the next sample has the same position in a hop as `position`, a position in the stream.
    pub fn is_at(&self, position: i64) -> bool {
        position.rem_euclid(self.hop as i64) as usize == self.at
    }

    /// Sets the position of the next sample in the stream; requires that no modes are held.
    pub fn set_position(&mut self, position: i64) {
        self.at = position.rem_euclid(self.hop as i64) as usize;
        self.sounds = false;
    }

    /// Counts a grid interval in which a force acted.
    pub fn note_force(&mut self) {
        self.forced += 1;
    }

    /// Declares all coefficients out of date.
    pub fn spoil(&mut self) {
        (self.ready, self.settled) = (0, 0);
    }

    /// Computes coefficients of up to `vectors` vectors of modes with `damping` times all dampings.
    pub fn refresh(&mut self, groups: &[Group], damping: f64, vectors: usize) {
        let Self { fit, hop, width, held, coefficients, ready, .. } = self;
        let size = 2 * LANES * *width;
        let from = (*ready).min(held.len());
        let until = from.saturating_add(vectors).min(held.len());
        let all = held[from..until].iter_mut().zip(coefficients[from * size..].chunks_exact_mut(size));
        for ((held, own), group) in all.zip(&groups[from..until]) {
            for (l, own) in own.chunks_exact_mut(2 * *width).enumerate() {
                let pole = group.pole(l, damping);
                let pole = pole.filter(|(decay, _)| decay * 2.0 * *hop as f64 <= MAX_DECAY);
                held.fits[l] = pole.is_some();
                let Some((decay, angle)) = pole else { continue };
                let (re, im) = own.split_at_mut(*width);
                let lowest = fit.coefficients(decay, angle, re, im);
                held.first[l] = (lowest + MAX_BINS as i32).max(0) as u32;
                let shrink = libm::exp(-decay * *hop as f64);
                let angle = angle * *hop as f64;
                held.step_re[l] = (shrink * libm::cos(angle)) as f32;
                held.step_im[l] = (shrink * libm::sin(angle)) as f32;
            }
        }
        *ready = until;
    }

    /// Computes coefficients at a grid point at which nothing changes, from one hop after the last change on.
    pub fn refresh_some(&mut self, groups: &[Group], damping: f64) {
        if self.ready == self.held.len() {
            return;
        }
        self.settled += 1;
        if self.settled * GRID >= self.hop {
            self.refresh(groups, damping, REFRESHED);
        }
    }

    /// Moves the states of all modes to the lanes, and fades the difference between the sound of the hop and theirs.
    pub fn release(&mut self, lanes: &mut [Lanes], awake: &mut [bool]) {
        if !std::mem::take(&mut self.engaged) {
            return;
        }
        let elapsed = if self.at == 0 { self.hop } else { self.at };
        let mut exact = 0.0;
        for v in 0..self.held.len() {
            if !std::mem::take(&mut self.awake[v]) {
                continue;
            }
            let states = self.held[v].after(&lanes[v], elapsed);
            for (l, (re, im)) in states.into_iter().enumerate() {
                lanes[v].re[l] += re;
                lanes[v].im[l] += im;
                exact += im;
            }
            awake[v] = true;
            (self.held[v].re, self.held[v].im) = ([0.0; LANES], [0.0; LANES]);
        }
        let last = if self.sounds { self.sound[elapsed - 1] } else { 0.0 };
        let rest = &mut self.sound[self.at..self.hop];
        rest.fill(0.0);
        for (k, x) in rest.iter_mut().take(GRID).enumerate() {
            *x = (last - exact) * (1.0 - (k + 1) as f32 / GRID as f32);
        }
        self.sounds = true;
    }

    /// Adds the states of sixteen modes to others.
    pub fn add_state(&self, vector: usize, lanes: &Lanes, to: &mut [(f32, f32); LANES]) {
        if !self.engaged || !self.awake[vector] {
            return;
        }
        let elapsed = if self.at == 0 { self.hop } else { self.at };
        for (to, (re, im)) in to.iter_mut().zip(self.held[vector].after(lanes, elapsed)) {
            *to = (to.0 + re, to.1 + im);
        }
    }

    /// Starts a hop, if one starts at the next sample.
    pub fn start_hop(
        &mut self,
        level: Level,
        lanes: &mut [Lanes],
        awake: &mut [bool],
        limits: Limits,
        diverged: &mut u64,
    ) {
        if self.at != 0 {
            return;
        }
        let forced = std::mem::take(&mut self.forced);
        if !self.takes_over(awake, forced) {
            // Else the error of the last hop fades.
            self.sounds &= self.engaged;
            return self.release(lanes, awake);
        }
        self.engaged = true;
        self.hops += 1;
        let floor = if forced == 0 { limits.floor } else { limits.min };
        let Self { held, awake: held_awake, coefficients, padded: [re, im], width, .. } = self;
        re.fill(0.0);
        im.fill(0.0);
        let all = held.iter_mut().zip(held_awake.iter_mut()).zip(lanes.iter_mut().zip(awake.iter_mut()));
        let coefficients = coefficients.chunks_exact(2 * LANES * *width);
        let mut sounds = false;
        dispatch!(level, _simd => {
            for (((held, held_awake), (lanes, awake)), coefficients) in all.zip(coefficients) {
                if !*held_awake && !*awake {
                    continue;
                }
                held.advance();
                held.take(lanes);
                silence(held, floor, limits.max, diverged);
                *held_awake = !held.is_silent();
                *awake = lanes.re != [0.0; LANES] || lanes.im != [0.0; LANES];
                sounds |= *held_awake;
                if *held_awake {
                    match *width {
                        4 => add::<4>(held, coefficients, re, im),
                        8 => add::<8>(held, coefficients, re, im),
                        _ => add::<MAX_BINS>(held, coefficients, re, im),
                    }
                }
            }
        });
        self.sounds = sounds;
        if sounds {
            self.transform();
        }
    }

    /// Returns true if modes are held in the next hop.
    fn takes_over(&self, awake: &[bool], forced: usize) -> bool {
        if self.ready < self.held.len() || self.held.is_empty() {
            return false;
        }
        match self.form {
            BankForm::Time => false,
            BankForm::Fourier => true,
            BankForm::Auto => {
                let all = self.held.iter().zip(&self.awake).zip(awake);
                let sounding =
                    all.filter(|((held, own), lanes)| **own || (**lanes && held.fits.contains(&true)));
                let modes = LANES * sounding.count();
                let throughout = forced * GRID >= self.hop;
                if self.engaged { modes >= LEAVE && !throughout } else { modes >= ENTER && forced == 0 }
            }
        }
    }

    /// Computes the sound of the hop from the padded spectrum.
    fn transform(&mut self) {
        let [re, im] = &self.padded;
        let half = self.hop;
        for (k, value) in self.spectrum.iter_mut().enumerate() {
            *value = Complex::new(re[MAX_BINS + k], im[MAX_BINS + k]);
        }
        // Mirror images of bins below 0 and above half the frame.
        for k in 0..=MAX_BINS {
            let (below, above) = (MAX_BINS - k, MAX_BINS + half + k);
            self.spectrum[k] += Complex::new(re[below], -im[below]);
            self.spectrum[half - k] += Complex::new(re[above], -im[above]);
        }
        // It fails only for slices of other lengths, and for spectra that are not real at 0 and at half the frame.
        let done =
            self.transform.process_with_scratch(&mut self.spectrum, &mut self.sound, &mut self.scratch);
        if done.is_err() {
            self.sound.fill(0.0);
        }
    }

    /// Adds the next samples of the hop.
    pub fn add_to(&mut self, out: &mut [f32]) {
        if self.sounds {
            out.iter_mut().zip(&self.sound[self.at..self.hop]).for_each(|(out, x)| *out += x);
        }
        self.at = (self.at + out.len()) % self.hop;
    }
}

/// Sets modes to zero that have decayed or diverged.
#[inline(always)]
fn silence(held: &mut Held, floor: f32, max: f32, diverged: &mut u64) {
    for l in 0..LANES {
        let size = held.re[l] * held.re[l] + held.im[l] * held.im[l];
        if !(size > floor && size < max) {
            *diverged += u64::from(size.is_nan() || size >= max);
            (held.re[l], held.im[l]) = (0.0, 0.0);
        }
    }
}

/// Adds the bins of sixteen modes to a spectrum.
#[inline(always)]
fn add<const W: usize>(held: &Held, coefficients: &[f32], re: &mut [f32], im: &mut [f32]) {
    for (l, own) in coefficients.chunks_exact(2 * W).enumerate() {
        let ([own_re, own_im], []) = own.as_chunks::<W>() else { return };
        let (x, y) = (held.re[l], held.im[l]);
        let first = held.first[l] as usize;
        let (Some(re), Some(im)) = (re.get_mut(first..), im.get_mut(first..)) else { continue };
        let (Some(re), Some(im)) = (re.first_chunk_mut::<W>(), im.first_chunk_mut::<W>()) else { continue };
        for k in 0..W {
            re[k] += x * own_re[k] - y * own_im[k];
            im[k] += x * own_im[k] + y * own_re[k];
        }
    }
}

#[cfg(test)]
mod tests;
