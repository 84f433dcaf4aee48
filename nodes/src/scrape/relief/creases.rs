//! The creases in the path of a ball that rolls over a relief: where the touching point jumps.

use super::rolling_ball::rolled_with_touch;
use crate::scrape::map::surface_map::SurfaceMap;
use crate::texture::{Grid, Surface, Wrap};
use serde::{Deserialize, Serialize};

/// Minimum distance of successive touching points that counts as a jump, pixels: one lower pixel between two.
const JUMP: i64 = 2;

/// A point of a relief under a ball, in pixels, and its height in m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    pixel: [i64; 2],
    height: f64,
}

/// The point that a contact touches, and its last position, in pixels, on a surface of one size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CreaseVoice {
    size: f64,
    last: Option<[f64; 2]>,
    touch: Option<Touch>,
}

impl CreaseVoice {
    /// Begins again on a surface of another size.
    pub fn resize(&mut self, size: f64) {
        if self.size != size {
            *self = Self { size, ..Self::default() };
        }
    }
}

/// A crease that a contact has crossed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Part of the step at which it was crossed, 0 to 1.
    pub at: f64,
    /// Change of the gradient of the path, m/m.
    pub gradient: [f64; 2],
}

/// All creases of a relief under a ball of one radius.
///
/// While a ball of radius `R` touches the relief at `p`, its centre is at `h(p) - |x - p|^2/2R`, with the gradient `(p - x)/R`. Where it
/// touches `p` and `q` at once, the gradient jumps by `(q - p)/R`, perpendicular to the crease. For a groove of width `g` that is `g/R`.
///
/// # Complexity
/// `O(pixels)` to construct, apart from the pixels between the ends of each jump. A crossing costs four touching points per sample, and
/// nothing in cells without a crease. A contact that passes more than a pixel from one sample to the next (86 m/s at 44.1 kHz and 512 pixels
/// per metre) may miss creases.
#[derive(Clone, Debug)]
pub struct Creases {
    touch: Vec<[i32; 2]>,
    heights: Grid,
    /// True for each cell of four pixels, by its first, in which a crease lies.
    creased: Vec<bool>,
    surface: Surface,
    radius: f64,
    bend: [f64; 2],
}

/// The map of a ball that rolls over heights in m, as `ball_map`, and its creases.
pub fn ball_map_and_creases(heights: &Grid, surface: &Surface, radius: f64) -> (SurfaceMap, Creases) {
    let (rolled, touch) = rolled_with_touch(heights, surface, radius);
    (SurfaceMap::height_change(&rolled, *surface), Creases::new(heights, touch, surface, radius))
}

/// Returns -1 where a continued row runs backwards.
fn orientation(wrap: Wrap, at: i64, len: usize) -> i64 {
    let n = len.max(1) as i64;
    if wrap == Wrap::Mirror && at.rem_euclid(2 * n) >= n { -1 } else { 1 }
}

impl Creases {
    fn new(heights: &Grid, touch: Vec<[i32; 2]>, surface: &Surface, radius: f64) -> Self {
        let bend = surface.density.map(|d| 1.0 / (2.0 * radius * d * d));
        let (w, h) = (heights.width, heights.height);
        let creased = vec![false; w * h];
        let mut all = Self { touch, heights: heights.clone(), creased, surface: *surface, radius, bend };
        for y in 0..h as i64 {
            for x in 0..w as i64 {
                // The edge to the right is of this cell and the one above, that downwards of this one and the one before.
                if all.is_crease([x, y], [x + 1, y]) {
                    all.set([x, y]);
                    all.set([x, y - 1]);
                }
                if all.is_crease([x, y], [x, y + 1]) {
                    all.set([x, y]);
                    all.set([x - 1, y]);
                }
            }
        }
        all
    }

    fn index(&self, [x, y]: [i64; 2]) -> usize {
        let wrap = self.surface.wrap;
        wrap.index(y, self.heights.height) * self.heights.width + wrap.index(x, self.heights.width)
    }

    fn set(&mut self, cell: [i64; 2]) {
        // Where a row runs backwards a cell begins with its last pixel: both neighbours are read then.
        let index = self.index(cell);
        if let Some(creased) = self.creased.get_mut(index) {
            *creased = true;
        }
    }

    fn has_crease(&self, cell: [i64; 2]) -> bool {
        let [x, y] = cell;
        let read = |cell| self.creased.get(self.index(cell)).copied().unwrap_or_default();
        read(cell)
            || (self.surface.wrap == Wrap::Mirror
                && (read([x + 1, y]) || read([x, y + 1]) || read([x + 1, y + 1])))
    }

    /// The point that a ball over a pixel touches.
    fn touch(&self, pixel: [i64; 2]) -> Touch {
        let size = [self.heights.width, self.heights.height];
        let offset = self.touch.get(self.index(pixel)).copied().unwrap_or_default();
        let wrap = self.surface.wrap;
        let at = [0, 1].map(|k| pixel[k] + orientation(wrap, pixel[k], size[k]) * i64::from(offset[k]));
        Touch { pixel: at, height: self.height(at) }
    }

