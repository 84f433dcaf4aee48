//! The force between two textured surfaces that touch along a short line.

use super::heights::Relief;
use crate::scrape::force::law::Law;
use crate::scrape::force::motion::{AT_REST, Heading, Motion};
use crate::scrape::force::segment::{CELL, Cell, Segment};
use crate::scrape::path::piece::{position, velocity};
use fearless_simd::{Level, dispatch};
use serde::{Deserialize, Serialize};

/// Maximum number of points along the line of contact.
pub const MAX_TAPS: usize = 129;
/// Samples that share one reading of both surfaces.
const GROUP: usize = 32;
/// Maximum number of points of such a reading.
const PROFILE: usize = 512;

/// Minimum distance of successive touching points that counts as a jump, points of the line: one lower point between two.
const JUMP: usize = 2;
/// Minimum depth of the gap below a touching point that counts as a jump, m.
const SHALLOWEST: f32 = 1e-9;

/// The point at which the surfaces of one contact touch, on surfaces of one size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PairTouch {
    size: f64,
    /// Unit vector of the slip.
    direction: [f64; 2],
    /// Offset along the slip at the last sample, m.
    offset: Option<f64>,
}

impl PairTouch {
    /// Begins again on surfaces of another size.
    pub fn resize(&mut self, size: f64) {
        if self.size != size {
            *self = Self { size, ..Self::default() };
        }
    }
}

/// A jump of the touching point, over points that touch nowhere between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchJump {
    /// Sample after it, from the anchor.
    pub sample: usize,
    /// Part of the step to that sample at which it happens, 0 to 1.
    pub at: f64,
    /// Change of the speed at which the surfaces part, m/s; above 0.
    pub speed: f64,
}

/// The line along which two surfaces touch.
#[derive(Clone, Debug, PartialEq)]
struct Line {
    /// Offsets of its points, m.
    offsets: Vec<f64>,
    /// Gap of the curved surfaces at each point, m.
    gaps: Vec<f32>,
    /// Distance from one point to the next, m.
    step: f64,
}

/// The force of two reliefs that pass over each other: `kappa (f/f_ref)^a (dz/dt)/v_ref`, where
/// `z(t) = max over xi of (hA(uA + xi t) + hB(uB - xi t) - xi^2/2R)` is how far they hold each other apart.
///
/// The change of a maximum is that of what is highest: slopes are read at the highest point, which lies between three points of
/// the line by the parabola through them. To find it both reliefs are read once for 32 samples, along the direction in
/// the middle of these.
///
/// # Complexity
/// About 8 reads of a relief per sample and contact, and 3 operations for each point of the line.
#[derive(Clone, Debug)]
pub struct PairForce {
    simd: Level,
    /// Strength.
    pub law: Law,
    line: Line,
    motion: Motion,
    profiles: [Vec<f32>; 2],
    jumps: Vec<TouchJump>,
}

/// The motion of a contact over both surfaces within a segment, as polynomials in samples.
#[derive(Clone, Copy, Debug)]
struct Paths {
    a: [[f64; 2]; 4],
    b: [[f64; 2]; 4],
    rate: f64,
}

fn along(position: [f64; 2], direction: [f64; 2], distance: f64) -> [f64; 2] {
    [position[0] + distance * direction[0], position[1] + distance * direction[1]]
}

impl Paths {
    /// Unit vector of the slip, from the first surface that moves.
    fn direction(&self, n: f64) -> [f64; 2] {
        for path in [&self.a, &self.b] {
            let v = velocity(path, n, self.rate);
            let speed = v[0].hypot(v[1]);
            if speed >= f64::from(AT_REST) {
                return v.map(|v| v / speed);
            }
        }
        [1.0, 0.0]
    }
}

impl PairForce {
    /// Creates a force over a line of `taps` points (odd, so that its middle is one) for surfaces of a common radius in
    /// m and of heights that differ by up to `range` m.
    #[must_use]
    pub fn new(law: Law, taps: usize, radius: f64, range: f64) -> Self {
        let half = (2.0 * radius * range.max(1e-12)).sqrt();
        let taps = taps.clamp(3, MAX_TAPS) | 1;
        let step = 2.0 * half / (taps - 1) as f64;
        let middle = (taps / 2) as f64;
        let offsets: Vec<f64> = (0..taps).map(|j| (j as f64 - middle) * step).collect();
        let gaps = offsets.iter().map(|xi| (xi * xi / (2.0 * radius)) as f32).collect();
        Self {
            simd: Level::new(),
            law,
            line: Line { offsets, gaps, step },
            motion: Motion::new(),
            profiles: [vec![0.0; PROFILE], vec![0.0; PROFILE]],
            jumps: Vec::with_capacity(CELL),
        }
    }

