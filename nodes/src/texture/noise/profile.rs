//! One line of noise out of a noise map, closed to a loop.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2: a stored excitation profile of known velocity and scale.

use crate::texture::holes::{row_segments, valid_samples};
use crate::texture::maps::{NoiseMap, NoiseProfile};
use half::f16;
use std::f32::consts::FRAC_PI_2;

/// Samples of a stored profile: 16 kB in 16 bits.
pub const PROFILE: usize = 8192;
/// Samples over which one line goes over into the next.
const JOIN: usize = 32;
/// Most by which a part of a line is amplified so that all are alike: what is fainter by far is hardly noise.
const MOST_EVEN: f64 = 8.0;

/// A profile of `count` samples at the spacing of the map's columns, of the variance of the map, to 16 bits.
///
/// Rows evenly spread over the map are read to and fro. All are made equally strong, for where on the line a contact is says nothing of
/// where it is on the surface: a row along a joint of tiles would be a metre of other noise. Each goes over into the next, and the last into the first, by cross-fades
/// of equal power: the parts have nothing to do with each other. Holes are passed over: what lies between two of them is a part.
///
/// # Complexity
/// `O(count)`.
#[must_use]
pub fn profile(noise: &NoiseMap, count: usize) -> NoiseProfile {
    let spacing = 1.0 / noise.surface.density[0];
    let rows = Rows::new(noise);
    if rows.lines.is_empty() || count == 0 {
        return NoiseProfile { samples: vec![0.0; count], spacing };
    }
    let power = variance(valid_samples(&noise.grid, &noise.holes));
    let mut line = rows.zigzag(count + rows.join, power);
    close(&mut line, rows.join);
    line.truncate(count);
    level(&mut line, power);
    line.iter_mut().for_each(|x| *x = stored(*x).to_f32());
    NoiseProfile { samples: line, spacing }
}

/// A sample as it is stored, in 16 bits; those too large become the greatest finite one.
pub(in crate::texture) fn stored(x: f32) -> f16 {
    f16::from_f32(x.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
}

/// The rows of a map that have anything to read: of each its stretches between holes, but those too short to join.
struct Rows<'a> {
    lines: Vec<Vec<&'a [f32]>>,
    /// Samples over which one stretch goes over into the next.
    join: usize,
}

impl<'a> Rows<'a> {
    fn new(noise: &'a NoiseMap) -> Self {
        let mut lines: Vec<_> =
            (0..noise.grid.height).map(|y| row_segments(&noise.grid, &noise.holes, y)).collect();
        let longest = lines.iter().flatten().map(|line| line.len()).max().unwrap_or(0);
        let join = JOIN.min(longest / 4);
        lines.iter_mut().for_each(|line| line.retain(|part| part.len() > 2 * join));
        lines.retain(|line| !line.is_empty());
        Self { lines, join }
    }

    /// `count` samples of rows that are read to and fro, each of a mean square.
    fn zigzag(&self, count: usize, power: f64) -> Vec<f32> {
        let each: usize = self.lines.iter().flatten().map(|part| part.len() - self.join).sum();
        let rows = (count * self.lines.len()).div_ceil(each.max(1)).max(1);
        let mut line: Vec<f32> = Vec::with_capacity(count + JOIN);
        for k in (0..=rows).cycle() {
            // Spread evenly; where more rows are needed than there are, they come again in between.
            let y = ((2 * k + 1) * self.lines.len() / (2 * rows + 2)).min(self.lines.len() - 1);
            let row = self.lines.get(y).map(Vec::as_slice).unwrap_or_default();
            for j in 0..row.len() {
                let back = k % 2 == 1;
                let mut part = row[if back { row.len() - 1 - j } else { j }].to_vec();
                if back {
                    part.reverse();
                }
                even(&mut part, power);
                append(&mut line, &part, self.join);
            }
            if line.len() >= count {
                break;
            }
        }
        line.truncate(count);
        line
    }
}