    fn height(&self, pixel: [i64; 2]) -> f64 {
        self.heights.samples.get(self.index(pixel)).copied().unwrap_or_default().into()
    }

    /// Height of the ball at a position in pixels if it touches there, m.
    fn centre(&self, touch: &Touch, at: [f64; 2]) -> f64 {
        let [x, y] = [0, 1].map(|k| at[k] - touch.pixel[k] as f64);
        touch.height - self.bend[0] * x * x - self.bend[1] * y * y
    }

    /// Returns true if the touching point jumps between two neighbouring pixels, over points that the ball touches nowhere between.
    fn is_crease(&self, a: [i64; 2], b: [i64; 2]) -> bool {
        let (from, to) = (self.touch(a), self.touch(b));
        self.jumps(&from, &to, [a, b].map(|p| p.map(|x| x as f64)))
    }

    /// Returns true if the touching point jumps somewhere on its way from one point to another.
    fn jumps(&self, from: &Touch, to: &Touch, [a, b]: [[f64; 2]; 2]) -> bool {
        let pixels = jump(from, to);
        if pixels < JUMP {
            return false;
        }
        let Some(s) = self.equal(from, to, a, b) else { return false };
        let at = [0, 1].map(|k| a[k] + s * (b[k] - a[k]));
        // The highest point between both, where the ball touches these two.
        let mut best = (self.centre(from, at) + 1e-9, None);
        for k in 1..pixels {
            let share = k as f64 / pixels as f64;
            let pixel =
                [0, 1].map(|i| from.pixel[i] + (share * (to.pixel[i] - from.pixel[i]) as f64).round() as i64);
            let touch = Touch { pixel, height: self.height(pixel) };
            let height = self.centre(&touch, at);
            if height > best.0 {
                best = (height, Some(touch));
            }
        }
        let Some(between) = best.1 else { return true };
        self.jumps(from, &between, [a, b]) || self.jumps(&between, to, [a, b])
    }

    /// Part of the way from `a` to `b` at which a ball touches two points at once.
    fn equal(&self, from: &Touch, to: &Touch, a: [f64; 2], b: [f64; 2]) -> Option<f64> {
        let above = |at| self.centre(to, at) - self.centre(from, at);
        let (first, last) = (above(a), above(b));
        (last > first).then(|| (-first / (last - first)).clamp(0.0, 1.0))
    }

    /// The highest of the touching points of a cell at a position in pixels; `now` if none is higher.
    fn highest(&self, cell: [i64; 2], at: [f64; 2], now: Option<Touch>) -> Touch {
        let corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| self.touch([cell[0] + x, cell[1] + y]));
        let mut best = now.unwrap_or(corners[0]);
        let mut top = self.centre(&best, at);
        for corner in corners {
            let height = self.centre(&corner, at);
            if height > top {
                (best, top) = (corner, height);
            }
        }
        best
    }

    /// Follows a contact to its next position in m on a surface of size 1.
    pub fn step(&self, voice: &mut CreaseVoice, position: [f64; 2]) -> Option<Crossing> {
        let at: [f64; 2] = std::array::from_fn(|k| position[k] * self.surface.density[k]);
        let cell = at.map(|x| x.floor() as i64);
        let last = voice.last.replace(at);
        let touch = voice.touch.take();
        let inside = self.has_crease(cell);
        let Some(last) = last else {
            voice.touch = inside.then(|| self.highest(cell, at, None));
            return None;
        };
        let (before, now) = if inside {
            let before = touch.unwrap_or_else(|| self.highest(cell, last, None));
            (before, self.highest(cell, at, Some(before)))
        } else {
            // A crease on the border of its cell is crossed on the way out.
            let before = touch?;
            (before, self.highest(last.map(|x| x.floor() as i64), at, Some(before)))
        };
        voice.touch = inside.then_some(now);
        if jump(&before, &now) < JUMP {
            return None;
        }
        let gradient = std::array::from_fn(|k| {
            (now.pixel[k] - before.pixel[k]) as f64 / self.surface.density[k] / self.radius
        });
        Some(Crossing { at: self.equal(&before, &now, last, at)?, gradient })
    }

    /// Follows a contact to its position after many samples if no cell on its way has a crease; returns false if one may have.
    pub fn skip(&self, voice: &mut CreaseVoice, low: [f64; 2], high: [f64; 2], end: [f64; 2]) -> bool {
        let cell = |p: [f64; 2]| [0, 1].map(|k| (p[k] * self.surface.density[k]).floor() as i64);
        let (low, high) = (cell(low), cell(high));
        if voice.touch.is_some() || (high[0] - low[0]).max(high[1] - low[1]) > 4 {
            return false;
        }
        let creased = (low[1]..=high[1]).any(|y| (low[0]..=high[0]).any(|x| self.has_crease([x, y])));
        if !creased {
            let last = std::array::from_fn(|k| end[k] * self.surface.density[k]);
            *voice = CreaseVoice { last: Some(last), touch: None, ..*voice };
        }
        !creased
    }
}

