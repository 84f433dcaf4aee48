//! Blocks of 8 pixels, as strong JPEG compression leaves them.

use crate::texture::grid::Grid;

/// Side of a JPEG block, px.
const BLOCK: usize = 8;
/// Lags that a grid of blocks leaves low: those of textures of a pitch of 4 pixels, and of smooth ones.
const OTHER_LAGS: [usize; 8] = [4, 5, 6, 7, 9, 10, 11, 12];

/// Returns the blockiness of an image, the strength of JPEG blocks of 8 pixels: 0 for none, 1 for blocks only.
///
/// Absolute differences between neighbouring columns, and between rows, are summed along the other axis and high-pass filtered.
/// Their normalised autocorrelation at lag 8 less the largest at the lags around it, from 4 to 12, is high for blocks and for textures
/// with a period of 8 pixels. Blocks hold different contents, so the signed steps from block to block are not correlated; those of a texture
/// are, equal or opposite. The difference is therefore multiplied by `1 - |c|`, the correlation `c` of the signed steps at the strongest of
/// the 8 phases with those 8 pixels further. Any phase counts, since a block grid of a cropped image need not begin at its corner. The result
/// is the larger of both axes.
///
/// A texture of period 8 with noise as strong as itself cannot be distinguished from blocks.
///
/// # Complexity
/// `O(pixels)`.
#[must_use]
pub fn blockiness(image: &Grid) -> f32 {
    let at = |x: usize, y: usize| f64::from(image.samples[image.width * y + x]);
    let across = axis(image.width, image.height, at);
    let down = axis(image.height, image.width, |x, y| at(y, x));
    across.max(down) as f32
}

/// Blockiness of the steps from column to column.
fn axis(width: usize, height: usize, at: impl Fn(usize, usize) -> f64) -> f64 {
    if width <= 8 * BLOCK {
        return 0.0;
    }
    let mut steps = vec![0.0; width - 1];
    for y in 0..height {
        for (x, step) in steps.iter_mut().enumerate() {
            *step += (at(x + 1, y) - at(x, y)).abs();
        }
    }
    let peak = block_peak(&steps);
    if peak <= 0.0 {
        return 0.0;
    }
    let strength = |phase: &usize| steps.iter().skip(*phase).step_by(BLOCK).sum::<f64>();
    let phase = (0..BLOCK).max_by(|a, b| strength(a).total_cmp(&strength(b))).unwrap_or(0);
    let (mut product, mut power) = (0.0, 0.0);
    for y in 0..height {
        let mut last = 0.0;
        for x in (phase..width - 1).step_by(BLOCK) {
            let step = at(x + 1, y) - at(x, y);
            product += step * last;
            power += step * step;
            last = step;
        }
    }
    if power <= 0.0 { 0.0 } else { peak * (1.0 - (product / power).abs()).max(0.0) }
}

fn block_peak(steps: &[f64]) -> f64 {
    // High-pass: each step less the mean over one block around it.
    let filtered: Vec<f64> = steps
        .windows(BLOCK + 1)
        .map(|w| w[BLOCK / 2] - (w[1..BLOCK].iter().sum::<f64>() + 0.5 * (w[0] + w[BLOCK])) / BLOCK as f64)
        .collect();
    let correlation =
        |lag: usize| filtered.iter().zip(filtered.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
    let power = correlation(0);
    if power <= 1e-12 {
        return 0.0;
    }
    let around = OTHER_LAGS.map(correlation).into_iter().fold(f64::NEG_INFINITY, f64::max);
    ((correlation(BLOCK) - around.max(0.0)) / power).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    /// One value per block, with a little noise.
    fn blocks(shift: usize) -> Grid {
        let mut rng = Rng::new(9);
        let noise = Grid::from_fn(200, 200, |_, _| rng.between(0.0, 20.0) as f32);
        Grid::from_fn(192, 192, |x, y| {
            let of = |x: usize, y: usize| noise.samples[200 * y + x];
            3.0 * of((x + shift) / 8 * 8, (y + shift) / 8 * 8) + 0.3 * of(x, y)
        })
    }

    #[test]
    fn blocks_of_8_are_detected_and_other_textures_are_not() {
        let mut rng = Rng::new(9);
        let noise = Grid::from_fn(200, 200, |_, _| rng.between(0.0, 20.0) as f32);
        assert!(blockiness(&noise) < 0.2, "{}", blockiness(&noise));
        for shift in [0, 3] {
            assert!(blockiness(&blocks(shift)) > 0.4, "{}", blockiness(&blocks(shift)));
        }
        let waves = Grid::from_fn(200, 200, |x, y| ((x as f32 * 0.3).sin() + (y as f32 * 0.17).cos()) * 30.0);
        assert!(blockiness(&waves) < 0.1, "{}", blockiness(&waves));
        assert_eq!(blockiness(&Grid::from_fn(300, 300, |_, _| 5.0)), 0.0);
    }

    /// The largest blockiness of textures that repeat every 4, 8 and 16 pixels, with noise of a uniform distribution.
    #[test]
    fn textures_of_a_pitch_of_8_are_not_blocks() {
        let tau = std::f32::consts::TAU;
        let dark = |line: bool| if line { 20.0 } else { 75.0 };
        let textures: [(&str, &dyn Fn(usize, usize) -> f32); 9] = [
            ("wave", &|x, _| 50.0 + 15.0 * (tau * x as f32 / 8.0).sin()),
            ("long wave", &|x, _| 50.0 + 15.0 * (tau * x as f32 / 16.0).sin()),
            ("lines", &|x, _| dark(x % 8 == 0)),
            ("wide lines", &|x, _| dark(x % 8 < 3)),
            ("squares", &|x, _| dark(x % 8 < 4)),
            ("lines of pitch 4", &|x, _| dark(x % 4 == 0)),
            ("grid", &|x, y| dark(x % 8 == 0 || y % 8 == 0)),
            ("ramps", &|x, _| 30.0 + 4.0 * (x % 8) as f32),
            ("weave", &|x, y| dark((x / 8 + y / 8) % 2 == 0)),
        ];
        for (name, texture) in textures {
            for (shift, noise) in [(0, 0.0), (3, 3.0), (0, 10.0)] {
                let mut rng = Rng::new(4);
                let image = Grid::from_fn(200, 200, |x, y| {
                    texture(x + shift, y + shift) + rng.between(-noise, noise) as f32
                });
                assert!(blockiness(&image) < 0.15, "{name}, noise {noise}: {}", blockiness(&image));
            }
        }
    }
}
