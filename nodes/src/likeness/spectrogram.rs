//! A picture of a sound over time and logarithmic frequency.

use super::active::{ActiveSound, hann};
use crate::plot::Image;
use foley_fft::RealFftPlanner;

/// Width and height, px.
const SIZE: [usize; 2] = [900, 300];
/// Range from white to black, dB.
const RANGE: f64 = 70.0;
/// Transforms for a column at most.
const FRAMES: usize = 4;
/// Duration of a frame, s.
const FRAME: f64 = 0.02;

/// Grey picture from a lowest to a highest frequency in Hz, low levels white; `None` for an empty range or sound.
///
/// # Complexity
/// O(columns frame log frame).
pub(super) fn spectrogram(sound: &ActiveSound, [low, high]: [f64; 2]) -> Option<Image> {
    let ([width, height], x) = (SIZE, &sound.samples[..]);
    let is_empty = !(0.0 < low && low < high) || x.is_empty();
    if is_empty {
        return None;
    }
    let frame = ((FRAME * sound.rate) as usize).next_power_of_two().max(16);
    let plan = RealFftPlanner::<f32>::new().plan_fft_forward(frame);
    let (mut time, mut bins) = (plan.make_input_vec(), plan.make_output_vec());
    let hann = hann(frame);
    let bin = |row: f64| {
        let hz = high * (low / high).powf(row / height as f64);
        hz * frame as f64 / sound.rate
    };
    let mut power = vec![0.0_f64; width * height];
    let step = x.len() as f64 / width as f64;
    let count = (step / (frame / 2) as f64).ceil().clamp(1.0, FRAMES as f64) as usize;
    let mut mean = vec![0.0; bins.len()];
    for column in 0..width {
        mean.fill(0.0);
        for k in 0..count {
            let middle = ((column as f64 + (k as f64 + 0.5) / count as f64) * step) as usize;
            for ((n, t), w) in time.iter_mut().enumerate().zip(&hann) {
                let at = (middle + n).checked_sub(frame / 2);
                *t = at.and_then(|at| x.get(at)).map_or(0.0, |x| x * w);
            }
            if plan.process(&mut time, &mut bins).is_ok() {
                mean.iter_mut().zip(&bins).for_each(|(m, z)| *m += f64::from(z.norm_sqr()));
            }
        }
        for row in 0..height {
            // The loudest bin of a row, or the nearest.
            let (from, to) = (bin(row as f64 + 1.0).round() as usize, bin(row as f64).round() as usize);
            let last = mean.len() - 1;
            let rows = &mean[from.min(last)..=to.min(last)];
            power[row * width + column] = rows.iter().copied().fold(0.0, f64::max);
        }
    }
    let loudest = power.iter().copied().fold(1e-20, f64::max);
    let grey = |p: &f64| {
        let below = 10.0 * (loudest / p.max(1e-30)).log10();
        (255.0 * (below / RANGE).clamp(0.0, 1.0)).round() as u8
    };
    Image::grey(SIZE, &power.iter().map(grey).collect::<Vec<u8>>())
}
