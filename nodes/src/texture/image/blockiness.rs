//! Blocks of 8 pixels, as strong JPEG compression leaves them.

use crate::texture::grid::Grid;

/// How much an image shows blocks of 8 pixels, as JPEG leaves them: 0 not at all, 1 nothing but blocks.
///
/// The steps between neighbouring columns, and those between rows, are added up along the other axis and freed of their slow
/// part; what their autocorrelation at a lag of 8 stands above that at the lags around it is the answer, the greater of both axes.
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
    // Less the mean over one block around each step.
    let free: Vec<f64> = steps
        .windows(BLOCK + 1)
        .map(|w| w[BLOCK / 2] - (w[1..BLOCK].iter().sum::<f64>() + 0.5 * (w[0] + w[BLOCK])) / BLOCK as f64)
        .collect();
    let at = |lag: usize| free.iter().zip(free.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
    let power = at(0);
    if power <= 1e-12 {
        return 0.0;
    }
    let around = [5, 6, 7, 9, 10, 11].map(at).into_iter().fold(f64::NEG_INFINITY, f64::max);
    ((at(BLOCK) - around.max(0.0)) / power).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn blocks_of_8_are_seen_and_other_textures_are_not() {
        let mut rng = Rng::new(9);
        let noise = Grid::from_fn(200, 200, |_, _| rng.between(0.0, 20.0) as f32);
        assert!(blockiness(&noise) < 0.2, "{}", blockiness(&noise));
        // The mean of each block instead, with a little of the noise.
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
