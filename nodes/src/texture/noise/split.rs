//! Noise of a texture, the residual of an image without its main features, and its statistics.
//!
//! # Source
//! Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2.

use crate::texture::grid::Grid;
use crate::texture::holes::{is_hole, valid_samples};

/// Statistics of a noise map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseStatistics {
    /// Mean square, in luminance squared.
    pub variance: f64,
    /// Power of the differences along rows over that along columns: 1 for isotropic noise.
    pub isotropy: f64,
    /// Largest over smallest variance of 8 by 8 tiles: 1 for stationary noise.
    pub stationarity: f64,
    /// Fourth moment over the squared second moment: 3 for normal noise.
    pub kurtosis: f64,
}

impl NoiseStatistics {
    /// Returns a warning if the noise is not stationary or not isotropic.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let uneven = self.stationarity > 4.0;
        let directed = !(0.5..=2.0).contains(&self.isotropy) && self.variance > 0.0;
        let reason = match (uneven, directed) {
            (false, false) => return None,
            (true, false) => {
                format!("its variance differs by a factor of {:.1} over the image", self.stationarity)
            }
            (false, true) => format!("it has a direction: {:.2} times the power along rows", self.isotropy),
            (true, true) => format!(
                "its variance differs by a factor of {:.1} over the image, and it has a direction: {:.2} times the power along rows",
                self.stationarity, self.isotropy
            ),
        };
        Some(format!("the noise is not the same everywhere, as a single profile of it assumes: {reason}"))
    }
}

/// Returns `(luma - smooth) (1 - features)` less its mean; 0 in holes.
///
/// # Shapes
/// All grids have the same size; `features` are optional.
#[must_use]
pub fn noise(luma: &Grid, smooth: &Grid, features: Option<&Grid>, holes: &[bool]) -> Grid {
    let mut samples: Vec<f32> = luma.samples.iter().zip(&smooth.samples).map(|(l, s)| l - s).collect();
    if let Some(features) = features {
        samples.iter_mut().zip(&features.samples).for_each(|(n, f)| *n *= 1.0 - f);
    }
    let grid = Grid { samples, ..*luma };
    let (sum, count) =
        valid_samples(&grid, holes).fold((0.0, 0_usize), |(sum, n), x| (sum + f64::from(x), n + 1));
    let mean = (sum / count.max(1) as f64) as f32;
    let level = |(k, x): (usize, &f32)| if is_hole(holes, k) { 0.0 } else { *x - mean };
    Grid { samples: grid.samples.iter().enumerate().map(level).collect(), ..grid }
}

fn mean_square(values: impl Iterator<Item = f32>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, n), x| (sum + f64::from(x) * f64::from(x), n + 1));
    sum / count.max(1) as f64
}

