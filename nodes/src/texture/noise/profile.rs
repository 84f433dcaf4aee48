//! Noise profiles: rows of a noise map, joined to a closed loop.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2: a stored excitation profile of known velocity and scale.

use crate::texture::holes::{row_segments, valid_samples};
use crate::texture::maps::{NoiseMap, NoiseProfile};
use half::f16;
use std::f32::consts::FRAC_PI_2;

/// Default length of a profile in samples: 16 kB in 16 bits.
pub const PROFILE: usize = 8192;
/// Maximum length of a crossfade, in samples.
const FADE: usize = 32;
/// Maximum gain that normalises the power of a segment: a much weaker one is hardly noise.
const MAX_GAIN: f64 = 8.0;

/// Makes a profile of `count` samples, at the spacing of the map's columns and with its variance, quantised to 16 bits.
///
/// Evenly spaced rows of the map are read in alternating directions. All are normalised to the same power, because the position on
/// the profile is unrelated to the position on the surface: a row along a joint of tiles would be a metre of other noise. Successive
/// rows, and the last and the first, are joined by equal-power crossfades, as they are uncorrelated. Holes divide a row into
/// segments.
///
/// # Complexity
/// `O(count)`.
#[must_use]
pub fn profile(noise: &NoiseMap, count: usize) -> NoiseProfile {
    let spacing = 1.0 / noise.surface.density[0];
    let rows = Rows::new(noise);
    if rows.rows.is_empty() || count == 0 {
        return NoiseProfile { samples: vec![0.0; count], spacing, ..NoiseProfile::default() };
    }
    let power = variance(valid_samples(&noise.grid, &noise.holes));
    let mut line = rows.zigzag(count + rows.fade, power);
    close(&mut line, rows.fade);
    line.truncate(count);
    set_variance(&mut line, power);
    line.iter_mut().for_each(|x| *x = stored(*x).to_f32());
    NoiseProfile { samples: line, spacing, ..NoiseProfile::default() }
}

/// Converts a sample to 16 bits, clamped to the finite range.
pub(in crate::texture) fn stored(x: f32) -> f16 {
    f16::from_f32(x.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
}

/// The rows of a map that are not empty, each with its segments between holes that are long enough for two crossfades.
struct Rows<'a> {
    rows: Vec<Vec<&'a [f32]>>,
    /// Length of a crossfade, in samples.
    fade: usize,
}

impl<'a> Rows<'a> {
    fn new(noise: &'a NoiseMap) -> Self {
        let mut rows: Vec<_> =
            (0..noise.grid.height).map(|y| row_segments(&noise.grid, &noise.holes, y)).collect();
        let longest = rows.iter().flatten().map(|segment| segment.len()).max().unwrap_or(0);
        let fade = FADE.min(longest / 4);
        rows.iter_mut().for_each(|row| row.retain(|segment| segment.len() > 2 * fade));
        rows.retain(|row| !row.is_empty());
        Self { rows, fade }
    }

    /// Joins rows in alternating directions to `count` samples; each segment has the mean square `power`.
    fn zigzag(&self, count: usize, power: f64) -> Vec<f32> {
        let total: usize = self.rows.iter().flatten().map(|segment| segment.len() - self.fade).sum();
        let rows = (count * self.rows.len()).div_ceil(total.max(1)).max(1);
        let mut line: Vec<f32> = Vec::with_capacity(count + FADE);
        for k in (0..=rows).cycle() {
            // Evenly spaced; if more rows are needed than there are, they repeat.
            let y = ((2 * k + 1) * self.rows.len() / (2 * rows + 2)).min(self.rows.len() - 1);
            let row = self.rows.get(y).map(Vec::as_slice).unwrap_or_default();
            for j in 0..row.len() {
                let reversed = k % 2 == 1;
                let mut segment = row[if reversed { row.len() - 1 - j } else { j }].to_vec();
                if reversed {
                    segment.reverse();
                }
                normalise(&mut segment, power);
                append(&mut line, &segment, self.fade);
            }
            if line.len() >= count {
                break;
            }
        }
        line.truncate(count);
        line
    }
}

/// Scales a segment to a mean square, with a gain of at most [`MAX_GAIN`].
fn normalise(segment: &mut [f32], power: f64) {
    let own = segment.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / segment.len().max(1) as f64;
    let gain = if own > 0.0 { (power / own).sqrt().min(MAX_GAIN) as f32 } else { 0.0 };
    segment.iter_mut().for_each(|x| *x *= gain);
}