    /// Adds the force of one contact over one segment, N.
    pub fn add(&mut self, reliefs: [&Relief; 2], heading: &mut Heading, segment: &Segment, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, _simd => self.segment(reliefs, heading, None, segment, out));
    }

    /// As [`add`](Self::add), and returns where the touching point of the contact jumps.
    ///
    /// `z` is the largest of many sums, so its rate of change jumps upwards where another one becomes the largest: by the difference of
    /// their rates, which were as far apart at the sample before.
    pub fn add_and_follow(
        &mut self,
        reliefs: [&Relief; 2],
        heading: &mut Heading,
        touch: &mut PairTouch,
        segment: &Segment,
        out: &mut [f32],
    ) -> &[TouchJump] {
        self.jumps.clear();
        let simd = self.simd;
        dispatch!(simd, _simd => self.segment(reliefs, heading, Some(&mut *touch), segment, out));
        &self.jumps
    }

    #[inline(always)]
    fn segment(
        &mut self,
        reliefs: [&Relief; 2],
        heading: &mut Heading,
        mut touch: Option<&mut PairTouch>,
        segment: &Segment,
        out: &mut [f32],
    ) {
        let path = segment.path();
        let other = segment.other_path().unwrap_or([[0.0; 2]; 4]);
        self.motion.follow(segment, &path, [1.0; 2], heading);
        let paths = Paths { a: path, b: other, rate: segment.rate };
        let mut made = [0.0; CELL];
        let last = segment.to.min(CELL);
        for group in segment.from / GROUP..last.div_ceil(GROUP) {
            let first = group * GROUP;
            let range = [segment.from.max(first), last.min(first + GROUP)];
            self.group(reliefs, &paths, first, range, touch.as_deref_mut(), &mut made);
        }
        // A contact that rests on one side may slip on the other.
        for n in segment.from..last {
            let v = velocity(&paths.b, n as f64, paths.rate);
            if v[0] * v[0] + v[1] * v[1] >= f64::from(AT_REST).powi(2) {
                self.motion.gate[n] = 1.0;
            }
        }
        // The speed is in the change of the gap already.
        self.motion.speed = [1.0; CELL];
        self.law.apply(segment, &self.motion, [1.0; 2], &mut made);
        out.iter_mut().zip(segment.part(&mut made)).for_each(|(out, x)| *out += *x);
    }

    /// Speed at which the surfaces part at the samples of a range, m/s.
    #[inline(always)]
    fn group(
        &mut self,
        [a, b]: [&Relief; 2],
        paths: &Paths,
        first: usize,
        [from, to]: [usize; 2],
        mut touch: Option<&mut PairTouch>,
        out: &mut [f32; CELL],
    ) {
        let middle = (first + GROUP / 2) as f64;
        let t = paths.direction(middle);
        if let Some(touch) = &mut touch {
            if touch.direction[0] * t[0] + touch.direction[1] * t[1] < 0.5 {
                touch.offset = None;
            }
            touch.direction = t;
        }
        let centres = [position(&paths.a, middle), position(&paths.b, middle)];
        // Displacement of both along the direction, from the middle.
        let travel = |c: &[[f64; 2]; 4], centre: [f64; 2], n: usize| {
            let at = position(c, n as f64);
            (at[0] - centre[0]) * t[0] + (at[1] - centre[1]) * t[1]
        };
        let ca: [f64; GROUP] = std::array::from_fn(|k| travel(&paths.a, centres[0], first + k));
        let cb: [f64; GROUP] = std::array::from_fn(|k| travel(&paths.b, centres[1], first + k));
        let ends = |c: &[f64; GROUP]| c.iter().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        let ((low, far), (near, high)) = (ends(&ca), ends(&cb));
        let (reach_a, reach_b) = (far - low, high - near);
        let Line { offsets, step, .. } = &self.line;
        let (taps, step) = (offsets.len(), *step);
        let half = offsets.last().copied().unwrap_or(0.0);
        let points = |reach: f64| taps + (reach / step) as usize + 2;
        let counts = [points(reach_a), points(reach_b)];
        let shared = counts.iter().all(|n| *n <= PROFILE);
        if shared {
            let forth = t.map(|t| t * step);
            let [pa, pb] = &mut self.profiles;
            a.line(along(centres[0], t, low - half), forth, &mut pa[..counts[0]]);
            b.line(along(centres[1], t, high + half), forth.map(|x| -x), &mut pb[..counts[1]]);
        }
        let mut z = [f32::MIN; MAX_TAPS];
        let (mut at_a, mut at_b) = ([[0.0; 2]; CELL], [[0.0; 2]; CELL]);
        // The touching points before jumps, and how far these are below the new ones.
        let (mut old_a, mut old_b, mut below) = ([[0.0; 2]; CELL], [[0.0; 2]; CELL], [None; CELL]);
        for n in from..to.min(CELL) {
            let (ua, ub) = (position(&paths.a, n as f64), position(&paths.b, n as f64));
            if shared {
                let behind = [(ca[n - first] - low) / step, (high - cb[n - first]) / step];
                self.between(behind, &mut z[..taps]);
            } else {
                for ((z, xi), gap) in z.iter_mut().zip(offsets).zip(&self.line.gaps) {
                    *z = a.height(along(ua, t, *xi)) + b.height(along(ub, t, -xi)) - gap;
                }
            }
            let (j, xi) = self.line.highest(&z[..taps]);
            (at_a[n], at_b[n]) = (along(ua, t, xi), along(ub, t, -xi));
            if let Some(touch) = &mut touch {
                let last = touch.offset.replace(xi).unwrap_or(xi);
                below[n] = self.line.jump(&z[..taps], last, j);
                (old_a[n], old_b[n]) = (along(ua, t, last), along(ub, t, -last));
            }
        }
        let (mut slopes_a, mut slopes_b) = ([[0.0; CELL]; 2], [[0.0; CELL]; 2]);
        a.slopes(centres[0], &at_a, [from, to], &mut slopes_a);
        b.slopes(centres[1], &at_b, [from, to], &mut slopes_b);
        for n in from..to.min(CELL) {
            let (va, vb) =
                (velocity(&paths.a, n as f64, paths.rate), velocity(&paths.b, n as f64, paths.rate));
            let change = |g: &[Cell; 2], v: [f64; 2]| g[0][n] * v[0] as f32 + g[1][n] * v[1] as f32;
            out[n] = change(&slopes_a, va) + change(&slopes_b, vb);
        }
        if below.iter().all(Option::is_none) {
            return;
        }
        a.slopes(centres[0], &old_a, [from, to], &mut slopes_a);
        b.slopes(centres[1], &old_b, [from, to], &mut slopes_b);
        for (n, below) in below.iter().enumerate() {
            let Some(below) = below else { continue };
            let (va, vb) =
                (velocity(&paths.a, n as f64, paths.rate), velocity(&paths.b, n as f64, paths.rate));
            let change = |g: &[Cell; 2], v: [f64; 2]| g[0][n] * v[0] as f32 + g[1][n] * v[1] as f32;
            let speed = f64::from(out[n] - change(&slopes_a, va) - change(&slopes_b, vb));
            if speed > 0.0 && self.jumps.len() < self.jumps.capacity() {
                let since = (f64::from(*below) * paths.rate / speed).clamp(0.0, 1.0);
                self.jumps.push(TouchJump { sample: n, at: 1.0 - since, speed });
            }
        }
    }

    /// Heights of the points of the line, from the readings of the group.
    #[inline(always)]
    fn between(&self, behind: [f64; 2], z: &mut [f32]) {
        let taps = z.len();
        let whole = behind.map(|x| x as usize);
        let [fa, fb] = [0, 1].map(|k| (behind[k] - whole[k] as f64) as f32);
        let part = |k: usize| self.profiles[k].get(whole[k]..whole[k] + taps + 1);
        let (Some(a), Some(b)) = (part(0), part(1)) else { return };
        let (a0, a1, b0, b1) = (&a[..taps], &a[1..=taps], &b[..taps], &b[1..=taps]);
        for j in 0..taps.min(self.line.gaps.len()) {
            let a = a0[j] + fa * (a1[j] - a0[j]);
            let b = b0[j] + fb * (b1[j] - b0[j]);
            z[j] = a + b - self.line.gaps[j];
        }
    }
}