/// Returns the statistics of a noise map, without holes.
///
/// Differences count if neither pixel is a hole, and tiles if at most half of their pixels are holes.
///
/// # Complexity
/// `O(pixels)`.
#[must_use]
pub fn statistics(map: &Grid, holes: &[bool]) -> NoiseStatistics {
    let (width, height) = (map.width.max(1), map.height);
    let variance = mean_square(valid_samples(map, holes));
    let change = |k: usize, step: usize| {
        let both = !is_hole(holes, k) && !is_hole(holes, k + step);
        both.then(|| map.samples.get(k + step).map(|next| next - map.samples[k]))?
    };
    let all = 0..map.samples.len();
    let along = mean_square(all.clone().filter(|k| (k + 1) % width != 0).filter_map(|k| change(k, 1)));
    let down = mean_square(all.filter_map(|k| change(k, width)));
    let fourth = mean_square(valid_samples(map, holes).map(|x| x * x));
    let tiles = (0..64).map(|k| (k % 8, k / 8)).filter_map(|(i, j)| {
        let (x, y) = (width * i / 8..width * (i + 1) / 8, height * j / 8..height * (j + 1) / 8);
        let indices = y.flat_map(|y| x.clone().map(move |x| y * width + x));
        let valid = indices.clone().filter(|k| !is_hole(holes, *k)).filter_map(|k| map.samples.get(k));
        let (count, total) = (valid.clone().count(), indices.count());
        (count > 0 && 2 * count >= total).then(|| mean_square(valid.copied()))
    });
    let (min, max) = tiles.fold((f64::INFINITY, 0.0_f64), |(min, max), v| (min.min(v), max.max(v)));
    let min = min.min(max);
    // A map of zeros is stationary and isotropic.
    let ratio = |a: f64, b: f64| if a <= 0.0 && b <= 0.0 { 1.0 } else { (a / b.max(1e-9 * a)).min(1e9) };
    NoiseStatistics {
        variance,
        isotropy: ratio(along, down),
        stationarity: ratio(max, min),
        kurtosis: if variance > 0.0 { fourth / (variance * variance) } else { 3.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::texture::filter::bilateral::{BilateralParams, bilateral};
    use crate::texture::filter::dog::{DogParams, features};
    use crate::texture::grid::Wrap;

    fn white(seed: u64, width: usize, height: usize) -> Grid {
        let mut rng = Rng::new(seed);
        let mut normal = || (0..12).map(|_| rng.uniform()).sum::<f64>() - 6.0;
        Grid::from_fn(width, height, |_, _| normal() as f32)
    }

    #[test]
    fn smooth_part_features_and_noise_make_the_image_again() {
        let mut rng = Rng::new(12);
        let image = Grid::from_fn(60, 50, |x, _| {
            (if x % 20 < 3 { 20.0 } else { 70.0 }) + rng.between(-3.0, 3.0) as f32
        });
        let params = BilateralParams { sigma_d: 3.0, sigma_r: 4.25 };
        let soft = bilateral(&image, params, Wrap::Repeat);
        let f = features(&image, DogParams::default(), Wrap::Repeat);
        let n = noise(&image, &soft, Some(&f), &[]);
        let mean = n.samples.iter().sum::<f32>() / n.samples.len() as f32;
        assert!(mean.abs() < 1e-5, "{mean}");
        // The subtracted mean is the same everywhere.
        let rest: Vec<f32> = (0..image.samples.len())
            .map(|k| {
                let masked = f.samples[k] * (image.samples[k] - soft.samples[k]);
                image.samples[k] - (soft.samples[k] + masked + n.samples[k])
            })
            .collect();
        assert!(rest.iter().all(|r| (r - rest[0]).abs() < 2e-5), "{rest:?}");
        let left = (0..image.samples.len())
            .map(|k| f64::from((1.0 - f.samples[k]) * (image.samples[k] - soft.samples[k])))
            .sum::<f64>()
            / image.samples.len() as f64;
        assert!(left.abs() > 1e-3 && (f64::from(rest[0]) - left).abs() < 2e-5, "{left} {}", rest[0]);
        let bare = noise(&image, &soft, None, &[]);
        let [whole, first] =
            [&image, &soft].map(|grid| grid.samples.iter().map(|x| f64::from(*x)).sum::<f64>());
        let left = (whole - first) / image.samples.len() as f64;
        for (n, (image, soft)) in bare.samples.iter().zip(image.samples.iter().zip(&soft.samples)) {
            assert!((f64::from(image - soft) - left - f64::from(*n)).abs() < 2e-5);
        }
    }

    #[test]
    fn noise_is_zero_in_holes_and_they_do_not_count_for_the_mean() {
        let luma = Grid { width: 4, height: 1, samples: vec![5.0, 7.0, 0.0, 6.0] };
        let soft = Grid { width: 4, height: 1, samples: vec![4.0, 4.0, 90.0, 4.0] };
        let n = noise(&luma, &soft, None, &[false, false, true, false]);
        assert_eq!(n.samples, [-1.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn white_noise_is_stationary_and_isotropic() {
        let s = statistics(&white(1, 256, 256), &[]);
        assert!((s.variance - 1.0).abs() < 0.02 && (s.isotropy - 1.0).abs() < 0.03, "{s:?}");
        assert!(s.stationarity < 1.4 && (s.kurtosis - 2.9).abs() < 0.1, "{s:?}");
        assert_eq!(s.warning(), None);
    }

    #[test]
    fn noise_that_is_not_stationary_or_not_isotropic_gives_a_warning() {
        let mut loud = white(2, 128, 128);
        loud.samples[..128 * 16].iter_mut().for_each(|x| *x *= 3.0);
        let s = statistics(&loud, &[]);
        assert!(s.stationarity > 7.0 && s.warning().unwrap().contains("factor of"), "{s:?}");
        let grain = white(3, 128, 128);
        let lines =
            Grid::from_fn(128, 128, |x, y| (0..8).map(|t| grain.samples[128 * y + (x + t) % 128]).sum());
        let s = statistics(&lines, &[]);
        assert!(s.isotropy < 0.2 && s.warning().unwrap().contains("direction"), "{s:?}");
        let flat = statistics(&Grid::from_fn(9, 9, |_, _| 0.0), &[]);
        assert!(flat.warning().is_none() && flat.kurtosis == 3.0);
        assert!(statistics(&Grid::default(), &[]).variance == 0.0);
    }

    #[test]
    fn the_warning_starts_above_a_ratio_of_four_and_an_isotropy_of_two() {
        let even = NoiseStatistics { variance: 1.0, isotropy: 1.0, stationarity: 1.0, kurtosis: 3.0 };
        for (isotropy, stationarity, warned) in [
            (1.0, 4.0, false),
            (1.0, 4.01, true),
            (2.0, 1.0, false),
            (2.01, 1.0, true),
            (0.5, 1.0, false),
            (0.49, 1.0, true),
        ] {
            let s = NoiseStatistics { isotropy, stationarity, ..even };
            assert_eq!(s.warning().is_some(), warned, "{s:?}");
        }
        // A gain of 1.5 or 2.5 on half of the image: 2.25 and 6.25 times the power.
        for (gain, warned) in [(1.5, false), (2.5, true)] {
            let mut map = white(8, 512, 512);
            map.samples[..512 * 256].iter_mut().for_each(|x| *x *= gain);
            let s = statistics(&map, &[]);
            let right = f64::from(gain * gain);
            assert!((s.stationarity / right - 1.0).abs() < 0.3 && s.warning().is_some() == warned, "{s:?}");
        }
    }

    #[test]
    fn half_a_hole_has_the_statistics_of_the_other_half() {
        let half = white(5, 128, 256);
        let wide = Grid::from_fn(256, 256, |x, y| if x < 128 { half.samples[128 * y + x] } else { 0.0 });
        let holes: Vec<bool> = (0..256 * 256).map(|k| k % 256 >= 128).collect();
        let (ours, right) = (statistics(&wide, &holes), statistics(&half, &[]));
        assert_eq!(
            [ours.variance, ours.isotropy, ours.kurtosis],
            [right.variance, right.isotropy, right.kurtosis]
        );
        assert!(ours.stationarity < 1.4 && ours.warning().is_none(), "{ours:?}");
        let blind = statistics(&wide, &[]);
        assert!(blind.kurtosis > 5.0 && blind.stationarity > 1e3, "zeros would count: {blind:?}");
        let none = statistics(&wide, &vec![true; 256 * 256]);
        assert!(none.variance == 0.0 && none.warning().is_none(), "{none:?}");
    }
}