/// Gives a part a mean square, as far as [`MOST_EVEN`] goes.
fn even(part: &mut [f32], power: f64) {
    let own = part.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / part.len().max(1) as f64;
    let gain = if own > 0.0 { (power / own).sqrt().min(MOST_EVEN) as f32 } else { 0.0 };
    part.iter_mut().for_each(|x| *x *= gain);
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
pub fn variance(samples: impl Iterator<Item = f32> + Clone) -> f64 {
    let n = samples.clone().count().max(1) as f64;
    let mean = samples.clone().map(f64::from).sum::<f64>() / n;
    samples.map(|x| (f64::from(x) - mean).powi(2)).sum::<f64>() / n
}

/// Takes the mean away and scales to a variance.
pub(super) fn level(line: &mut [f32], wanted: f64) {
    let mean = (line.iter().map(|x| f64::from(*x)).sum::<f64>() / line.len().max(1) as f64) as f32;
    let found = variance(line.iter().copied());
    let gain = if found > 0.0 { (wanted / found).sqrt() as f32 } else { 0.0 };
    line.iter_mut().for_each(|x| *x = (*x - mean) * gain);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::texture::{Grid, Surface};

    fn map(width: usize, height: usize) -> NoiseMap {
        let mut rng = Rng::new(13);
        // Neighbours along x resemble each other, so that a seam would show.
        let mut x = 0.0;
        let grid = Grid::from_fn(width, height, |_, _| {
            x = 0.9 * x + rng.between(-1.0, 1.0);
            x as f32
        });
        NoiseMap { grid, holes: Vec::new(), surface: Surface::default() }
    }

    #[test]
    fn the_profile_has_the_variance_of_the_map_and_its_spacing() {
        for (width, height) in [(512, 512), (300, 40), (64, 64), (3, 2), (1, 1)] {
            let map = map(width, height);
            let profile = profile(&map, PROFILE);
            assert_eq!((profile.samples.len(), profile.spacing), (PROFILE, 1.0 / 512.0));
            let (ours, right) =
                (variance(profile.samples.iter().copied()), variance(map.grid.samples.iter().copied()));
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
        let quiet = profile(&NoiseMap { grid, holes: Vec::new(), surface: Surface::default() }, 256);
        assert!(quiet.samples.iter().all(|x| *x == 0.0));
    }

    #[test]
    fn holes_are_no_part_of_the_line() {
        let half = map(256, 256);
        let grid = Grid::from_fn(512, 256, |x, y| if x < 256 { half.grid.samples[256 * y + x] } else { 0.0 });
        let holes: Vec<bool> = (0..512 * 256).map(|k| k % 512 >= 256).collect();
        let wide = NoiseMap { grid, holes: holes.clone(), surface: half.surface };
        assert_eq!(profile(&wide, PROFILE), profile(&half, PROFILE), "half a hole is the other half");
        let all = NoiseMap { holes: vec![true; 512 * 256], ..wide.clone() };
        assert_eq!(profile(&all, 100).samples, vec![0.0; 100]);
        // Lace: only short stretches, some of them too short to join, and rows without any.
        let lace: Vec<bool> = (0..512 * 256).map(|k| k / 512 % 3 == 0 || k % 23 < 1 + k / 512 % 20).collect();
        let lace = NoiseMap { holes: lace, ..map(512, 256) };
        let line = profile(&lace, PROFILE).samples;
        let right = variance(valid_samples(&lace.grid, &lace.holes));
        assert!(line.len() == PROFILE && (variance(line.iter().copied()) / right - 1.0).abs() < 0.02);
    }

    #[test]
    fn every_metre_of_the_line_is_as_strong_as_all_of_it() {
        // Tiles: noise mostly along their joints, and rows of the map meet them or do not.
        let mut rng = Rng::new(14);
        let grid = Grid::from_fn(512, 512, |x, y| {
            let joint = x % 64 < 3 || y % 32 == 15;
            (if joint { 4.0 } else { 0.5 }) * rng.between(-1.0, 1.0) as f32
        });
        let line =
            profile(&NoiseMap { grid, holes: Vec::new(), surface: Surface::default() }, PROFILE).samples;
        let whole = variance(line.iter().copied());
        for part in line.chunks_exact(512) {
            let level = 10.0 * (variance(part.iter().copied()) / whole).log10();
            assert!(level.abs() < 1.5, "{level} dB");
        }
    }
}