/// Appends a segment, with a crossfade from the end of the line over `fade` samples.
fn append(line: &mut Vec<f32>, segment: &[f32], fade: usize) {
    let fade = if line.is_empty() { 0 } else { fade };
    let tail = line.len().saturating_sub(fade);
    let (head, rest) = segment.split_at_checked(fade).unwrap_or((segment, &[]));
    for (k, (out, into)) in line.iter_mut().skip(tail).zip(head).enumerate() {
        *out = crossfade(*out, *into, k, fade);
    }
    line.extend_from_slice(rest);
}

/// Crossfades the last `fade` samples into the first ones. The loop then ends before those last samples.
fn close(line: &mut [f32], fade: usize) {
    let end = line.len().saturating_sub(fade);
    let (body, tail) = line.split_at_mut(end);
    for (k, (out, from)) in body.iter_mut().zip(tail).enumerate() {
        *out = crossfade(*from, *out, k, fade);
    }
}

/// Sample `k` of an equal-power crossfade of `fade` samples.
fn crossfade(from: f32, into: f32, k: usize, fade: usize) -> f32 {
    let angle = FRAC_PI_2 * (k as f32 + 0.5) / fade as f32;
    from * angle.cos() + into * angle.sin()
}

/// Returns the variance of samples.
#[must_use]
pub fn variance(samples: impl Iterator<Item = f32> + Clone) -> f64 {
    let n = samples.clone().count().max(1) as f64;
    let mean = samples.clone().map(f64::from).sum::<f64>() / n;
    samples.map(|x| (f64::from(x) - mean).powi(2)).sum::<f64>() / n
}

/// Subtracts the mean and scales to a variance.
pub(super) fn set_variance(line: &mut [f32], wanted: f64) {
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
        // Neighbours along x are correlated, so that a seam would show.
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
    fn the_loop_has_no_seams() {
        let profile = profile(&map(512, 512), PROFILE).samples;
        let steps: Vec<f32> =
            (0..PROFILE).map(|k| (profile[(k + 1) % PROFILE] - profile[k]).powi(2)).collect();
        let mean = steps.iter().sum::<f32>() / PROFILE as f32;
        // No run of 16 steps, also across the end of the loop, has more than three times the mean power.
        for k in 0..PROFILE {
            let part = (0..16).map(|j| steps[(k + j) % PROFILE]).sum::<f32>() / 16.0;
            assert!(part < 3.0 * mean, "{k}: {part} {mean}");
        }
    }

    #[test]
    fn the_seam_test_detects_an_open_seam() {
        let mut line = profile(&map(512, 512), PROFILE).samples;
        line[0] += 8.0;
        let first = (line[0] - line[PROFILE - 1]).powi(2);
        let mean = line.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f32>() / PROFILE as f32;
        assert!(first / 16.0 > 3.0 * mean);
    }

    #[test]
    fn crossfades_have_constant_power() {
        for k in 0..32 {
            let (a, b) = (crossfade(1.0, 0.0, k, 32), crossfade(0.0, 1.0, k, 32));
            assert!((a * a + b * b - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_profile_of_a_map_of_zeros_is_zero() {
        let grid = Grid::from_fn(64, 64, |_, _| 0.0);
        let quiet = profile(&NoiseMap { grid, holes: Vec::new(), surface: Surface::default() }, 256);
        assert!(quiet.samples.iter().all(|x| *x == 0.0));
    }

    #[test]
    fn holes_are_no_part_of_the_profile() {
        let half = map(256, 256);
        let grid = Grid::from_fn(512, 256, |x, y| if x < 256 { half.grid.samples[256 * y + x] } else { 0.0 });
        let holes: Vec<bool> = (0..512 * 256).map(|k| k % 512 >= 256).collect();
        let wide = NoiseMap { grid, holes: holes.clone(), surface: half.surface };
        assert_eq!(profile(&wide, PROFILE), profile(&half, PROFILE), "half a hole is the other half");
        let all = NoiseMap { holes: vec![true; 512 * 256], ..wide.clone() };
        assert_eq!(profile(&all, 100).samples, vec![0.0; 100]);
        // Lace: only short segments, some of them too short for crossfades, and empty rows.
        let lace: Vec<bool> = (0..512 * 256).map(|k| k / 512 % 3 == 0 || k % 23 < 1 + k / 512 % 20).collect();
        let lace = NoiseMap { holes: lace, ..map(512, 256) };
        let line = profile(&lace, PROFILE).samples;
        let right = variance(valid_samples(&lace.grid, &lace.holes));
        assert!(line.len() == PROFILE && (variance(line.iter().copied()) / right - 1.0).abs() < 0.02);
    }

    #[test]
    fn every_metre_of_the_profile_has_the_power_of_all_of_it() {
        // Tiles: noise mostly along their joints, which only some rows of the map cross.
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