/// Pixels from one touching point to another along an axis.
fn jump(a: &Touch, b: &Touch) -> i64 {
    (a.pixel[0] - b.pixel[0]).abs().max((a.pixel[1] - b.pixel[1]).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn creases(heights: &Grid, density: f64, radius: f64) -> Creases {
        let surface = Surface { density: [density; 2], ..Surface::default() };
        ball_map_and_creases(heights, &surface, radius).1
    }

    /// Positions and changes of the gradient along a line.
    fn crossed(all: &Creases, from: [f64; 2], step: [f64; 2], count: usize) -> Vec<([f64; 2], [f64; 2])> {
        let mut voice = CreaseVoice::default();
        let at = |n: f64| [from[0] + n * step[0], from[1] + n * step[1]];
        let one = |n: usize| {
            let crossing = all.step(&mut voice, at(n as f64))?;
            Some((at(n as f64 - 1.0 + crossing.at), crossing.gradient))
        };
        (0..count).filter_map(one).collect()
    }

    #[test]
    fn a_groove_is_one_crease_in_its_middle_of_its_width_over_the_radius() {
        for gap in [1, 2, 4, 8, 16] {
            let groove = |x: usize| (100..100 + gap).contains(&x);
            let across = Grid::from_fn(400, 8, |x, _| if groove(x) { 0.0 } else { 0.01 });
            let down = Grid::from_fn(8, 400, |_, y| if groove(y) { 0.0 } else { 0.01 });
            // From the last pixel before it to the first after it.
            let (width, middle) = ((gap + 1) as f64 / 4000.0, (99.5 + 0.5 * gap as f64) / 4000.0);
            for (heights, k) in [(across, 0), (down, 1)] {
                let all = creases(&heights, 4000.0, 0.02);
                for step in [1.13e-5, -1.13e-5, 1.1e-4] {
                    let (mut v, mut from) = ([0.3 * step; 2], [0.0004; 2]);
                    v[k] = step;
                    from[k] = if step > 0.0 { 0.02 } else { 0.03 };
                    let found = crossed(&all, from, v, (0.01 / step.abs()) as usize + 1);
                    assert_eq!(found.len(), 1, "{gap} {step}: {found:?}");
                    let (at, gradient) = found[0];
                    assert!((at[k] - middle).abs() < 1e-9, "{gap} {step}: {at:?} for {middle}");
                    let right = width / 0.02 * step.signum();
                    assert!((gradient[k] - right).abs() < 1e-9 && gradient[1 - k] == 0.0, "{gradient:?}");
                }
            }
        }
    }

    #[test]
    fn a_flat_floor_and_round_waves_have_no_creases() {
        let k = std::f32::consts::TAU * 24.0 / 512.0;
        let round = Grid::from_fn(512, 16, |x, _| 3.3e-4 * (1.0 + (k * x as f32).cos()));
        // The bottoms have a radius of 8.7 mm.
        for (radius, count) in [(0.002, 0), (0.005, 0), (0.02, 24)] {
            let all = creases(&round, 2000.0, radius);
            let bottom = 1.0 / (3.3e-4 * (f64::from(k) * 2000.0).powi(2));
            let found = crossed(&all, [0.0, 0.001], [1e-5, 0.0], 25_600);
            println!("radius {radius} over bottoms of {bottom}: {} creases", found.len());
            assert_eq!(!found.is_empty(), bottom < radius, "{radius}");
            assert!(count == 0 || found.len() == count, "{} creases", found.len());
        }
        let flat = Grid::from_fn(16, 16, |_, _| 0.3);
        assert!(creases(&flat, 500.0, 0.02).creased.iter().all(|c| !c));
    }

    #[test]
    fn a_mirrored_surface_is_crossed_at_mirrored_positions() {
        let heights = Grid::from_fn(64, 8, |x, _| if (20..24).contains(&x) { 0.0 } else { 0.01 });
        let surface = Surface { density: [1000.0; 2], wrap: Wrap::Mirror, ..Surface::default() };
        let all = ball_map_and_creases(&heights, &surface, 0.02).1;
        let found = crossed(&all, [0.0, 0.003], [1e-5, 0.0], 12_000);
        let right = [0.0215, 0.1275 - 0.0215 - 0.0005];
        assert_eq!(found.len(), 2, "{found:?}");
        for ((at, gradient), right) in found.iter().zip(right) {
            assert!((at[0] - right).abs() < 1e-9 && (gradient[0] - 0.25).abs() < 1e-9, "{at:?} {gradient:?}");
        }
    }
}
