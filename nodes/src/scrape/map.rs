//! The force that a contact draws from a map of a surface.

use super::law::{Heading, Law, Moves, log2};
use super::plane::{Interp, Plane};
use super::slew::Slew;
use super::voices::{CELL, Cell, Stretch};
use crate::texture::{DiscontinuityMap, FeatureMap, Grid, Pyramid, Surface};
use fearless_simd::{Level, dispatch};
use std::f64::consts::TAU;

/// Corner of the high-pass that takes the mean from a map that is never negative, Hz.
const CORNER: f64 = 20.0;
/// Most levels of a pyramid: steps of 2048 pixels.
const LEVELS: usize = 12;

/// One level of a map: the map, and what one of its pixels is of a full one along x and y.
type Scaled<const C: usize> = (Plane<C>, [f64; 2]);

/// What is read of a map.
#[derive(Clone, Debug, PartialEq)]
enum Reading {
    /// A gradient along the way.
    Slope(Vec<Scaled<2>>),
    /// The change of a value along the way.
    Change(Vec<Scaled<1>>),
    /// A value.
    Value(Vec<Scaled<1>>),
}

/// A map of a surface, ready to be read at any place and at any speed.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMap {
    reading: Reading,
    surface: Surface,
}

fn levels(grid: &Grid, surface: &Surface) -> Vec<(Grid, [f64; 2])> {
    let pyramid = Pyramid::new(grid.clone(), surface.wrap);
    pyramid.levels.into_iter().take(LEVELS).map(|level| (level.grid, level.scale)).collect()
}

fn scalar(grid: &Grid, surface: &Surface) -> Vec<Scaled<1>> {
    let laid = |(grid, scale): (Grid, _)| (Plane::new([&grid], [[false; 2]], surface.wrap), scale);
    levels(grid, surface).into_iter().map(laid).collect()
}

impl SurfaceMap {
    /// The slope that a contact meets: the gradient of a map along its way.
    #[must_use]
    pub fn slope(map: &DiscontinuityMap) -> Self {
        let surface = map.surface;
        let both = levels(&map.gx, &surface).into_iter().zip(levels(&map.gy, &surface));
        let along = [[true, false], [false, true]];
        let laid = both.map(|((x, scale), (y, _))| (Plane::new([&x, &y], along, surface.wrap), scale));
        Self { reading: Reading::Slope(laid.collect()), surface }
    }

    /// The size of the gradient of a map.
    #[must_use]
    pub fn size(map: &DiscontinuityMap) -> Self {
        let samples = map.gx.samples.iter().zip(&map.gy.samples).map(|(x, y)| x.hypot(*y)).collect();
        let size = Grid { width: map.gx.width, height: map.gx.height, samples };
        Self { reading: Reading::Value(scalar(&size, &map.surface)), surface: map.surface }
    }

    /// How features change along the way of a contact, per pixel.
    #[must_use]
    pub fn feature_change(map: &FeatureMap) -> Self {
        Self::change(&map.grid, map.surface)
    }

    /// How any map changes along the way of a contact, per pixel.
    #[must_use]
    pub fn change(grid: &Grid, surface: Surface) -> Self {
        Self { reading: Reading::Change(scalar(grid, &surface)), surface }
    }

    /// The strength of features.
    #[must_use]
    pub fn feature(map: &FeatureMap) -> Self {
        Self { reading: Reading::Value(scalar(&map.grid, &map.surface)), surface: map.surface }
    }

    /// How it lies on the surface.
    #[must_use]
    pub fn surface(&self) -> Surface {
        self.surface
    }

    /// Whether the sign of what is read depends on the direction; otherwise it is never negative.
    #[must_use]
    pub fn directional(&self) -> bool {
        !matches!(self.reading, Reading::Value(_))
    }

    /// Reads it at places of pixels from pixel `base`; `footprints` are pixels from one sample to the next, where any is
    /// above a half.
    #[inline(always)]
    fn read(
        &self,
        interp: Interp,
        places: &Places,
        footprints: Option<&Cell>,
        range: [usize; 2],
        out: &mut Cell,
    ) {
        let Places { base, x, y, tx, ty } = *places;
        match &self.reading {
            Reading::Slope(levels) => {
                each(levels, base, x, y, footprints, range, out, |plane, base, n, x, y, _| {
                    plane.along(interp, base, x, y, [tx[n], ty[n]])
                })
            }
            Reading::Value(levels) => {
                each(levels, base, x, y, footprints, range, out, |plane, base, _, x, y, _| {
                    plane.value(interp, base, x, y)
                })
            }
            Reading::Change(levels) => {
                each(levels, base, x, y, footprints, range, out, |plane, base, n, x, y, scale| {
                    let [gx, gy] = plane.gradient(interp, base, x, y);
                    gx * tx[n] * scale[0] + gy * ty[n] * scale[1]
                });
            }
        }
    }
}

struct Places<'a> {
    base: [i64; 2],
    x: &'a Cell,
    y: &'a Cell,
    tx: &'a Cell,
    ty: &'a Cell,
}

