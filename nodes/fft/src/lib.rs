//! Planners of `rustfft` and `realfft` for `f32` and `f64`.
//!
//! Both crates are generic: whoever plans a transform compiles all of their algorithms, an eighth of the code of the node library. Here they
//! are compiled once, and with optimization in builds for tests, too.
//!
//! ```
//! use foley_fft::{FftPlanner, RealFftPlanner};
//! use realfft::num_complex::Complex;
//!
//! let sound = [1.0, 2.0, -1.0, 0.5, 0.0, 3.0_f64];
//! let mut planner = RealFftPlanner::<f64>::new();
//! let (mut input, mut spectrum) = (sound.to_vec(), vec![Complex::default(); 4]);
//! planner.plan_fft_forward(6).process(&mut input, &mut spectrum)?;
//! let mut whole = sound.map(Complex::from);
//! FftPlanner::new().plan_fft_forward(6).process(&mut whole);
//! assert!(spectrum.iter().zip(&whole).all(|(a, b)| (a - b).norm() < 1e-12));
//!
//! planner.plan_fft_inverse(6).process(&mut spectrum, &mut input)?;
//! FftPlanner::new().plan_fft_inverse(6).process(&mut whole);
//! assert!((0..6).all(|k| (input[k] / 6.0 - sound[k]).abs() < 1e-12 && (whole[k].re / 6.0 - sound[k]).abs() < 1e-12));
//! # Ok::<(), realfft::FftError>(())
//! ```
#![allow(clippy::disallowed_types)] // The planners below are those that all others use.

use realfft::{ComplexToReal, RealToComplex};
use rustfft::{Fft, FftNum};
use std::sync::Arc;

/// Plans of transforms of one type, forward as `F` and inverse as `I`.
trait Plans<F: ?Sized, I: ?Sized>: Send {
    fn forward(&mut self, len: usize) -> Arc<F>;
    fn inverse(&mut self, len: usize) -> Arc<I>;
}

/// Plans transforms, and shares what plans of several lengths have in common.
pub struct Planner<F: ?Sized, I: ?Sized>(Box<dyn Plans<F, I>>);

/// Plans from `len` real samples to `len / 2 + 1` complex numbers and back, as `realfft::RealFftPlanner`.
pub type RealFftPlanner<T> = Planner<dyn RealToComplex<T>, dyn ComplexToReal<T>>;

/// Plans of `len` complex numbers, as `rustfft::FftPlanner`.
pub type FftPlanner<T> = Planner<dyn Fft<T>, dyn Fft<T>>;

impl<F: ?Sized, I: ?Sized> Planner<F, I> {
    /// The plan forward; not normalized.
    pub fn plan_fft_forward(&mut self, len: usize) -> Arc<F> {
        self.0.forward(len)
    }

    /// The plan of the inverse: `len` times the input of the forward transform.
    pub fn plan_fft_inverse(&mut self, len: usize) -> Arc<I> {
        self.0.inverse(len)
    }
}

/// A number that transforms are compiled for.
pub trait Sample: FftNum {
    /// A planner of real transforms without plans.
    fn real() -> RealFftPlanner<Self>;
    /// A planner of complex transforms without plans.
    fn complex() -> FftPlanner<Self>;
}

#[allow(clippy::new_without_default)] // As the planners that these stand for.
impl<T: Sample> RealFftPlanner<T> {
    /// A planner without plans.
    #[must_use]
    pub fn new() -> Self {
        T::real()
    }
}

#[allow(clippy::new_without_default)]
impl<T: Sample> FftPlanner<T> {
    /// A planner without plans.
    #[must_use]
    pub fn new() -> Self {
        T::complex()
    }
}

macro_rules! plans {
    ($planner:ty, $forward:ty, $inverse:ty) => {
        impl Plans<$forward, $inverse> for $planner {
            fn forward(&mut self, len: usize) -> Arc<$forward> {
                self.plan_fft_forward(len)
            }
            fn inverse(&mut self, len: usize) -> Arc<$inverse> {
                self.plan_fft_inverse(len)
            }
        }
    };
}

macro_rules! sample {
    ($t:ty) => {
        plans!(realfft::RealFftPlanner<$t>, dyn RealToComplex<$t>, dyn ComplexToReal<$t>);
        plans!(rustfft::FftPlanner<$t>, dyn Fft<$t>, dyn Fft<$t>);

        impl Sample for $t {
            fn real() -> RealFftPlanner<$t> {
                Planner(Box::new(realfft::RealFftPlanner::new()))
            }
            fn complex() -> FftPlanner<$t> {
                Planner(Box::new(rustfft::FftPlanner::new()))
            }
        }
    };
}

sample!(f32);
sample!(f64);
