//! Vectors of sixteen modes: their coefficients, states and input gains.

use serde::{Deserialize, Serialize};

/// Modes in one vector.
pub(crate) const LANES: usize = 16;
/// Samples between two updates of the coefficients, and the maximum length of a block.
pub(crate) const GRID: usize = 64;

/// Coefficients and state of sixteen modes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[repr(align(64))]
pub(crate) struct Lanes {
    /// Real part of one step, less 1.
    pub less_one: [f32; LANES],
    /// Imaginary part of one step.
    pub sin: [f32; LANES],
    /// Real part of the state.
    pub re: [f32; LANES],
    /// Imaginary part of the state; the output is the sum of these.
    pub im: [f32; LANES],
}

impl Lanes {
    /// Modes at rest.
    pub const SILENT: Self =
        Self { less_one: [0.0; LANES], sin: [0.0; LANES], re: [0.0; LANES], im: [0.0; LANES] };

    /// Returns states after some samples without a force, by repeated squaring of one step.
    #[inline(always)]
    pub fn after(&self, re: &[f32; LANES], im: &[f32; LANES], mut samples: usize) -> [[f32; LANES]; 2] {
        let (mut re, mut im) = (re.map(f64::from), im.map(f64::from));
        let (mut x, mut y) = (self.less_one.map(|x| 1.0 + f64::from(x)), self.sin.map(f64::from));
        while samples > 0 {
            for l in 0..LANES {
                let (a, b) = (re[l], im[l]);
                if samples & 1 == 1 {
                    (re[l], im[l]) = (a * x[l] - b * y[l], a * y[l] + b * x[l]);
                }
                (x[l], y[l]) = (x[l] * x[l] - y[l] * y[l], 2.0 * x[l] * y[l]);
            }
            samples >>= 1;
        }
        [re.map(|x| x as f32), im.map(|x| x as f32)]
    }

    /// Returns true if the squared magnitudes of all states lie between two numbers.
    #[inline(always)]
    pub fn all_within(&self, low: f32, high: f32) -> bool {
        let mut within = [false; LANES];
        for ((within, re), im) in within.iter_mut().zip(&self.re).zip(&self.im) {
            let size = re * re + im * im;
            *within = (size > low) & (size < high);
        }
        within == [true; LANES]
    }
}

/// Input gains of sixteen modes at one contact point.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[repr(align(64))]
pub(crate) struct InputGain {
    /// Change of the real part for a force of 1.
    pub re: [f32; LANES],
    /// Change of the imaginary part.
    pub im: [f32; LANES],
}
