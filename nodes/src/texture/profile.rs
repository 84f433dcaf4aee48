//! One line of noise out of a noise map, closed to a loop.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2: a stored excitation profile of known velocity and scale.

use super::item::{Grid, NoiseMap, NoiseProfile};
use half::f16;
use std::f32::consts::FRAC_PI_2;

/// Samples of a stored profile: 16 kB in 16 bits.
pub const PROFILE: usize = 8192;
/// Samples over which one line goes over into the next.
const JOIN: usize = 32;

/// A profile of `count` samples at the spacing of the map's columns, of the variance of the map, to 16 bits.
///
/// Rows evenly spread over the map are read to and fro. Each goes over into the next, and the last into the first, by cross-fades
/// of equal power: the parts have nothing to do with each other.
///
/// # Complexity
/// `O(count)`.
#[must_use]
pub fn profile(noise: &NoiseMap, count: usize) -> NoiseProfile {
    let spacing = 1.0 / noise.surface.density[0];
    let map = &noise.grid;
    let join = JOIN.min(map.width / 4);
    if map.samples.is_empty() || count == 0 {
        return NoiseProfile { samples: vec![0.0; count], spacing };
    }
    let mut line = zigzag(map, count + join, join);
    close(&mut line, join);
    line.truncate(count);
    level(&mut line, variance(&map.samples));
    line.iter_mut().for_each(|x| *x = stored(*x).to_f32());
    NoiseProfile { samples: line, spacing }
}

/// A sample as it is stored, in 16 bits; those too large become the greatest finite one.
pub(super) fn stored(x: f32) -> f16 {
    f16::from_f32(x.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
}

/// At least `count` samples of rows that are read to and fro.
fn zigzag(map: &Grid, count: usize, join: usize) -> Vec<f32> {
    let each = (map.width - join).max(1);
    let rows = count.div_ceil(each).max(1);
    let mut line: Vec<f32> = Vec::with_capacity(count + map.width);
    for k in 0..=rows {
        // Spread evenly; where more rows are needed than there are, they come again in between.
        let y = ((2 * k + 1) * map.height / (2 * rows + 2)).min(map.height - 1);
        let row = map.samples.get(y * map.width..(y + 1) * map.width).unwrap_or_default();
        let mut row: Vec<f32> = row.to_vec();
        if k % 2 == 1 {
            row.reverse();
        }
        append(&mut line, &row, join);
        if line.len() >= count {
            break;
        }
    }
    line.truncate(count);
    line
}

/// Adds a row, the first `join` samples of which fade in while the last of the line fade out.
fn append(line: &mut Vec<f32>, row: &[f32], join: usize) {
    let join = if line.is_empty() { 0 } else { join };
    let tail = line.len().saturating_sub(join);
    let (head, rest) = row.split_at_checked(join).unwrap_or((row, &[]));
    for (k, (out, into)) in line.iter_mut().skip(tail).zip(head).enumerate() {
        *out = cross(*out, *into, k, join);
    }
    line.extend_from_slice(rest);
}

/// Fades the last `join` samples into the first, which then follow the one before those last.
fn close(line: &mut [f32], join: usize) {
    let at = line.len().saturating_sub(join);
    let (body, tail) = line.split_at_mut(at);
    for (k, (out, from)) in body.iter_mut().zip(tail).enumerate() {
        *out = cross(*from, *out, k, join);
    }
}

fn cross(from: f32, into: f32, k: usize, join: usize) -> f32 {
    let angle = FRAC_PI_2 * (k as f32 + 0.5) / join as f32;
    from * angle.cos() + into * angle.sin()
}

/// Mean square about the mean.
#[must_use]
pub fn variance(samples: &[f32]) -> f64 {
    let n = samples.len().max(1) as f64;
    let mean = samples.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
    samples.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>() / n
}

/// Takes the mean away and scales to a variance.
pub(super) fn level(line: &mut [f32], wanted: f64) {
    let mean = (line.iter().map(|x| f64::from(*x)).sum::<f64>() / line.len().max(1) as f64) as f32;
    let found = variance(line);
    let gain = if found > 0.0 { (wanted / found).sqrt() as f32 } else { 0.0 };
    line.iter_mut().for_each(|x| *x = (*x - mean) * gain);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Draw;
    use crate::texture::item::Surface;

    fn map(width: usize, height: usize) -> NoiseMap {
        let mut draw = Draw::new(13);
        // Neighbours along x resemble each other, so that a seam would show.
        let mut x = 0.0;
        let grid = Grid::from_fn(width, height, |_, _| {
            x = 0.9 * x + draw.between(-1.0, 1.0);
            x as f32
        });
        NoiseMap { grid, surface: Surface::default() }
    }

    #[test]
    fn the_profile_has_the_variance_of_the_map_and_its_spacing() {
        for (width, height) in [(512, 512), (300, 40), (64, 64), (3, 2), (1, 1)] {
            let map = map(width, height);
            let profile = profile(&map, PROFILE);
            assert_eq!((profile.samples.len(), profile.spacing), (PROFILE, 1.0 / 512.0));
            let (ours, right) = (variance(&profile.samples), variance(&map.grid.samples));
            assert!((ours - right).abs() <= 0.02 * right, "{width}x{height}: {ours} {right}");
        }
    }

    #[test]
    fn no_seam_stands_out_of_the_loop() {
        let profile = profile(&map(512, 512), PROFILE).samples;
        let steps: Vec<f32> =
            (0..PROFILE).map(|k| (profile[(k + 1) % PROFILE] - profile[k]).powi(2)).collect();
        let mean = steps.iter().sum::<f32>() / PROFILE as f32;
        // Around the end of the loop, and everywhere: no stretch of 16 steps has more than three times the mean power.
        for k in 0..PROFILE {
            let part = (0..16).map(|j| steps[(k + j) % PROFILE]).sum::<f32>() / 16.0;
            assert!(part < 3.0 * mean, "{k}: {part} {mean}");
        }
    }

    #[test]
    fn a_seam_that_is_not_closed_would_be_found() {
        let mut line = profile(&map(512, 512), PROFILE).samples;
        line[0] += 8.0;
        let first = (line[0] - line[PROFILE - 1]).powi(2);
        let mean = line.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f32>() / PROFILE as f32;
        assert!(first / 16.0 > 3.0 * mean);
    }

    #[test]
    fn cross_fades_keep_the_power() {
        for k in 0..32 {
            let (a, b) = (cross(1.0, 0.0, k, 32), cross(0.0, 1.0, k, 32));
            assert!((a * a + b * b - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn silence_stays_silent() {
        let grid = Grid::from_fn(64, 64, |_, _| 0.0);
        let quiet = profile(&NoiseMap { grid, surface: Surface::default() }, 256);
        assert!(quiet.samples.iter().all(|x| *x == 0.0));
    }
}
