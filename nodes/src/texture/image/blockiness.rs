//! Blocks of 8 pixels, as strong JPEG compression leaves them.

use crate::texture::grid::Grid;

/// Returns the blockiness of an image, the strength of JPEG blocks of 8 pixels: 0 for none, 1 for blocks only.
///
/// Absolute differences between neighbouring columns, and between rows, are summed along the other axis and high-pass filtered.
/// The blockiness of an axis is the normalised autocorrelation at lag 8 less the largest at the lags around it. The result is the
/// larger of both axes.
///
/// # Complexity
/// `O(pixels)`.
#[must_use]
pub fn blockiness(image: &Grid) -> f32 {
    let (mut across, mut down) = (vec![0.0_f64; image.width.saturating_sub(1)], Vec::new());
    let rows: Vec<&[f32]> = image.samples.chunks_exact(image.width.max(1)).collect();
    for (k, row) in rows.iter().enumerate() {
        for (sum, pair) in across.iter_mut().zip(row.windows(2)) {
            *sum += f64::from((pair[1] - pair[0]).abs());
        }
        if let Some(next) = rows.get(k + 1) {
            down.push(row.iter().zip(*next).map(|(a, b)| f64::from((b - a).abs())).sum());
        }
    }
    block_peak(&across).max(block_peak(&down)) as f32
}

fn block_peak(steps: &[f64]) -> f64 {
    const BLOCK: usize = 8;
    if steps.len() < 8 * BLOCK {
        return 0.0;
    }
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
    let around = [5, 6, 7, 9, 10, 11].map(correlation).into_iter().fold(f64::NEG_INFINITY, f64::max);
    ((correlation(BLOCK) - around.max(0.0)) / power).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn blocks_of_8_are_detected_and_other_textures_are_not() {
        let mut rng = Rng::new(9);
        let noise = Grid::from_fn(200, 200, |_, _| rng.between(0.0, 20.0) as f32);
        assert!(blockiness(&noise) < 0.2, "{}", blockiness(&noise));
        // One value per block, with a little noise.
        let blocks = Grid::from_fn(200, 200, |x, y| {
            let of = |x: usize, y: usize| noise.samples[200 * y + x];
            3.0 * of(x / 8 * 8, y / 8 * 8) + 0.3 * of(x, y)
        });
        assert!(blockiness(&blocks) > 0.5, "{}", blockiness(&blocks));
        let waves = Grid::from_fn(200, 200, |x, y| ((x as f32 * 0.3).sin() + (y as f32 * 0.17).cos()) * 30.0);
        assert!(blockiness(&waves) < 0.1, "{}", blockiness(&waves));
        assert_eq!(blockiness(&Grid::from_fn(300, 300, |_, _| 5.0)), 0.0);
    }
}
