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
use std::fmt;
use std::sync::Arc;

/// Plans of real transforms of one type.
pub trait RealPlans<T>: Send {
    /// The plan from `len` samples to `len / 2 + 1` complex numbers.
    fn forward(&mut self, len: usize) -> Arc<dyn RealToComplex<T>>;
    /// The plan from `len / 2 + 1` complex numbers to `len` samples.
    fn inverse(&mut self, len: usize) -> Arc<dyn ComplexToReal<T>>;
}

/// Plans of complex transforms of one type.
pub trait ComplexPlans<T>: Send {
    /// The plan forward.
    fn forward(&mut self, len: usize) -> Arc<dyn Fft<T>>;
    /// The plan of the inverse.
    fn inverse(&mut self, len: usize) -> Arc<dyn Fft<T>>;
}

/// A number that transforms are compiled for.
pub trait Sample: FftNum {
    /// New plans of real transforms.
    fn real() -> Box<dyn RealPlans<Self>>;
    /// New plans of complex transforms.
    fn complex() -> Box<dyn ComplexPlans<Self>>;
}

macro_rules! sample {
    ($t:ty) => {
        impl RealPlans<$t> for realfft::RealFftPlanner<$t> {
            fn forward(&mut self, len: usize) -> Arc<dyn RealToComplex<$t>> {
                self.plan_fft_forward(len)
            }
            fn inverse(&mut self, len: usize) -> Arc<dyn ComplexToReal<$t>> {
                self.plan_fft_inverse(len)
            }
        }

        impl ComplexPlans<$t> for rustfft::FftPlanner<$t> {
            fn forward(&mut self, len: usize) -> Arc<dyn Fft<$t>> {
                self.plan_fft_forward(len)
            }
            fn inverse(&mut self, len: usize) -> Arc<dyn Fft<$t>> {
                self.plan_fft_inverse(len)
            }
        }

        impl Sample for $t {
            fn real() -> Box<dyn RealPlans<$t>> {
                Box::new(realfft::RealFftPlanner::new())
            }
            fn complex() -> Box<dyn ComplexPlans<$t>> {
                Box::new(rustfft::FftPlanner::new())
            }
        }
    };
}

sample!(f32);
sample!(f64);

/// Plans real transforms, and shares what plans of several lengths have in common; as `realfft::RealFftPlanner`.
pub struct RealFftPlanner<T: Sample>(Box<dyn RealPlans<T>>);

impl<T: Sample> RealFftPlanner<T> {
    /// A planner without plans.
    #[must_use]
    pub fn new() -> Self {
        Self(T::real())
    }

    /// The plan from `len` samples to `len / 2 + 1` complex numbers; not normalized.
    pub fn plan_fft_forward(&mut self, len: usize) -> Arc<dyn RealToComplex<T>> {
        self.0.forward(len)
    }

    /// The plan from `len / 2 + 1` complex numbers to `len` samples; `len` times the input of the forward transform.
    pub fn plan_fft_inverse(&mut self, len: usize) -> Arc<dyn ComplexToReal<T>> {
        self.0.inverse(len)
    }
}

impl<T: Sample> Default for RealFftPlanner<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Sample> fmt::Debug for RealFftPlanner<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RealFftPlanner")
    }
}

/// Plans complex transforms, and shares what plans of several lengths have in common; as `rustfft::FftPlanner`.
pub struct FftPlanner<T: Sample>(Box<dyn ComplexPlans<T>>);

impl<T: Sample> FftPlanner<T> {
    /// A planner without plans.
    #[must_use]
    pub fn new() -> Self {
        Self(T::complex())
    }

    /// The plan of `len` complex numbers; not normalized.
    pub fn plan_fft_forward(&mut self, len: usize) -> Arc<dyn Fft<T>> {
        self.0.forward(len)
    }

    /// The plan of the inverse: `len` times the input of the forward transform.
    pub fn plan_fft_inverse(&mut self, len: usize) -> Arc<dyn Fft<T>> {
        self.0.inverse(len)
    }
}

impl<T: Sample> Default for FftPlanner<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Sample> fmt::Debug for FftPlanner<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("FftPlanner")
    }
}
