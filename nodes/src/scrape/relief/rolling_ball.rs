//! The path of a ball that rolls over heights.

use crate::scrape::map::surface_map::SurfaceMap;
use crate::texture::{Grid, Surface, Wrap};

/// Multiples of the ball's curvature: up to the first a surface counts as round between three pixels, from the second
/// on as an edge.
const ROUND: [f64; 2] = [4.0, 8.0];

/// Returns the path of the centre of a ball of radius `radius` m that rolls over heights in m: their dilation by its paraboloid.
///
/// A round surface is touched between pixels, on the parabola through three of them: from pixel to pixel alone the ball would rattle.
///
/// # Complexity
/// `O(pixels)`: rows and then columns, each by the upper envelope of its parabolas.
///
/// # Source
/// Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions" (2012), turned upside down.
#[must_use]
pub fn rolled_over(heights: &Grid, surface: &Surface, radius: f64) -> Grid {
    dilated(heights, surface, radius, between_pixels).0
}

/// The same with the pixel that the ball touches, counted from each pixel.
pub(super) fn rolled_with_touch(heights: &Grid, surface: &Surface, radius: f64) -> (Grid, Vec<[i32; 2]>) {
    dilated(heights, surface, radius, between_pixels)
}

/// Height of the vertex of the parabola through three heights above the middle one, which is highest; at most that of a round
/// surface lets it.
fn between_pixels([before, top, after]: [f64; 3], bend: f64) -> f64 {
    let own = 2.0 * top - before - after;
    let round = ((ROUND[1] * bend - own) / ((ROUND[1] - ROUND[0]) * bend)).clamp(0.0, 1.0);
    if own > 0.0 { round * (after - before).powi(2) / (8.0 * own) } else { 0.0 }
}

/// The dilation and the touched pixels, where `rise` is the height of the touching point above the highest pixel and its neighbours.
fn dilated(
    heights: &Grid,
    surface: &Surface,
    radius: f64,
    rise: impl Fn([f64; 3], f64) -> f64 + Copy,
) -> (Grid, Vec<[i32; 2]>) {
    let bend = |density: f64| 1.0 / (2.0 * radius * density * density);
    let [bx, by] = surface.density.map(bend);
    let ends = |(low, high): (f32, f32), h: &f32| (low.min(*h), high.max(*h));
    let (low, high) = heights.samples.iter().fold((f32::MAX, f32::MIN), ends);
    let range = f64::from(high - low).max(0.0);
    let reach = |bend: f64, len: usize| ((range / bend).sqrt().ceil() as usize + 1).min(len);
    let (w, h) = (heights.width, heights.height);
    let mut envelope = Envelope::default();
    let mut out = heights.clone();
    let mut along = vec![0; out.samples.len()];
    for (row, along) in out.samples.chunks_exact_mut(w.max(1)).zip(along.chunks_exact_mut(w.max(1))) {
        envelope.over(row, along, bx, reach(bx, w), surface.wrap, rise);
    }
    let (mut column, mut across) = (vec![0.0; h], vec![0; h]);
    let mut touch = vec![[0; 2]; out.samples.len()];
    for x in 0..w {
        let from = |y: usize| out.samples.get(y * w + x).copied().unwrap_or_default();
        column.iter_mut().enumerate().for_each(|(y, c)| *c = from(y));
        envelope.over(&mut column, &mut across, by, reach(by, h), surface.wrap, rise);
        for (y, (c, dy)) in column.iter().zip(&across).enumerate() {
            let row = surface.wrap.index(y as i64 + i64::from(*dy), h);
            let dx = along.get(row * w + x).copied().unwrap_or_default();
            if let (Some(position), Some(touch)) = (out.samples.get_mut(y * w + x), touch.get_mut(y * w + x))
            {
                (*position, *touch) = (*c, [dx, *dy]);
            }
        }
    }
    (out, touch)
}

/// The highest of parabolas that open downwards, one on each sample of a line.
#[derive(Debug, Default)]
struct Envelope {
    line: Vec<f64>,
    /// Parabolas of the upper envelope, from left to right.
    tops: Vec<usize>,
    /// Start of each of them.
    from: Vec<f64>,
}