/// The greater of two numbers, one of which may not be a NaN: one instruction, unlike `max`.
#[inline(always)]
fn higher(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

impl Line {
    /// Depth of the point at an offset below the highest one, if the line is below both between them.
    #[inline(always)]
    fn jump(&self, z: &[f32], offset: f64, highest: usize) -> Option<f32> {
        let half = self.offsets.last().copied().unwrap_or(0.0);
        let last = ((offset + half) / self.step).round().max(0.0) as usize;
        if last.abs_diff(highest) < JUMP {
            return None;
        }
        let between = z.get(last.min(highest) + 1..last.max(highest))?;
        let (old, new) = (z.get(last)?, z.get(highest)?);
        let lowest = between.iter().fold(f32::MAX, |low, x| low.min(*x));
        (lowest < old - SHALLOWEST).then_some(new - old)
    }

    /// The highest point of `z`, and its offset by the parabola through it and its neighbours.
    #[inline(always)]
    fn highest(&self, z: &[f32]) -> (usize, f64) {
        let mut best = [f32::MIN; 8];
        let (groups, rest) = z.as_chunks::<8>();
        for group in groups {
            for k in 0..8 {
                best[k] = higher(best[k], group[k]);
            }
        }
        let [a, b, c, d, e, f, g, h] = best;
        let best = higher(higher(higher(a, e), higher(b, f)), higher(higher(c, g), higher(d, h)));
        let top = rest.iter().fold(best, |m, x| higher(m, *x));
        let has = |group: &[f32; 8]| group.iter().fold(false, |any, x| any | (*x >= top));
        let skipped = 8 * groups.iter().position(has).unwrap_or(groups.len());
        let j = skipped + z[skipped..].iter().position(|x| *x >= top).unwrap_or(0);
        let offset = self.offsets.get(j).copied().unwrap_or(0.0);
        let (Some(before), Some(after)) = (j.checked_sub(1).and_then(|j| z.get(j)), z.get(j + 1)) else {
            return (j, offset);
        };
        let bend = 2.0 * top - before - after;
        let fraction = if bend > 0.0 { (0.5 * (after - before) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        (j, offset + f64::from(fraction) * self.step)
    }
}

#[cfg(test)]
mod tests;