/// Reads the samples of a range, each between the two levels that suit its step.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn each<const C: usize>(
    levels: &[Scaled<C>],
    base: [i64; 2],
    x: &Cell,
    y: &Cell,
    footprints: Option<&Cell>,
    [from, to]: [usize; 2],
    out: &mut Cell,
    read: impl Fn(&Plane<C>, [i64; 2], usize, f32, f32, [f32; 2]) -> f32,
) {
    let Some((full, _)) = levels.first() else { return };
    let Some(footprints) = footprints else {
        for n in from..to.min(CELL) {
            out[n] = read(full, base, n, x[n], y[n], [1.0; 2]);
        }
        return;
    };
    let last = levels.len() - 1;
    // A coarser level has a scale of its own; its places are found in double precision.
    let coarse = |level: usize, n: usize| {
        let Some((plane, scale)) = levels.get(level).filter(|_| level > 0) else {
            return read(full, base, n, x[n], y[n], [1.0; 2]);
        };
        let at = [(base[0], x[n]), (base[1], y[n])].map(|(base, x)| base as f64 + f64::from(x));
        let at = [at[0] / scale[0], at[1] / scale[1]];
        let whole = at.map(f64::floor);
        let [px, py] = [0, 1].map(|k| (at[k] - whole[k]) as f32);
        read(plane, whole.map(|x| x as i64), n, px, py, scale.map(|s| (1.0 / s) as f32))
    };
    for n in from..to.min(CELL) {
        let depth = (1.0 + log2(footprints[n].max(0.5))).clamp(0.0, last as f32);
        let level = depth.floor() as usize;
        let way = depth - level as f32;
        let near = coarse(level, n);
        out[n] = if way > 0.0 { near + way * (coarse((level + 1).min(last), n) - near) } else { near };
    }
}

/// What one contact leaves behind in a [`MapForce`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MapVoice {
    heading: Heading,
    /// Last input and output of the high-pass.
    high: Option<[f32; 2]>,
}

/// The force of contacts that move over a map: `kappa (f/f_ref)^a (v/v_ref)^b m(t)`.
///
/// # Complexity
/// 16 pixels per sample and contact; 32 at speeds at which more than half a pixel is passed from one sample to the next.
#[derive(Clone, Debug)]
pub struct MapForce {
    simd: Level,
    /// Strength.
    pub law: Law,
    /// Size of the surface: 2 is everything twice as large.
    pub scale: Slew,
    interp: Interp,
    /// Feedback of the high-pass.
    feedback: f32,
    moves: Moves,
    x: Cell,
    y: Cell,
}

impl MapForce {
    /// A force at a sample rate.
    #[must_use]
    pub fn new(law: Law, scale: f64, interp: Interp, rate: f64) -> Self {
        let feedback = (-TAU * CORNER / rate).exp() as f32;
        let (simd, scale) = (Level::new(), Slew::new(scale, rate));
        Self { simd, law, scale, interp, feedback, moves: Moves::new(), x: [0.0; CELL], y: [0.0; CELL] }
    }

    /// Adds the force of one contact over one stretch, N.
    pub fn add(&mut self, map: &SurfaceMap, voice: &mut MapVoice, stretch: &Stretch, out: &mut [f32]) {
        let simd = self.simd;
        dispatch!(simd, _simd => self.stretch(map, voice, stretch, out));
    }

    #[inline(always)]
    fn stretch(&mut self, map: &SurfaceMap, voice: &mut MapVoice, stretch: &Stretch, out: &mut [f32]) {
        let way = stretch.way();
        let [dx, dy] = map.surface.density;
        let aspect = [(dx / dy).sqrt() as f32, (dy / dx).sqrt() as f32];
        self.moves.follow(stretch, &way, aspect, &mut voice.heading);
        let base = self.place(stretch, &way, [dx, dy]);
        let range = [stretch.from, stretch.to];
        let size = self.scale.at(stretch.anchor);
        let dense = (dx.max(dy) / size / stretch.rate) as f32;
        let mut footprints = self.moves.speed;
        footprints.iter_mut().for_each(|v| *v *= dense);
        let far = stretch.part(&mut footprints).iter().any(|x| *x > 0.5);
        let Self { moves, x, y, .. } = &*self;
        let places = Places { base, x, y, tx: &moves.tx, ty: &moves.ty };
        let mut made = [0.0; CELL];
        map.read(self.interp, &places, far.then_some(&footprints), range, &mut made);
        if !map.directional() {
            high_pass(self.feedback, &mut voice.high, stretch.part(&mut made));
        }
        self.law.apply(stretch, &self.moves, &mut made);
        out.iter_mut().zip(stretch.part(&mut made)).for_each(|(out, x)| *out += *x);
    }

    /// The places of a stretch in pixels from a pixel that is returned.
    #[inline(always)]
    fn place(&mut self, stretch: &Stretch, way: &[[f64; 2]; 4], density: [f64; 2]) -> [i64; 2] {
        let size = self.scale.at(stretch.anchor);
        let start = [0, 1].map(|k| way[0][k] * density[k] / size);
        let whole = start.map(f64::floor);
        let part = [0, 1].map(|k| start[k] - whole[k]);
        if self.scale.settled(stretch.anchor).is_some() {
            let [dx, dy] = density.map(|d| (d / size) as f32);
            let [px, py] = part.map(|p| p as f32);
            for n in 0..CELL {
                self.x[n] = px + dx * self.moves.x[n];
                self.y[n] = py + dy * self.moves.y[n];
            }
        } else {
            // All places move while the size does.
            for n in stretch.from..stretch.to.min(CELL) {
                let size = self.scale.at(stretch.anchor + n as i64);
                let at = |k: usize, local: f32| {
                    ((way[0][k] + f64::from(local)) * density[k] / size - whole[k]) as f32
                };
                self.x[n] = at(0, self.moves.x[n]);
                self.y[n] = at(1, self.moves.y[n]);
            }
        }
        whole.map(|x| x as i64)
    }
}

#[inline(always)]
fn high_pass(feedback: f32, state: &mut Option<[f32; 2]>, samples: &mut [f32]) {
    let Some(first) = samples.first() else { return };
    // A contact begins without a step.
    let [mut before, mut y] = state.unwrap_or([*first, 0.0]);
    for x in samples {
        y = feedback * (y + *x - before);
        before = *x;
        *x = y;
    }
    *state = Some([before, if y.abs() < 1e-20 { 0.0 } else { y }]);
}