impl Envelope {
    fn over(
        &mut self,
        row: &mut [f32],
        touch: &mut [i32],
        bend: f64,
        reach: usize,
        wrap: Wrap,
        rise: impl Fn([f64; 3], f64) -> f64,
    ) {
        let n = row.len();
        let sample = |k: usize| row.get(wrap.index(k as i64 - reach as i64, n)).copied().unwrap_or_default();
        self.line.clear();
        self.line.extend((0..n + 2 * reach).map(|k| f64::from(sample(k))));
        self.tops.clear();
        self.from.clear();
        for (q, f) in self.line.iter().enumerate() {
            let q_bent = q as f64 * q as f64 * bend;
            let mut at = f64::NEG_INFINITY;
            while let (Some(&p), Some(&from)) = (self.tops.last(), self.from.last()) {
                // Where the parabola on q rises above that on p.
                let p_bent = p as f64 * p as f64 * bend;
                at = ((self.line[p] - p_bent) - (f - q_bent)) / (2.0 * bend * (q - p) as f64);
                if at > from {
                    break;
                }
                self.tops.pop();
                self.from.pop();
                at = f64::NEG_INFINITY;
            }
            self.tops.push(q);
            self.from.push(at);
        }
        let mut k = 0;
        for (x, (out, touch)) in row.iter_mut().zip(touch).enumerate() {
            let middle = x + reach;
            let x = middle as f64;
            while self.from.get(k + 1).is_some_and(|from| *from < x) {
                k += 1;
            }
            let Some(&p) = self.tops.get(k) else { continue };
            *touch = p as i32 - middle as i32;
            let height = |j: usize| self.line.get(j).map(|f| f - bend * (x - j as f64).powi(2));
            let Some(top) = height(p) else { continue };
            let around = p.checked_sub(1).and_then(height).zip(height(p + 1));
            let above = around.map_or(0.0, |(before, after)| rise([before, top, after], bend));
            *out = (top + above) as f32;
        }
    }
}

/// The change of the path of a rolling ball per metre, as a map for reading.
#[must_use]
pub fn ball_map(heights: &Grid, surface: &Surface, radius: f64) -> SurfaceMap {
    SurfaceMap::height_change(&rolled_over(heights, surface, radius), *surface)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(density: f64) -> Surface {
        Surface { density: [density; 2], ..Surface::default() }
    }

    #[test]
    fn the_envelope_is_the_highest_of_all_parabolas() {
        let mut state = 5_u32;
        let heights = Grid::from_fn(19, 13, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 * 1e-4
        });
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let surface = Surface { density: [1000.0, 1500.0], wrap, ..Surface::default() };
            let fast = dilated(&heights, &surface, 0.02, |_, _| 0.0).0;
            for y in 0..13_i64 {
                for x in 0..19_i64 {
                    let mut best = f64::MIN;
                    for dy in -12..=12_i64 {
                        for dx in -18..=18_i64 {
                            let [x, y] = [wrap.index(x + dx, 19), wrap.index(y + dy, 13)];
                            let (mx, my) = (dx as f64 / 1000.0, dy as f64 / 1500.0);
                            let h = f64::from(heights.samples[y * 19 + x]);
                            best = best.max(h - (mx * mx + my * my) / 0.04);
                        }
                    }
                    let found = f64::from(fast.samples[(y * 19 + x) as usize]);
                    assert!((found - best).abs() < 1e-9, "{wrap:?} {x} {y}: {found} {best}");
                }
            }
        }
    }

    #[test]
    fn a_ball_over_a_round_surface_touches_it_between_pixels() {
        // 24 waves of 0.1 mm on 256 mm: the ball touches where its slope is that of the wave.
        let (density, radius, depth) = (2000.0, 0.02, 1e-4);
        let k = std::f64::consts::TAU * 24.0 / 512.0 * density;
        let height = |s: f64| 0.5 * depth * (1.0 + (k * s).cos());
        let slope = |s: f64| -0.5 * depth * k * (k * s).sin();
        let grid = Grid::from_fn(512, 4, |x, _| height(x as f64 / density) as f32);
        let z = rolled_over(&grid, &surface(density), radius);
        let plain = dilated(&grid, &surface(density), radius, |_, _| 0.0).0;
        let (mut worst, mut rattle) = (0.0_f64, 0.0_f64);
        for x in 0..512 {
            let at = x as f64 / density;
            let [mut low, mut high] = [at - 0.01, at + 0.01];
            for _ in 0..60 {
                let s = 0.5 * (low + high);
                if s - radius * slope(s) < at { low = s } else { high = s }
            }
            let right = height(low) - 0.5 * radius * slope(low).powi(2);
            worst = worst.max((f64::from(z.samples[x]) - right).abs());
            rattle = rattle.max((f64::from(plain.samples[x]) - right).abs());
        }
        assert!(worst < 0.1 * rattle && worst < 1e-7, "{worst} m, by pixels alone {rattle} m");
    }

    #[test]
    fn a_ball_dips_into_a_gap_by_its_square_over_eight_radii() {
        // 4 mm under 20 mm: 1e-4 m, with a jump of the slope by g/R in the middle.
        let density = 4000.0;
        let gap = 16;
        let heights =
            Grid::from_fn(
                400,
                1,
                |x, _| if (200 - gap / 2..200 + gap / 2).contains(&x) { 0.0 } else { 0.01 },
            );
        let z = rolled_over(&heights, &surface(density), 0.02).samples;
        let dip = 0.01 - f64::from(z[200]);
        assert!((dip - 0.004_f64.powi(2) / (8.0 * 0.02)).abs() < 1e-6, "{dip}");
        let slope = |x: usize| f64::from(z[x + 1] - z[x]) * density;
        let jump = slope(200) - slope(198);
        assert!((jump / (0.004 / 0.02) - 1.0).abs() < 0.1, "{jump}");
    }
}
